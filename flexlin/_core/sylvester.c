/* The blocks of a Sylvester equation between a group of modes and single ones, eight times at once: `against_scalars` in superadiabatic.py. */
#include <complex.h>

#include "lanes.h"

typedef struct { int p; v8 *re, *im, *x, *y; int *order; } Factors; /* L U of p x p in rows by `order`; x, y: a right side */

/* L U of eight matrices with common pivots, those whose least modulus is largest: neighbouring times have similar ones. */
static void factor_eight_alike(Factors *f) {
  int p = f->p;
  for (int k = 0; k < p; k++) {
    int pivot = k;
    double largest = -1.0;
    for (int i = k; i < p; i++) {
      v8 x = f->re[i * p + k], y = f->im[i * p + k], size = x * x + y * y;
      double least = size[0];
      for (int l = 1; l < 8; l++) least = size[l] < least ? size[l] : least;
      if (least > largest) { largest = least; pivot = i; }
    }
    if (pivot != k) {
      int row = f->order[k];
      f->order[k] = f->order[pivot];
      f->order[pivot] = row;
      for (int j = 0; j < p; j++) {
        v8 x = f->re[k * p + j], y = f->im[k * p + j];
        f->re[k * p + j] = f->re[pivot * p + j];
        f->im[k * p + j] = f->im[pivot * p + j];
        f->re[pivot * p + j] = x;
        f->im[pivot * p + j] = y;
      }
    }
    v8 a = f->re[k * p + k], b = f->im[k * p + k], over = 1.0 / (a * a + b * b), c = a * over, d = -b * over;
    f->re[k * p + k] = c; /* one over the pivot */
    f->im[k * p + k] = d;
    for (int i = k + 1; i < p; i++) {
      v8 *restrict re = f->re + i * p, *restrict im = f->im + i * p, *top = f->re + k * p, *below = f->im + k * p;
      v8 x = re[k] * c - im[k] * d, y = re[k] * d + im[k] * c;
      re[k] = x;
      im[k] = y;
      for (int j = k + 1; j < p; j++) {
        re[j] -= x * top[j] - y * below[j];
        im[j] -= x * below[j] + y * top[j];
      }
    }
  }
}

/* One step of a substitution: right side i less entry (row, column) times right side k. */
static inline void take_away(Factors *f, int i, int entry, int k) {
  v8 a = f->re[entry], b = f->im[entry], x = f->x[k], y = f->y[k];
  f->x[i] -= a * x - b * y;
  f->y[i] -= a * y + b * x;
}

static inline void divide(Factors *f, int i) {
  v8 a = f->re[i * f->p + i], b = f->im[i * f->p + i], x = f->x[i], y = f->y[i];
  f->x[i] = a * x - b * y;
  f->y[i] = a * y + b * x;
}

/* M s = right side (rows by `order`), or s M = right side, whose entries then belong to the rows `order`. */
static void solve_eight_alike(Factors *f, int transposed) {
  int p = f->p;
  if (!transposed) {
    for (int i = 0; i < p; i++)
      for (int k = 0; k < i; k++) take_away(f, i, i * p + k, k);
    for (int i = p - 1; i >= 0; i--) {
      for (int k = i + 1; k < p; k++) take_away(f, i, i * p + k, k);
      divide(f, i);
    }
    return;
  }
  for (int k = 0; k < p; k++) {
    divide(f, k);
    for (int i = k + 1; i < p; i++) take_away(f, i, k * p + i, k);
  }
  for (int k = p - 1; k >= 0; k--)
    for (int i = 0; i < k; i++) take_away(f, i, k * p + i, k);
}

/* S (times, n, n), between the modes start ... start + p - 1 and each of `count` scalars, from B (times, n, n), complex. 0: no memory. */
CALLED int solve_against_scalars(int n, int times, int start, int p, int count, const int *scalars, const double complex *matrices, double complex *solution) {
  const double *B = (const double *)matrices;
  double *S = (double *)solution;
  long size = (long)p * p;
  v8 *memory = aligned_alloc(64, (4 * size + 2 * p) * sizeof(v8)), *own = memory + 2 * size;
  int *order = malloc(p * sizeof(int));
  if (!memory || !order) { free(memory); free(order); return 0; }
  Factors f = {p, memory, memory + size, memory + 4 * size, memory + 4 * size + p, order};
  for (int t = 0; t < times; t += 8) {
    int many = times - t < 8 ? times - t : 8;
    const double *at[8];
    for (int l = 0; l < 8; l++) at[l] = B + 2L * (t + (l < many ? l : many - 1)) * n * n;
    for (int e = 0; e < size; e++)
      for (int l = 0; l < 8; l++) {
        const double *entry = at[l] + 2L * ((start + e / p) * n + start + e % p);
        own[e][l] = entry[0];
        own[size + e][l] = entry[1];
      }
    for (int c = 0; c < count; c++) {
      int k = scalars[c];
      memcpy(f.re, own, 2 * size * sizeof(v8));
      for (int i = 0; i < p; i++) {
        order[i] = i;
        for (int l = 0; l < 8; l++) {
          const double *b = at[l] + 2L * (k * n + k);
          f.re[i * p + i][l] -= b[0];
          f.im[i * p + i][l] -= b[1];
        }
      }
      factor_eight_alike(&f);
      for (int transposed = 0; transposed < 2; transposed++) {
        for (int i = 0; i < p; i++)
          for (int l = 0; l < 8; l++) {
            const double *entry = at[l] + 2L * (transposed ? k * n + start + i : (start + order[i]) * n + k);
            f.x[i][l] = transposed ? entry[0] : -entry[0];
            f.y[i][l] = transposed ? entry[1] : -entry[1];
          }
        solve_eight_alike(&f, transposed);
        for (int i = 0; i < p; i++)
          for (int l = 0; l < many; l++) {
            double *to = S + 2L * ((long)(t + l) * n * n + (transposed ? k * n + start + order[i] : (start + i) * n + k));
            to[0] = f.x[i][l];
            to[1] = f.y[i][l];
          }
      }
    }
  }
  free(memory);
  free(order);
  return 1;
}

/* S (times, n, n) between two groups of p modes from `first` on and q from `second` on: (B_ii (x) 1 - 1 (x) B_jj') s_ij = -b_ij. 0: no memory. */
CALLED int solve_between_groups(int n, int times, int first, int p, int second, int q, const double complex *matrices, double complex *solution) {
  const double *B = (const double *)matrices;
  double *S = (double *)solution;
  int m = p * q;
  long size = (long)m * m;
  v8 *memory = aligned_alloc(64, (2 * size + 2 * m) * sizeof(v8));
  int *order = malloc(m * sizeof(int));
  if (!memory || !order) { free(memory); free(order); return 0; }
  Factors f = {m, memory, memory + size, memory + 2 * size, memory + 2 * size + m, order};
  for (int t = 0; t < times; t += 8) {
    int many = times - t < 8 ? times - t : 8;
    for (long e = 0; e < 2 * size; e++) memory[e] = splat(0.0);
    for (int l = 0; l < 8; l++) {
      const double *at = B + 2L * (t + (l < many ? l : many - 1)) * n * n;
      for (int i = 0; i < p; i++)
        for (int j = 0; j < q; j++) {
          for (int k = 0; k < p; k++) {
            const double *entry = at + 2L * ((first + i) * n + first + k);
            f.re[(i * q + j) * m + k * q + j][l] += entry[0];
            f.im[(i * q + j) * m + k * q + j][l] += entry[1];
          }
          for (int k = 0; k < q; k++) {
            const double *entry = at + 2L * ((second + k) * n + second + j);
            f.re[(i * q + j) * m + i * q + k][l] -= entry[0];
            f.im[(i * q + j) * m + i * q + k][l] -= entry[1];
          }
        }
    }
    for (int i = 0; i < m; i++) order[i] = i;
    factor_eight_alike(&f);
    for (int l = 0; l < 8; l++)
      for (int i = 0; i < m; i++) {
        const double *entry = B + 2L * ((long)(t + (l < many ? l : many - 1)) * n * n + (first + order[i] / q) * n + second + order[i] % q);
        f.x[i][l] = -entry[0];
        f.y[i][l] = -entry[1];
      }
    solve_eight_alike(&f, 0);
    for (int l = 0; l < many; l++)
      for (int i = 0; i < m; i++) {
        double *to = S + 2L * ((long)(t + l) * n * n + (first + i / q) * n + second + i % q);
        to[0] = f.x[i][l];
        to[1] = f.y[i][l];
      }
  }
  free(memory);
  free(order);
  return 1;
}
