/* L real linear systems at once, without exchanging rows. */
#ifndef FLEXLIN_ELIMINATION_H
#define FLEXLIN_ELIMINATION_H

#include "lanes.h"

/* X := G^-1 X, (n, columns), of L systems; G becomes its factors, by which `solve_again` does the same for further right sides. */
void eliminate(int n, int columns, vec *G, vec *X);
void solve_again(int n, int columns, const vec *G, vec *X);

/* Refine w, at most so many times, until the first of L systems solve G w = right to rounding; factors: what `eliminate` left of G; left (n, columns)
 * is changed. Returns which do, as bits; *turns: how often that took. */
int refine(int n, int columns, int count, const vec *G, const vec *factors, const vec *right, vec *w, vec *left, int most, int *turns);

#endif
