/* Eight real linear systems at once, without exchanging rows. */
#ifndef FLEXLIN_ELIMINATION_H
#define FLEXLIN_ELIMINATION_H

#include "lanes.h"

/* X := G^-1 X, (n, columns); G becomes its factors. Returns the least sizes of the pivots. */
v8 eliminate_eight(int n, int columns, v8 *restrict G, v8 *restrict X);

/* X := G^-1 X for further right sides, by the factors that `eliminate_eight` leaves. */
void solve_eight(int n, int columns, const v8 *G, v8 *X);

#endif
