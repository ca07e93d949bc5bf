/* Matrices of eight times at once, for decoupling: a block holds eight nodes of one complex matrix, n x n, real and imaginary parts apart.
 *
 * Columns and rows come in conjugate pairs (mate), so products are made for the first row of each pair only. C^-1 is made without
 * pivoting: C is near 1 but for a scaling of rows and columns, which elimination does not see.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_STATES = 128 };

typedef double v8 __attribute__((vector_size(64)));
typedef double u8 __attribute__((vector_size(64), aligned(8))); /* eight numbers of a caller's array */
typedef struct { int n, leaders, leader[MOST_STATES], mate[MOST_STATES]; } Shape;

static inline v8 splat(double x) { return (v8){x, x, x, x, x, x, x, x}; }

/* The rows of conjugate modes are conjugate, columns exchanged. A: n n real parts, then n n imaginary ones. */
static void mirror(const Shape *s, v8 *A) {
  int n = s->n, size = n * n;
  for (int l = 0; l < s->leaders; l++) {
    int i = s->leader[l], k = s->mate[i];
    if (k == i) continue;
    for (int j = 0; j < n; j++) {
      A[k * n + s->mate[j]] = A[i * n + j];
      A[size + k * n + s->mate[j]] = -A[size + i * n + j];
    }
  }
}

/* C = A B, the leaders' rows, one block. */
static void multiply(const Shape *s, const v8 *restrict A, const v8 *restrict B, v8 *restrict C) {
  int n = s->n, size = n * n;
  for (int l = 0; l < s->leaders; l++) {
    const v8 *a = A + s->leader[l] * n;
    int j = 0;
    for (; j + 2 <= n; j += 2) {
      v8 r0 = splat(0.0), i0 = r0, r1 = r0, i1 = r0;
      for (int k = 0; k < n; k++) {
        v8 x = a[k], y = a[size + k];
        const v8 *b = B + k * n + j;
        r0 += x * b[0] - y * b[size];
        i0 += x * b[size] + y * b[0];
        r1 += x * b[1] - y * b[size + 1];
        i1 += x * b[size + 1] + y * b[1];
      }
      v8 *c = C + s->leader[l] * n + j;
      c[0] = r0; c[size] = i0; c[1] = r1; c[size + 1] = i1;
    }
    for (; j < n; j++) {
      v8 r = splat(0.0), i = r;
      for (int k = 0; k < n; k++) {
        const v8 *b = B + k * n + j;
        r += a[k] * b[0] - a[size + k] * b[size];
        i += a[k] * b[size] + a[size + k] * b[0];
      }
      C[s->leader[l] * n + j] = r;
      C[size + s->leader[l] * n + j] = i;
    }
  }
}

/* X := A^-1 X, one block; A is lost. */
static void solve(int n, v8 *restrict A, v8 *restrict X) {
  int size = n * n;
  for (int k = 0; k < n; k++) {
    v8 x = A[k * n + k], y = A[size + k * n + k], over = 1.0 / (x * x + y * y);
    v8 pr = x * over, pi = -y * over;
    for (int pass = 0; pass < 2; pass++) {
      v8 *row = (pass ? X : A) + k * n;
      for (int j = pass ? 0 : k + 1; j < n; j++) {
        v8 r = row[j], i = row[size + j];
        row[j] = r * pr - i * pi;
        row[size + j] = r * pi + i * pr;
      }
    }
    for (int i = k + 1; i < n; i++) {
      v8 fr = A[i * n + k], fi = A[size + i * n + k];
      for (int pass = 0; pass < 2; pass++) {
        v8 *row = (pass ? X : A) + i * n;
        const v8 *top = (pass ? X : A) + k * n;
        for (int j = pass ? 0 : k + 1; j < n; j++) {
          row[j] -= fr * top[j] - fi * top[size + j];
          row[size + j] -= fr * top[size + j] + fi * top[j];
        }
      }
    }
  }
  for (int k = n - 1; k >= 0; k--)
    for (int i = 0; i < k; i++) {
      v8 fr = A[i * n + k], fi = A[size + i * n + k];
      for (int j = 0; j < n; j++) {
        X[i * n + j] -= fr * X[k * n + j] - fi * X[size + k * n + j];
        X[size + i * n + j] -= fr * X[size + k * n + j] + fi * X[k * n + j];
      }
    }
}

/* Numbers (nodes, `parts` n n), every `step`th of the nodes from `first` on, to and from blocks; parts: 2 for complex numbers, 1 for real ones. */
static void gather(int parts, int size, int nodes, int step, int first, const double *from, v8 *to) {
  for (int t = 0; t < nodes; t++) {
    const double *x = from + (long)parts * size * (first + (long)step * t);
    double *y = (double *)(to + (long)parts * size * (t / 8)) + t % 8;
    for (int e = 0; e < size; e++)
      for (int p = 0; p < parts; p++) y[8 * (p * size + e)] = x[parts * e + p];
  }
}
static void scatter(int size, int nodes, int step, int first, const v8 *from, double *to) {
  for (int t = 0; t < nodes; t++) {
    double *x = to + 2L * size * (first + (long)step * t);
    const double *y = (const double *)(from + 2L * size * (t / 8)) + t % 8;
    for (int e = 0; e < size; e++) { x[2 * e] = y[8 * e]; x[2 * e + 1] = y[8 * (size + e)]; }
  }
}

/* One entry at all nodes, from its blocks. */
static void take_entry(int size, int blocks, const v8 *from, int entry, double *re, double *im) {
  for (int b = 0; b < blocks; b++, re += 8, im += 8) {
    *(u8 *)re = from[2 * size * b + entry];
    *(u8 *)im = from[2 * size * b + size + entry];
  }
}

/* out = (columns of waves)' x for one entry: x at the nodes, waves (nodes, 8 width) real, `row` numbers from one node to the next. */
static void transform(int nodes, int width, int row, const double *waves, const double *re, const double *im, v8 *out_re, v8 *out_im) {
  for (int w = 0; w < width; w += 2) {
    int pair = w + 1 < width;
    v8 r0 = splat(0.0), i0 = r0, r1 = r0, i1 = r0;
    const double *wave = waves + 8 * w;
    if (pair)
      for (int t = 0; t < nodes; t++, wave += row) {
        v8 one = *(const u8 *)wave, two = *(const u8 *)(wave + 8);
        r0 += re[t] * one; i0 += im[t] * one; r1 += re[t] * two; i1 += im[t] * two;
      }
    else
      for (int t = 0; t < nodes; t++, wave += row) {
        v8 one = *(const u8 *)wave;
        r0 += re[t] * one; i0 += im[t] * one;
      }
    out_re[w] = r0; out_im[w] = i0;
    if (pair) { out_re[w + 1] = r1; out_im[w + 1] = i1; }
  }
}

static void make_identity(int n, v8 *X) {
  for (int e = 0; e < 2 * n * n; e++) X[e] = splat(e < n * n && e % (n + 1) == 0 ? 1.0 : 0.0);
}
