/* Eight real linear systems at once, without exchanging rows. */
#ifndef FLEXLIN_ELIMINATION_H
#define FLEXLIN_ELIMINATION_H

#include "lanes.h"

#define EPS 2.220446049250313e-16
#define TINY 2.2250738585072014e-308

/* w = G^-1 right (n, columns) of the first of eight systems, refined once; work: n (n + columns). Returns which are right to rounding, as bits. */
int solve_eight(int n, int columns, int count, const v8 *G, const v8 *right, v8 *w, v8 *work);

#endif
