/* Eight real linear systems at once, without exchanging rows: what that may lose shows in the residual, and is won back by it once. */
#include "elimination.h"

enum {
  TOGETHER = 4, /* pivots that a row is freed of at once: it is read and written once for all of them */
  ACCURATE = 64 /* roundings that a residual may be off by */
};

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
static void eliminate_eight(int n, int columns, v8 *restrict G, v8 *restrict X) {
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
static void solve_again(int n, int columns, const v8 *G, v8 *X) {
  for (int i = 1; i < n; i++) {
    v8 *to = X + (long)i * columns;
    for (int k = 0; k < i; k++) {
      v8 factor = G[(long)i * n + k] * G[(long)k * n + k];
      for (int c = 0; c < columns; c++) to[c] -= factor * X[(long)k * columns + c];
    }
  }
  substitute_back(n, columns, G, X);
}

/* left = G w - right; returns the most of it, in roundings of |G| |w| + |right| of its row, all that any elimination leaves.
 * Source: Higham, Accuracy and Stability of Numerical Algorithms, ch. 7. */
static v8 measure_residual(int n, int columns, const v8 *G, const v8 *right, const v8 *w, v8 *left) {
  v8 worst = splat(0.0), largest = splat(0.0);
  for (int e = 0; e < n * columns; e++) largest = larger(largest, w[e]);
  for (int i = 0; i < n; i++) {
    v8 *to = left + (long)i * columns, row = splat(0.0), most = row;
    for (int c = 0; c < columns; c++) to[c] = -right[(long)i * columns + c];
    for (int j = 0; j < n; j++) {
      v8 g = G[(long)i * n + j];
      row += absolute(g);
      for (int c = 0; c < columns; c++) to[c] += g * w[(long)j * columns + c];
    }
    v8 size = row * largest;
    for (int c = 0; c < columns; c++) { most = larger(most, to[c]); size = larger(size, right[(long)i * columns + c]); }
    worst = larger(worst, most / (EPS * size + TINY));
  }
  return worst;
}

/* w = G^-1 right (n, columns) of the first of eight systems, refined once where they miss more than ACCURATE roundings; work: n (n + columns).
 * Returns whether each is right to rounding, as bits. */
int solve_eight(int n, int columns, int count, const v8 *G, const v8 *right, v8 *w, v8 *work) {
  v8 *factors = work, *left = work + (long)n * n, off;
  int good = 0;
  memcpy(factors, G, (size_t)n * n * sizeof(v8));
  memcpy(w, right, (size_t)n * columns * sizeof(v8));
  eliminate_eight(n, columns, factors, w);
  off = measure_residual(n, columns, G, right, w, left);
  for (int l = 0; l < count; l++) good |= (off[l] <= ACCURATE) << l;
  if (good == (1 << count) - 1) return good;
  solve_again(n, columns, factors, left);
  for (long e = 0; e < (long)n * columns; e++) w[e] -= left[e];
  off = measure_residual(n, columns, G, right, w, left);
  for (int l = good = 0; l < count; l++) good |= (off[l] <= ACCURATE) << l;
  return good;
}
