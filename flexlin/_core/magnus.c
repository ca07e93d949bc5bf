/* Transition matrices of a group of modes by Magnus series of order 6, eight segments at a time: with Taylor's
 * polynomial of degree 16 for the exponential. */
#include "lanes.h"

/* A tile of C = keep C + sign A B, n x n. */
static inline __attribute__((always_inline)) void multiply_tile(const int rows, const int columns, int n, double keep, double sign, const v8 *A,
                                                                const v8 *B, v8 *C) {
  v8 sum[4][4];
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < columns; j++) sum[i][j] = splat(0.0);
  for (int k = 0; k < n; k++)
    for (int i = 0; i < rows; i++)
      for (int j = 0; j < columns; j++) sum[i][j] += A[(long)i * n + k] * B[(long)k * n + j];
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < columns; j++) {
      v8 *to = C + (long)i * n + j;
      *to = keep == 0.0 ? sign * sum[i][j] : keep * *to + sign * sum[i][j];
    }
}

/* C = keep C + sign A B. */
static void multiply_eight(int n, double keep, double sign, const v8 *A, const v8 *B, v8 *C) {
  int i = 0;
  for (; i + 4 <= n; i += 4) {
    int j = 0;
    for (; j + 4 <= n; j += 4) multiply_tile(4, 4, n, keep, sign, A + (long)i * n, B + j, C + (long)i * n + j);
    for (; j < n; j++) multiply_tile(4, 1, n, keep, sign, A + (long)i * n, B + j, C + (long)i * n + j);
  }
  for (; i < n; i++) {
    int j = 0;
    for (; j + 4 <= n; j += 4) multiply_tile(1, 4, n, keep, sign, A + (long)i * n, B + j, C + (long)i * n + j);
    for (; j < n; j++) multiply_tile(1, 1, n, keep, sign, A + (long)i * n, B + j, C + (long)i * n + j);
  }
}

/* Z = X Y - Y X. */
static void commute(int n, const v8 *X, const v8 *Y, v8 *Z) {
  multiply_eight(n, 0.0, 1.0, X, Y, Z);
  multiply_eight(n, 1.0, -1.0, Y, X, Z);
}

/* Omega of the segments from A (3, n n) at their three Gauss nodes, as `average_sixth`; A is lost. work: 4 matrices. */
static void average_sixth(int n, double h, v8 *A, v8 *work, v8 *omega) {
  long size = (long)n * n;
  v8 *a1 = A, *a2 = A + size, *a3 = a2 + size, *C1 = work, *U = C1 + size, *C2 = U + size, *W = C2 + size;
  for (long e = 0; e < size; e++) {
    v8 x = A[e], y = A[size + e], z = A[2 * size + e];
    a1[e] = h * y;
    a2[e] = sqrt(15.0) / 3.0 * h * (z - x);
    a3[e] = 10.0 / 3.0 * h * (z - 2.0 * y + x);
  }
  commute(n, a1, a2, C1);
  for (long e = 0; e < size; e++) U[e] = 2.0 * a3[e] + C1[e];
  commute(n, a1, U, C2);
  for (long e = 0; e < size; e++) {
    U[e] = a2[e] - C2[e] / 60.0;
    W[e] = C1[e] - 20.0 * a1[e] - a3[e];
  }
  commute(n, W, U, omega);
  for (long e = 0; e < size; e++) omega[e] = a1[e] + a3[e] / 12.0 + omega[e] / 240.0;
}

enum { DEGREE = 16 };
static const double SMALL_ENOUGH = 0.7; /* norms below which the polynomial is exact to working precision */

/* X := exp X, by squaring; work: 5 matrices. Source: Paterson, Stockmeyer, SIAM J. Comput. 2 (1973), 60. */
static void exponentiate_eight(int n, v8 *X, v8 *work) {
  long size = (long)n * n;
  v8 *X2 = work, *X3 = X2 + size, *X4 = X3 + size, *sum = X4 + size, *next = sum + size;
  double norm = 0.0, c[DEGREE + 1] = {1.0};
  for (int k = 1; k <= DEGREE; k++) c[k] = c[k - 1] / k;
  for (int i = 0; i < n; i++) {
    v8 row = splat(0.0);
    for (int j = 0; j < n; j++)
      for (int l = 0; l < 8; l++) row[l] += fabs(X[(long)i * n + j][l]);
    for (int l = 0; l < 8; l++) norm = row[l] <= norm ? norm : row[l];
  }
  int squarings = norm > SMALL_ENOUGH && norm < 1e6 ? (int)ceil(log2(norm / SMALL_ENOUGH)) : 0;
  double scale = ldexp(1.0, -squarings);
  for (long e = 0; e < size; e++) X[e] *= scale;
  multiply_eight(n, 0.0, 1.0, X, X, X2);
  multiply_eight(n, 0.0, 1.0, X2, X, X3);
  multiply_eight(n, 0.0, 1.0, X2, X2, X4);
  for (long e = 0; e < size; e++) sum[e] = c[13] * X[e] + c[14] * X2[e] + c[15] * X3[e] + c[16] * X4[e];
  for (int i = 0; i < n; i++) sum[(long)i * (n + 1)] += c[12];
  for (int k = 8; k >= 0; k -= 4) {
    for (long e = 0; e < size; e++) next[e] = c[k + 1] * X[e] + c[k + 2] * X2[e] + c[k + 3] * X3[e];
    for (int i = 0; i < n; i++) next[(long)i * (n + 1)] += c[k];
    multiply_eight(n, 1.0, 1.0, X4, sum, next);
    v8 *other = sum;
    sum = next;
    next = other;
  }
  for (; squarings > 0; squarings--) {
    multiply_eight(n, 0.0, 1.0, sum, sum, next);
    v8 *other = sum;
    sum = next;
    next = other;
  }
  memcpy(X, sum, size * sizeof(v8));
}

/* Values of `count` entries of a series, sums of cosines and sines (highest + 1, 2, size), where the waves are those given (highest + 1, 2). */
static inline __attribute__((always_inline)) void add_waves(const int count, int size, int highest, const double *series, const v8 *waves, v8 *values) {
  v8 sum[4];
  for (int e = 0; e < count; e++) sum[e] = splat(0.0);
  for (int k = 0; k <= highest; k++, series += 2 * size)
    for (int e = 0; e < count; e++) sum[e] += series[e] * waves[2 * k] + series[size + e] * waves[2 * k + 1];
  for (int e = 0; e < count; e++) values[e] = sum[e];
}

/* Values (stages, p p) of a series, sums of cosines and sines (highest + 1, 2, p p), at the stages c of eight equal segments from `first` on. */
static void evaluate_series(int size, int highest, const double *series, int first, int segments, int stages, const double *c, v8 *values) {
  v8 waves[2 * highest + 2];
  for (int j = 0; j < stages; j++, values += size) {
    v8 cosine, sine;
    for (int l = 0; l < 8; l++) {
      double angle = 2.0 * M_PI * (first + l + c[j]) / segments;
      cosine[l] = cos(angle);
      sine[l] = sin(angle);
    }
    waves[0] = splat(1.0);
    waves[1] = splat(0.0);
    for (int k = 2; k <= 2 * highest; k += 2) {
      waves[k] = waves[k - 2] * cosine - waves[k - 1] * sine;
      waves[k + 1] = waves[k - 2] * sine + waves[k - 1] * cosine;
    }
    int e = 0;
    for (; e + 4 <= size; e += 4) add_waves(4, size, highest, series + e, waves, values + e);
    for (; e < size; e++) add_waves(1, size, highest, series + e, waves, values + e);
  }
}

/* Transition matrices (segments, n, n) of w' = A(t) w over equal segments of the period, each the product of those of `parts` equal parts.
 *
 * series: sums of cosines and sines (highest + 1, 2, n n). Returns 0 where there is no memory. */
CALLED int factor_magnus(int n, int highest, const double *series, int segments, int parts, double period, double *F) {
  static const double NODES[3] = {0.11270166537925831, 0.5, 0.88729833462074169};
  long size = (long)n * n;
  v8 *A = aligned_alloc(64, 11 * size * sizeof(v8));
  if (!A) return 0;
  v8 *omega = A + 3 * size, *product = omega + size, *next = product + size, *work = next + size;
  for (int k = 0; k < segments; k += 8) {
    for (int part = 0; part < parts; part++) {
      double c[3];
      for (int j = 0; j < 3; j++) c[j] = (part + NODES[j]) / parts;
      evaluate_series(size, highest, series, k, segments, 3, c, A);
      average_sixth(n, period / segments / parts, A, work, omega);
      exponentiate_eight(n, omega, work);
      if (part) multiply_eight(n, 0.0, 1.0, omega, product, next);
      v8 *other = part ? next : omega;
      if (part) next = product;
      else omega = product;
      product = other;
    }
    for (int l = 0; l < 8 && k + l < segments; l++)
      for (long e = 0; e < size; e++) F[(k + l) * size + e] = product[e][l];
  }
  free(A);
  return 1;
}
