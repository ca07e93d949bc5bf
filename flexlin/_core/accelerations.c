/* Transition matrices of M y'' + D y' + K y = 0 by Gauss collocation in the accelerations, eight segments at a time: the computation of
 * `collocate_accelerations` in gauss.py, without exchanging rows. What that may lose shows in the residual, and is won back by it once. */
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

/* left: what M_i w_i + h D_i sum_j a_ij w_j + h^2 K_i sum_j (a a)_ij w_j misses of right_i, for each of the eight; work: 2 m columns.
 * Returns the most, in roundings of the largest term. */
static v8 measure_accuracy(const Rule *r, const v8 *blocks, v8 h, const v8 *w, v8 *work, v8 *left) {
  int m = r->m, s = r->stages, columns = 2 * m;
  v8 worst = splat(0.0), size = splat(0.0), *rates = work, *places = work + m * columns;
  for (int i = 0; i < s; i++) {
    for (int e = 0; e < m * columns; e++) {
      v8 first = splat(0.0), second = first;
      for (int j = 0; j < s; j++) {
        first += r->a[i * s + j] * w[j * m * columns + e];
        second += r->square[i * s + j] * w[j * m * columns + e];
      }
      rates[e] = h * first;
      places[e] = h * h * second;
    }
    for (int q = 0; q < m; q++) { places[q * columns + q] += 1.0; rates[q * columns + m + q] += 1.0; places[q * columns + m + q] += h * r->c[i]; }
    for (int p = 0; p < m; p++) {
      const v8 *M = blocks + (i * m + p) * 3 * m, *D = M + m, *K = D + m;
      for (int c = 0; c < columns; c++) {
        v8 x = splat(0.0), y = x, z = x;
        for (int q = 0; q < m; q++) {
          x += M[q] * w[(i * m + q) * columns + c];
          y += D[q] * rates[q * columns + c];
          z += K[q] * places[q * columns + c];
        }
        worst = larger(worst, left[(i * m + p) * columns + c] = x + y + z);
        size = larger(larger(larger(size, x), y), z);
      }
    }
  }
  return worst / (2.3e-16 * size + 1e-300);
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

/* Where eight segments are made: blocks of the stages, their equations, solutions, what these miss, right sides, and work. */
typedef struct { v8 *memory, *blocks, *G, *w, *left, *right, *work; } Bench;

static int take_bench(int m, int stages, Bench *to) {
  long n = (long)stages * m, columns = 2 * m;
  to->memory = aligned_alloc(64, (3 * m * n + n * n + 3 * n * columns + 2 * m * columns) * sizeof(v8));
  to->blocks = to->memory;
  to->G = to->blocks + 3 * m * n;
  to->w = to->G + n * n;
  to->left = to->w + n * columns;
  to->right = to->left + n * columns;
  to->work = to->right + n * columns;
  return to->memory != 0;
}

/* Transition matrices (count, 2 m, 2 m) of up to eight segments from the blocks on the bench, in units d, refined once where they miss more than so
 * many roundings; returns how many they miss. */
static v8 factor_together(const Rule *r, int count, v8 h, const double *d, double most, const Bench *at, double *Phi) {
  int columns = 2 * r->m, n = r->stages * r->m;
  build_equations(r, at->blocks, h, at->G, at->w);
  eliminate_eight(n, columns, at->G, at->w);
  v8 off = measure_accuracy(r, at->blocks, h, at->w, at->work, at->left);
  if (any_lost(off, count, most)) {
    solve_eight(n, columns, at->G, at->left);
    for (int e = 0; e < n * columns; e++) at->w[e] -= at->left[e];
    measure_accuracy(r, at->blocks, h, at->w, at->work, at->left);
    build_equations(r, at->blocks, h, at->G, at->right);
    off = measure_backward_error(n, columns, at->G, at->right, at->w, at->left);
  }
  for (int l = 0; l < count; l++) combine_stages(r, l, h[l], at->w, d, Phi + l * columns * columns);
  return off;
}

/* Units in which the inertias M (m, m), rows `stride` apart, are near 1: powers of two, which round nothing. */
static void choose_units(int m, int stride, const double *M, double *d) {
  for (int p = 0; p < m; p++) d[p] = exp2(-round(0.5 * log2(fabs(M[p * stride + p]))));
}

/* Transition matrices (segments, 2 m, 2 m) from [M D K] at all stages (segments, stages, m, 3 m) and lengths h; tableau: c, a, a a, b;
 * good (segments,): whether each is right to rounding. Returns 0 where there is no memory. */
CALLED int factor_accelerations(int m, int stages, int segments, const double *blocks, const double *lengths, const double *tableau, double *Phi, int *good) {
  Rule r = {m, stages, tableau, tableau + stages, tableau + stages + stages * stages, tableau + stages + 2 * stages * stages};
  Bench bench;
  if (!take_bench(m, stages, &bench)) return 0;
  for (int k = 0; k < segments; k += 8) {
    int count = segments - k < 8 ? segments - k : 8;
    const double *from = blocks + 3L * m * m * stages * k;
    double d[m];
    v8 h;
    choose_units(m, 3 * m, from, d);
    for (int l = 0; l < 8; l++) h[l] = lengths[k + (l < count ? l : count - 1)];
    gather_blocks(&r, count, from, d, bench.blocks);
    v8 off = factor_together(&r, count, h, d, ACCURATE, &bench, Phi + 4L * m * m * k);
    for (int l = 0; l < count; l++) good[k + l] = off[l] <= ACCURATE;
  }
  free(bench.memory);
  return 1;
}
