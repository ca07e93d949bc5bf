/* Eight real linear systems at once, without exchanging rows. */
#include "elimination.h"

enum { TOGETHER = 4 }; /* pivots that a row is freed of at once: it is read and written once for all of them */

/* row -= sum_q f_q top_q, over `count` columns. */
static inline void subtract_rows(int count, const v8 *f, const v8 *top, long stride, v8 *restrict row) {
  for (int j = 0; j < count; j++) row[j] = row[j] - f[0] * top[j] - f[1] * top[stride + j] - f[2] * top[2 * stride + j] - f[3] * top[3 * stride + j];
}

/* X := U^-1 X of what `eliminate_eight` leaves of G. */
static void substitute_back(int n, int columns, const v8 *G, v8 *X) {
  for (int k = n - 1; k >= 0; k--) {
    v8 *to = X + (long)k * columns;
    const v8 *row = G + (long)k * n;
    for (int i = k + 1; i < n; i++)
      for (int c = 0; c < columns; c++) to[c] -= row[i] * X[(long)i * columns + c];
    for (int c = 0; c < columns; c++) to[c] *= row[k];
  }
}

/* X := G^-1 X, (n, columns), of eight systems at once, without exchanging rows; G becomes its factors. Returns the least sizes of the pivots. */
v8 eliminate_eight(int n, int columns, v8 *restrict G, v8 *restrict X) {
  v8 least = splat(INFINITY);
  for (int first = 0; first < n; first += TOGETHER) {
    int past = first + TOGETHER < n ? first + TOGETHER : n;
    for (int k = first; k < past; k++) {
      v8 *top = G + (long)k * n, *from = X + (long)k * columns, pivot = top[k], over = 1.0 / pivot;
      for (int l = 0; l < 8; l++) least[l] = fabs(pivot[l]) >= least[l] ? least[l] : fabs(pivot[l]);
      top[k] = over;
      for (int i = k + 1; i < past; i++) {
        v8 *row = G + (long)i * n, *to = X + (long)i * columns, factor = row[k] * over;
        for (int j = k + 1; j < n; j++) row[j] -= factor * top[j];
        for (int c = 0; c < columns; c++) to[c] -= factor * from[c];
      }
    }
    for (int i = past; i < n; i++) { /* only where all TOGETHER are there */
      v8 *row = G + (long)i * n, factor[TOGETHER];
      for (int q = 0; q < TOGETHER; q++) {
        v8 *top = G + (long)(first + q) * n;
        factor[q] = row[first + q] * top[first + q];
        for (int j = first + q + 1; j < past; j++) row[j] -= factor[q] * top[j];
      }
      subtract_rows(n - past, factor, G + (long)first * n + past, n, row + past);
      subtract_rows(columns, factor, X + (long)first * columns, columns, X + (long)i * columns);
    }
  }
  substitute_back(n, columns, G, X);
  return least;
}

/* X := G^-1 X for further right sides, by the factors that `eliminate_eight` leaves: 1 / u on the diagonal, l u below it. */
void solve_eight(int n, int columns, const v8 *G, v8 *X) {
  for (int i = 1; i < n; i++) {
    v8 *to = X + (long)i * columns;
    for (int k = 0; k < i; k++) {
      v8 factor = G[(long)i * n + k] * G[(long)k * n + k];
      for (int c = 0; c < columns; c++) to[c] -= factor * X[(long)k * columns + c];
    }
  }
  substitute_back(n, columns, G, X);
}
