/* Transition matrices of M y'' + D y' + K y = 0 by Gauss collocation in the accelerations, eight segments at a time: the computation of
 * `collocate_accelerations` in gauss.py, without exchanging rows. */
#include "elimination.h"

typedef struct { int m, stages; const double *c, *a, *square, *b; } Rule; /* square: a a */

/* Blocks [M D K] of the stages (stages, m, 3 m), in coordinates of inertias near 1: times d d'. */
static void gather_blocks(const Rule *r, int segments, const double *from, const double *d, v8 *to) {
  int m = r->m, size = 3 * m * m, all = r->stages * size;
  for (int l = 0; l < 8; l++) { /* the last segment again where there are fewer */
    const double *x = from + (long)all * (l < segments ? l : segments - 1);
    for (int e = 0; e < all; e++) to[e][l] = x[e] * d[e % size / (3 * m)] * d[e % m];
  }
}

/* G w = right for the accelerations of all stages, G_ij = M_i (i = j) + h a_ij D_i + h^2 (a a)_ij K_i. */
static void build_equations(const Rule *r, const v8 *blocks, v8 h, v8 *G, v8 *right) {
  int m = r->m, s = r->stages, n = s * m;
  for (int i = 0; i < s; i++)
    for (int p = 0; p < m; p++) {
      const v8 *M = blocks + (i * m + p) * 3 * m, *D = M + m, *K = D + m;
      v8 *row = G + (long)(i * m + p) * n, *y = right + (long)(i * m + p) * 2 * m;
      for (int j = 0; j < s; j++) {
        v8 ha = h * r->a[i * s + j], hha = h * h * r->square[i * s + j];
        for (int q = 0; q < m; q++) row[j * m + q] = ha * D[q] + hha * K[q] + (i == j ? M[q] : splat(0.0));
      }
      for (int q = 0; q < m; q++) { y[q] = -K[q]; y[m + q] = -D[q] - h * r->c[i] * K[q]; }
    }
}

/* Phi = [1, h; 0, 1] + [h^2 sum b_i (1 - c_i) w_i; h sum b_i w_i] of one of the eight, back in its own coordinates. */
static void combine_stages(const Rule *r, int l, double h, const v8 *w, const double *d, double *Phi) {
  int m = r->m, columns = 2 * m;
  for (int p = 0; p < m; p++)
    for (int c = 0; c < columns; c++) {
      double place = 0.0, rate = 0.0, units = d[p] / d[c % m];
      for (int i = 0; i < r->stages; i++) {
        double own = r->b[i] * w[(i * m + p) * columns + c][l];
        place += (1.0 - r->c[i]) * own;
        rate += own;
      }
      Phi[p * columns + c] = units * h * h * place + (c == p) + (c == m + p ? h : 0.0);
      Phi[(m + p) * columns + c] = units * h * rate + (c == m + p);
    }
}

/* Units in which the inertias M (m, m), rows `stride` apart, are near 1: powers of two, which round nothing. */
static void choose_units(int m, int stride, const double *M, double *d) {
  for (int p = 0; p < m; p++) d[p] = exp2(-round(0.5 * log2(fabs(M[p * stride + p]))));
}

/* Transition matrices (segments, 2 m, 2 m) from [M D K] at all stages (segments, stages, m, 3 m) and lengths h; tableau: c, a, a a, b;
 * good (segments,): whether each is right to rounding. Returns 0 where there is no memory. */
CALLED int factor_accelerations(int m, int stages, int segments, const double *blocks, const double *lengths, const double *tableau, double *Phi, int *good) {
  Rule r = {m, stages, tableau, tableau + stages, tableau + stages + stages * stages, tableau + stages + 2 * stages * stages};
  long n = (long)stages * m, columns = 2 * m;
  v8 *memory = aligned_alloc(64, (3 * m * n + 2 * n * n + 3 * n * columns) * sizeof(v8));
  if (!memory) return 0;
  v8 *own = memory, *G = own + 3 * m * n, *right = G + n * n, *w = right + n * columns, *work = w + n * columns;
  for (int k = 0; k < segments; k += 8) {
    int count = segments - k < 8 ? segments - k : 8;
    const double *from = blocks + 3L * m * m * stages * k;
    double d[m];
    v8 h;
    choose_units(m, 3 * m, from, d);
    for (int l = 0; l < 8; l++) h[l] = lengths[k + (l < count ? l : count - 1)];
    gather_blocks(&r, count, from, d, own);
    build_equations(&r, own, h, G, right);
    int sound = solve_eight(n, columns, count, G, right, w, work);
    for (int l = 0; l < count; l++) {
      combine_stages(&r, l, h[l], w, d, Phi + (k + l) * columns * columns);
      good[k + l] = sound >> l & 1;
    }
  }
  free(memory);
  return 1;
}
