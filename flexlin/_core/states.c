/* Transition matrices of x' = A(t) x by collocation, eight segments at a time, without exchanging rows: Y_i = 1 + sum_j a_ij h A_j Y_j,
 * Phi = 1 + sum_j b_j h A_j Y_j. What the elimination may lose shows in the residual, and is won back by it once. */
#include "elimination.h"

typedef struct { int n, stages, stiff; const double *a, *b; } Rule; /* stiff: the last stage is the end of the step, b the last row of a */

/* G Y = 1 of all stages, G_ij = 1 (i = j) - a_ij h A_j. */
static void build_equations(const Rule *r, const v8 *hA, v8 *G, v8 *right) {
  int n = r->n, s = r->stages, all = s * n;
  for (int i = 0; i < s; i++)
    for (int p = 0; p < n; p++) {
      v8 *row = G + (long)(i * n + p) * all;
      for (int j = 0; j < s; j++) {
        const v8 *from = hA + (j * n + p) * n;
        double a = -r->a[i * s + j];
        for (int q = 0; q < n; q++) row[j * n + q] = a * from[q];
      }
      row[i * n + p] += 1.0;
      for (int q = 0; q < n; q++) right[(i * n + p) * n + q] = splat(p == q);
    }
}

/* slopes: h A_j Y_j; left: what Y_i - sum_j a_ij h A_j Y_j misses of 1. Returns the most of it, in roundings of the largest term. */
static v8 measure_accuracy(const Rule *r, const v8 *hA, const v8 *Y, v8 *slopes, v8 *left) {
  int n = r->n, s = r->stages, square = n * n;
  v8 worst = splat(0.0), size = splat(1.0);
  for (int j = 0; j < s; j++)
    for (int p = 0; p < n; p++) {
      v8 *to = slopes + (j * n + p) * n;
      for (int q = 0; q < n; q++) to[q] = splat(0.0);
      for (int k = 0; k < n; k++) {
        v8 a = hA[(j * n + p) * n + k];
        const v8 *row = Y + (j * n + k) * n;
        for (int q = 0; q < n; q++) to[q] += a * row[q];
      }
    }
  for (int i = 0; i < s; i++)
    for (int e = 0; e < square; e++) {
      v8 y = Y[i * square + e], sum = splat(0.0);
      for (int j = 0; j < s; j++) sum += r->a[i * s + j] * slopes[j * square + e];
      left[i * square + e] = y - (e % (n + 1) == 0) - sum;
      worst = larger(worst, left[i * square + e]);
      size = larger(larger(size, y), sum);
    }
  return worst / (2.3e-16 * size);
}

/* Transition matrices (segments, n, n) from A at all stages (segments, stages, n, n), lengths h and the tableau (a, b), in units of the states that
 * are powers of two; good (segments,): whether each is right to rounding. Returns 0 where there is no memory. */
CALLED int factor_states(int n, int stages, int segments, int stiff, const double *A, const double *lengths, const double *tableau, const double *units,
                         double *Phi, int *good) {
  Rule r = {n, stages, stiff, tableau, tableau + stages * stages};
  long square = (long)n * n, all = stages * square, size = (long)stages * n * stages * n;
  v8 *memory = aligned_alloc(64, (5 * all + size) * sizeof(v8));
  if (!memory) return 0;
  v8 *hA = memory, *G = hA + all, *Y = G + size, *slopes = Y + all, *left = slopes + all, *right = left + all;
  for (int k = 0; k < segments; k += 8) {
    int count = segments - k < 8 ? segments - k : 8;
    for (int l = 0; l < 8; l++) { /* the last segment again where there are fewer */
      int which = k + (l < count ? l : count - 1);
      for (long e = 0; e < all; e++) hA[e][l] = lengths[which] * A[which * all + e] * units[e % n] / units[e % square / n];
    }
    build_equations(&r, hA, G, Y);
    eliminate_eight(stages * n, n, G, Y);
    v8 off = measure_accuracy(&r, hA, Y, slopes, left);
    if (any_lost(off, count, ACCURATE)) {
      solve_eight(stages * n, n, G, left);
      for (long e = 0; e < all; e++) Y[e] -= left[e];
      measure_accuracy(&r, hA, Y, slopes, left);
      build_equations(&r, hA, G, right);
      off = measure_backward_error(stages * n, n, G, right, Y, left);
    }
    for (int e = 0; e < square; e++) {
      v8 sum = splat(e % (n + 1) == 0);
      for (int j = 0; j < stages; j++) sum += r.b[j] * slopes[j * square + e];
      if (stiff) sum = Y[(stages - 1) * square + e];
      for (int l = 0; l < count; l++) Phi[(k + l) * square + e] = sum[l] * units[e / n] / units[e % n];
    }
    for (int l = 0; l < count; l++) good[k + l] = off[l] <= ACCURATE;
  }
  free(memory);
  return 1;
}
