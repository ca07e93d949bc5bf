/* Transition matrices of x' = A(t) x by collocation, L segments at a time, without exchanging rows: Y_i = 1 + sum_j a_ij h A_j Y_j,
 * Phi = 1 + sum_j b_j h A_j Y_j. */
#include "elimination.h"

typedef struct { int n, stages, stiff; const double *a, *b; } Rule; /* stiff: the last stage is the end of the step, b the last row of a */

/* G Y = 1 of all stages, G_ij = 1 (i = j) - a_ij h A_j. */
static void build_equations(const Rule *r, const vec *hA, vec *G, vec *right) {
  int n = r->n, s = r->stages, all = s * n;
  for (int i = 0; i < s; i++)
    for (int p = 0; p < n; p++) {
      vec *row = G + (long)(i * n + p) * all;
      for (int j = 0; j < s; j++) {
        const vec *from = hA + (j * n + p) * n;
        double a = -r->a[i * s + j];
        for (int q = 0; q < n; q++) row[j * n + q] = a * from[q];
      }
      row[i * n + p] += 1.0;
      for (int q = 0; q < n; q++) right[(i * n + p) * n + q] = splat(p == q);
    }
}

/* Transition matrices (segments, n, n) from A at all stages (segments, stages, n, n), lengths h and the tableau (a, b), in units of the states that
 * are powers of two; good (segments,): whether each is right to rounding. Returns -1 where there is no memory. */
CALLED int factor_states(int n, int stages, int segments, int stiff, const double *A, const double *lengths, const double *tableau, const double *units,
                         double *Phi, int *good) {
  Rule r = {n, stages, stiff, tableau, tableau + stages * stages};
  long square = (long)n * n, all = stages * square, size = all * stages;
  vec *memory = aligned_alloc(sizeof(vec), (4 * all + 2 * size) * sizeof(vec));
  if (!memory) return -1;
  vec *hA = memory, *G = hA + all, *right = G + size, *Y = right + all, *left = Y + all, *factors = left + all;
  for (int k = 0; k < segments; k += L) {
    int count = segments - k < L ? segments - k : L;
    for (int l = 0; l < L; l++) { /* the last segment again where there are fewer */
      int which = k + (l < count ? l : count - 1);
      const double *x = A + which * all;
      for (vec *y = hA; y < hA + all;)
        for (int p = 0; p < n; p++)
          for (int q = 0; q < n; q++) (*y++)[l] = lengths[which] * *x++ * (units[q] / units[p]);
    }
    build_equations(&r, hA, G, right);
    memcpy(factors, G, size * sizeof(vec));
    memcpy(Y, right, all * sizeof(vec));
    eliminate(stages * n, n, factors, Y);
    int turns, sound = refine(stages * n, n, count, G, factors, right, Y, left, 1, &turns);
    for (int p = 0; p < n; p++)
      for (int q = 0; q < n; q++) {
        vec sum = splat(0.0);
        for (int j = 0; j < stages && !stiff; j++)
          for (int i = 0; i < n; i++) sum += r.b[j] * hA[(j * n + p) * n + i] * Y[(j * n + i) * n + q];
        sum = stiff ? Y[((stages - 1) * n + p) * n + q] : sum + splat(p == q); /* last: a small sum is not rounded to one's digits at each step */
        for (int l = 0; l < count; l++) Phi[(k + l) * square + p * n + q] = sum[l] * units[p] / units[q];
      }
    for (int l = 0; l < count; l++) good[k + l] = sound >> l & 1;
  }
  free(memory);
  return 0;
}
