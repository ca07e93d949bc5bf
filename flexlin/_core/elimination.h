/* Eight real linear systems at once, without exchanging rows. */
#ifndef FLEXLIN_ELIMINATION_H
#define FLEXLIN_ELIMINATION_H

#include "lanes.h"

enum { ACCURATE = 64 }; /* roundings that a residual may be off by */

/* X := G^-1 X, (n, columns); G becomes its factors. */
void eliminate_eight(int n, int columns, v8 *restrict G, v8 *restrict X);

/* X := G^-1 X for further right sides, by the factors that `eliminate_eight` leaves. */
void solve_eight(int n, int columns, const v8 *G, v8 *X);

v8 measure_backward_error(int n, int columns, const v8 *G, const v8 *right, const v8 *w, const v8 *left);
int any_lost(v8 off, int count, double most);

#endif
