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

/* X := G^-1 X, (n, columns), of eight systems at once, without exchanging rows; G becomes its factors. */
void eliminate_eight(int n, int columns, v8 *restrict G, v8 *restrict X) {
  for (int first = 0; first < n; first += TOGETHER) {
    int past = first + TOGETHER < n ? first + TOGETHER : n;
    for (int k = first; k < past; k++) {
      v8 *top = G + (long)k * n, *from = X + (long)k * columns, over = 1.0 / top[k];
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

/* The most of what is left, in roundings of sum_j |G_ij| |w_j| + |right_i|, all that a computation without exact sums can ask for.
 * Source: Higham, Accuracy and Stability of Numerical Algorithms, Theorem 7.3 (Oettli, Prager). */
v8 measure_backward_error(int n, int columns, const v8 *G, const v8 *right, const v8 *w, const v8 *left) {
  v8 worst = splat(0.0);
  for (int i = 0; i < n; i++)
    for (int c = 0; c < columns; c++) {
      v8 size = absolute(right[i * columns + c]);
      for (int j = 0; j < n; j++) size += absolute(G[(long)i * n + j] * w[j * columns + c]);
      worst = larger(worst, left[i * columns + c] / (2.3e-16 * size + 1e-300));
    }
  return worst;
}

/* Whether one of the first misses more than so many roundings. */
int any_lost(v8 off, int count, double most) {
  for (int l = 0; l < count; l++)
    if (!(off[l] <= most)) return 1;
  return 0;
}
