/* The spectrum of a long product, from its factors: balanced, multiplied together while well conditioned, brought into periodic Schur form, and
 * with bounds on what moves each eigenvalue. */
#include "schur.h"

static const double LARGEST = 1e70; /* products keep their entries within this and its inverse: modes that all grow alike are well conditioned */
static const double NORMAL = 6.0;   /* h |A| up to which a segment loses no more than roundings of its size: a normal A's fastest mode is given as much */
static const double LOSS = 0.005;   /* roundings of a stretched segment for each unit of its condition number: nine of ten random ones have no more */

/* The largest sum of moduli of a column of A (n, n), entries times scale_j / scale_i where there is one; of a row of its transpose. */
static double find_norm(int n, const double *A, const double *scale, int transposed) {
  double worst = 0.0;
  for (int j = 0; j < n; j++) {
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
      int e = transposed ? j * n + i : i * n + j;
      sum += fabs(A[e]) * (scale ? scale[e % n] / scale[e / n] : 1.0);
    }
    if (!(sum <= worst)) worst = sum;
  }
  return worst;
}

/* The condition number of A (n, n) in the 1-norm, infinite where it is singular; work (2 n n + n). */
static double measure_condition(const Lapack *lapack, int n, const double *A, double *work) {
  int failed;
  double *inverse = work + n * n;
  memcpy(work, A, (size_t)n * n * sizeof(double));
  for (int e = 0; e < n * n; e++) inverse[e] = e % (n + 1) == 0;
  lapack->dgesv(&n, &n, work, &n, (int *)(inverse + n * n), inverse, &n, &failed); /* of the transpose: the rows are LAPACK's columns */
  return failed ? INFINITY : find_norm(n, A, NULL, 0) * find_norm(n, inverse, NULL, 0);
}

/* One scaling by powers of two that evens rows and columns of sum |F_k|: F becomes S^-1 F S. work (n n). */
static void balance(const Lapack *lapack, int n, int count, double *F, double *scale, double *work) {
  int low, high, failed;
  long size = (long)n * n;
  for (int e = 0; e < size; e++) work[e] = 0.0;
  for (int k = 0; k < count; k++)
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) work[j * n + i] += fabs(F[k * size + i * n + j]);
  lapack->dgebal("S", &n, work, &n, &low, &high, scale, &failed, 1);
  for (int k = 0; k < count; k++)
    for (int e = 0; e < size; e++) F[k * size + e] *= scale[e % n] / scale[e / n];
}

/* How many roundings of its size each balanced factor carries: one, and more where its stages cancel.
 *
 * A nilpotent part of A much larger than its eigenvalues makes stages far larger than what they add up to. Backward stability allows a condition
 * number's worth of roundings there; where h |A| is small none of them cancel. steps (count, n, n): h A, in units of the states; or none.
 * Source: Higham, Accuracy and Stability of Numerical Algorithms (2002), ch. 7. Returns whether there are any. */
static int count_roundings(const Lapack *lapack, int n, int count, const double *F, const double *steps, const double *scale, double *counts, double *work) {
  int stretched = 0;
  for (int k = 0; k < count; k++) {
    counts[k] = 1.0;
    if (!steps) continue;
    const double *A = steps + (long)k * n * n;
    double stretch = sqrt(find_norm(n, A, scale, 0) * find_norm(n, A, scale, 1)) / NORMAL;
    if (!(stretch > 1.0)) continue;
    double more = fmin(pow(stretch, 4), LOSS * measure_condition(lapack, n, F + (long)k * n * n, work));
    if (more > 1.0) { stretched = 1; counts[k] = more; }
  }
  return stretched;
}

/* Whether the factors may be multiplied together in pairs: every product's condition number stays below a limit, and its entries in range. */
static int can_pair(const Lapack *lapack, int n, int count, const double *F, double limit, double *work) {
  long size = (long)n * n;
  for (int k = 0; k < (count + 1) / 2; k++) {
    const double *pair = F + 2 * k * size;
    double largest = 0.0;
    if (2 * k + 1 < count) {
      multiply_real(n, n, n, pair + size, pair, work);
      pair = work;
    }
    for (int e = 0; e < size; e++) largest = fmax(largest, fabs(pair[e]));
    if (!(largest < LARGEST && largest > 1.0 / LARGEST && measure_condition(lapack, n, pair, work + size) <= limit)) return 0;
  }
  return 1;
}

/* Sum neighbours' entries (count, size) in place. */
static void sum_pairs(int count, long size, double *values) {
  for (int k = 0; k < (count + 1) / 2; k++)
    for (long e = 0; e < size; e++) values[k * size + e] = values[2 * k * size + e] + (2 * k + 1 < count ? values[(2 * k + 1) * size + e] : 0.0);
}

/* Of rows (count, size) those of the groups' first factors, in `to`; none of none. */
static const double *pick_first(int count, int every, long size, const double *from, double *to) {
  for (int k = 0; from && k < count; k++) memcpy(to + k * size, from + k * every * size, size * sizeof(double));
  return from ? to : NULL;
}

/* Logs (n,) of the eigenvalues of F_(count-1) ... F_0 with bounds on their motion, by better factors (count, n, n; or none) and by rounding.
 *
 * start (n, n): bases to begin from, or none; steps: as of `count_roundings`; p, q, left, size, right: what is not known over each factor,
 * as of `Noise`; part: as of `bound_motion`. Made: bases end (n, n) for a similar product; stretched: whether factors carry more roundings than one. */
CALLED int find_spectrum(int n, int count, const double *plain, const double *better, const double *start, double limit, const double *steps,
                         int p, int q, int part, const double *left, const double *size, const double *right, const void *lapack,
                         double complex *logs, double complex *shift, double *method, double *rounding, double *end, int *stretched) {
  long square = (long)n * n, all = count * square, unknown = size ? (long)p * q : 0, sides = (left ? (long)n * p : 0) + (right ? (long)q * n : 0);
  for (long e = 0; e < all; e++)
    if (!isfinite(plain[e]) || (better && !isfinite(better[e]))) return NOT_FINITE;
  double *memory = malloc(((better ? 2 : 1) * all + count * (1 + unknown + sides) + 6 * square + 3 * n) * sizeof(double));
  cpx *space = malloc(((2L * count + 2) * square + n) * sizeof(cpx));
  int code = NO_MEMORY, groups = count, every = 1;
  if (memory && space) {
    double *counts = memory + (better ? 2 : 1) * all, *scale = counts + count, *work = scale + n, *bases = work + 4 * square + 2 * n;
    double *F = memory, *finer = better ? memory + all : NULL, *doubt = bases + square, *sided = doubt + count * unknown;
    memcpy(F, plain, all * sizeof(double));
    if (size) memcpy(doubt, size, count * unknown * sizeof(double));
    balance(lapack, n, count, F, scale, work);
    for (long e = 0; better && e < all; e++) finer[e] = better[e] * (scale[e % n] / scale[e % square / n]);
    *stretched = count_roundings(lapack, n, count, F, steps, scale, counts, work);
    if (start) {
      for (int e = 0; e < square; e++) work[e] = start[e] / scale[e / n];
      make_orthogonal(lapack, n, work, bases, work + square);
    }
    /* Neighbours are multiplied again and again while that costs the weakest mode no more digits than the limit has; what belongs to each
     * is added up. */
    for (; groups > 1 && can_pair(lapack, n, groups, F, limit, work); every *= 2) {
      sum_pairs(groups, 1, counts);
      sum_pairs(groups, unknown, doubt);
      if (better) multiply_pairs(n, groups, finer, work);
      groups = multiply_pairs(n, groups, F, work);
    }
    Noise noise = {p, q, pick_first(groups, every, (long)n * p, left, sided), doubt,
                   pick_first(groups, every, (long)q * n, right, sided + (left ? (long)groups * n * p : 0))};
    cpx *closure = space + (2L * groups + 1) * square;
    Form form = {n, groups, space, space + (groups + 1) * square, closure, closure + square, (cpx *)logs, sided + count * sides, end};
    code = find_schur_form(lapack, F, start ? bases : NULL, &form);
    if (code == SOUND) code = bound_motion(&form, F, finer, counts, size ? &noise : NULL, scale, part, (cpx *)shift, method, rounding);
    for (int e = 0; code == SOUND && e < square; e++) end[e] *= scale[e / n];
  }
  free(memory);
  free(space);
  return code;
}
