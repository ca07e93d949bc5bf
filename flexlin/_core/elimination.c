/* L real linear systems at once, without exchanging rows: what that may lose shows in the residual, and is won back by it once. */
#include "elimination.h"

enum { ACCURATE = 64 }; /* roundings that a residual may be off by */
enum { TOGETHER = 4 }; /* pivots that rows are freed of at once, and columns of a product that stay in registers */

/* Two rows less sum_q f_q top_q each, over `count` columns; a row may stand for both. */
static inline void subtract_rows(int count, const vec *f, const vec *g, const vec *top, long stride, vec *row, vec *next) {
  for (int j = 0; j < count; j++) {
    const vec a = top[j], b = top[stride + j], c = top[2 * stride + j], d = top[3 * stride + j];
    vec x = row[j] - f[0] * a - f[1] * b - f[2] * c - f[3] * d, y = next[j] - g[0] * a - g[1] * b - g[2] * c - g[3] * d;
    row[j] = x;
    next[j] = y;
  }
}

/* to -= row X for a row (count,) and X (count, columns). */
static inline void subtract_product(int count, int columns, const vec *row, const vec *X, vec *to) {
  int c = 0;
  for (; c + TOGETHER <= columns; c += TOGETHER) {
    vec sum[TOGETHER];
    for (int q = 0; q < TOGETHER; q++) sum[q] = to[c + q];
    for (int k = 0; k < count; k++)
      for (int q = 0; q < TOGETHER; q++) sum[q] -= row[k] * X[(long)k * columns + c + q];
    for (int q = 0; q < TOGETHER; q++) to[c + q] = sum[q];
  }
  for (; c < columns; c++)
    for (int k = 0; k < count; k++) to[c] -= row[k] * X[(long)k * columns + c];
}

/* X := U^-1 X of what `eliminate` leaves of G. */
static void substitute_back(int n, int columns, const vec *G, vec *X) {
  for (int k = n - 1; k >= 0; k--) {
    vec *to = X + (long)k * columns;
    const vec *row = G + (long)k * n;
    subtract_product(n - k - 1, columns, row + k + 1, to + columns, to);
    for (int c = 0; c < columns; c++) to[c] *= row[k];
  }
}

/* Free row i of pivots `first` to `past`; what it takes of each in `factor`. */
static inline void free_row(int n, int first, int past, const vec *G, vec *row, vec *factor) {
  for (int q = 0; q < past - first; q++) {
    const vec *top = G + (long)(first + q) * n;
    row[first + q] = factor[q] = row[first + q] * top[first + q];
    for (int j = first + q + 1; j < past; j++) row[j] -= factor[q] * top[j];
  }
}

/* X := G^-1 X, (n, columns), of L systems at once, without exchanging rows; G becomes its factors, with inverse pivots. */
void eliminate(int n, int columns, vec *G, vec *X) {
  for (int first = 0; first < n; first += TOGETHER) {
    int past = first + TOGETHER < n ? first + TOGETHER : n;
    for (int k = first; k < past; k++) {
      vec *top = G + (long)k * n, *from = X + (long)k * columns;
      top[k] = 1.0 / top[k];
      for (int i = k + 1; i < past; i++) {
        vec *row = G + (long)i * n, *to = X + (long)i * columns, factor = row[k] *= top[k];
        for (int j = k + 1; j < n; j++) row[j] -= factor * top[j];
        for (int c = 0; c < columns; c++) to[c] -= factor * from[c];
      }
    }
    const vec *top = G + (long)first * n + past, *from = X + (long)first * columns;
    for (int i = past; i < n; i += 2) { /* only where all TOGETHER are there */
      int both = i + 1 < n;
      vec *row = G + (long)i * n, *to = X + (long)i * columns, *next = row + both * n, *under = to + both * columns, f[TOGETHER], g[TOGETHER];
      free_row(n, first, past, G, row, f);
      if (both) free_row(n, first, past, G, next, g);
      subtract_rows(n - past, f, both ? g : f, top, n, row + past, next + past);
      subtract_rows(columns, f, both ? g : f, from, columns, to, under);
    }
  }
  substitute_back(n, columns, G, X);
}

/* X := G^-1 X for further right sides, by the factors that `eliminate` leaves. */
void solve_again(int n, int columns, const vec *G, vec *X) {
  for (int i = 1; i < n; i++) subtract_product(i, columns, G + (long)i * n, X, X + (long)i * columns);
  substitute_back(n, columns, G, X);
}

/* left = right - G w; returns the most of it, in roundings of |G| |w| + |right| of its row, all that any elimination leaves.
 * Source: Higham, Accuracy and Stability of Numerical Algorithms, ch. 7. */
static vec measure_residual(int n, int columns, const vec *G, const vec *right, const vec *w, vec *left) {
  vec worst = splat(0.0), largest = splat(0.0);
  for (int e = 0; e < n * columns; e++) largest = larger(largest, w[e]);
  for (int i = 0; i < n; i++) {
    const vec *row = G + (long)i * n, *given = right + (long)i * columns;
    vec *to = left + (long)i * columns, sum = splat(0.0), most = sum;
    memcpy(to, given, columns * sizeof(vec));
    subtract_product(n, columns, row, w, to);
    for (int j = 0; j < n; j++) sum += larger(splat(0.0), row[j]);
    vec size = sum * largest;
    for (int c = 0; c < columns; c++) { most = larger(most, to[c]); size = larger(size, given[c]); }
    worst = larger(worst, most / (EPS * size + TINY));
  }
  return worst;
}

/* Refine w until the first of L systems solve G w = right to rounding. */
int refine(int n, int columns, int count, const vec *G, const vec *factors, const vec *right, vec *w, vec *left, int most, int *turns) {
  for (*turns = 0;; ++*turns) {
    vec off = measure_residual(n, columns, G, right, w, left);
    int good = 0;
    for (int l = 0; l < count; l++) good |= (off[l] <= ACCURATE) << l;
    if (good == (1 << count) - 1 || *turns == most) return good;
    solve_again(n, columns, factors, left);
    for (long e = 0; e < (long)n * columns; e++) w[e] += left[e];
  }
}
