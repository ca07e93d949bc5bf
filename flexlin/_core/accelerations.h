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

/* G w = right for the accelerations of all stages of L segments, the last again where there are fewer: G (n, n), right (n, 2 m) by the state at
 * the beginning. blocks: [M D K] of each (stages, m, 3 m), scaled in `own` by units d (m,) in which the inertias are near 1. Returns their lengths. */
vec build_equations(const Rule *r, int segments, const double *blocks, const double *lengths, double *d, vec *own, vec *G, vec *right);

/* Transition matrices of the first of the L, from the accelerations w (n, 2 m) by the state at the beginning. */
void combine_stages(const Rule *r, int count, vec h, const vec *w, const double *d, double *Phi);

#endif
