/* Collocation of M y'' + D y' + K y = 0 in the accelerations at the stages, L segments at a time. */
#ifndef FLEXLIN_ACCELERATIONS_H
#define FLEXLIN_ACCELERATIONS_H

#include "elimination.h"

typedef struct { int m, stages; const double *c, *a, *square, *b; } Rule; /* square: a a */

/* A rule from its tableau: c, a, a a, b. */
static inline Rule read_rule(int m, int stages, const double *tableau) {
  const double *a = tableau + stages, *square = a + stages * stages;
  return (Rule){m, stages, tableau, a, square, square + stages * stages};
}

/* Blocks [M D K] of the stages (stages, m, 3 m), in coordinates of inertias near 1: times d d'. */
void gather_blocks(const Rule *r, int segments, const double *from, const double *d, vec *to);

/* G w = right for the accelerations of all stages: G (n, n), right (n, 2 m) by the state at the beginning. */
void build_equations(const Rule *r, const vec *blocks, vec h, vec *G, vec *right);

/* Transition matrices of the first of the L, from the accelerations w (n, 2 m) by the state at the beginning. */
void combine_stages(const Rule *r, int count, vec h, const vec *w, const double *d, double *Phi);

/* Units in which the inertias M (m, m), rows `stride` apart, are near 1: powers of two, which round nothing. */
void choose_units(int m, int stride, const double *M, double *d);

#endif
