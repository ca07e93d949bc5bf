/* The periodic solution by Newton's method on its series: each step's Lyapunov equation is solved by exponential steps of second order, whatever
 * the loop's eigenvalues, and what these miss the next step corrects. The calls of correcting.py; conventions as in sweeps.c.
 *
 * In a step h from a node, with the loop M there, the right side F and all that changes until the next node (to first order in time)
 *
 *     D(t) = Phi' D(t + h) Phi + integral of exp(M' s) (F + s / h K) exp(M s) ds,   K = F(t + h) - F(t) + what M(t + h) - M(t) makes of D(t + h)
 *
 * Phi and the integral are doubled from h / 2^k on, where a few powers of M do.
 * Source: Hochbruck, Ostermann, Exponential integrators, Acta Numerica 19 (2010) 209.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define REACH 0.25   /* size of h M / 2^k */
#define KNOWN_LOOP 1e-2 /* change of X with which the loop is known */
#define CLOSE 1e-3   /* what of D need not close */
#define ROUNDS 24
#define SLOWER 0.7   /* a step this long against the one before it, and FAR of X, leads nowhere */
#define FAR 1e-6
#define ENOUGH 0.25  /* what will do where a solution grows again */
#define CLOSINGS 4

/* A linear equation's loop M (nodes, n, n), and exp(M s) of s = h / 2^k, ..., h: (nodes, k + 1, n, n). */
typedef struct { int n, doublings; long nodes; double h; v4 *M, *powers; } Loop;

/* Make ready the loops A - S X in units of the states in which X has a diagonal of ones at the most; false where there is no memory. */
static int prepare(const Equation *is, const v4 *X, double h, Loop *loop) {
  int n = is->n, z = n * n, E = triangle(n);
  double units[n], size = 0.0;
  v4 rate[E], half[z];
  loop->n = n, loop->nodes = is->nodes / 2, loop->h = h, loop->doublings = 1;
  memset(units, 0, sizeof units);
  for (long j = 0; j < loop->nodes; j++)
    for (int i = 0; i < n; i++)
      for (int l = 0; l < 4; l++) units[i] = fmax(units[i], sqrt(fabs(X[j * E + triangle(i) + i][l])));
  for (long j = 0; j < loop->nodes; j++) {
    const v4 *A = is->A.at + 2 * j * is->A.step;
    v4 *M = loop->M + j * z;
    riccati(is, 2 * j, X + j * E, rate, half);
    for (int i = 0; i < z; i++) M[i] = 2.0 * half[i] - A[i];
    for (int i = 0; i < n; i++) {
      v4 sum = splat(0.0);
      for (int k = 0; k < n; k++)
        for (int l = 0; l < 4; l++) sum[l] += M[i * n + k][l] == 0.0 ? 0.0 : fabs(M[i * n + k][l]) * units[i] / units[k];
      for (int l = 0; l < 4; l++) size = fmax(size, sum[l]);
    }
  }
  while (ldexp(h * size, -loop->doublings) > REACH && loop->doublings < MOST_DOUBLINGS) loop->doublings++;
  free(loop->powers);
  loop->powers = malloc((loop->doublings + 1) * loop->nodes * z * sizeof(v4));
  if (!loop->powers) return 0;
  for (long j = 0; j < loop->nodes; j++) {
    v4 *power = loop->powers + j * (loop->doublings + 1) * z;
    carry(n, ldexp(h, -loop->doublings), loop->M + j * z, 0, power);
    for (int k = 0; k < loop->doublings; k++) multiply(n, power + k * z, power + k * z, power + (k + 1) * z);
  }
  return 1;
}

/* Phi' D Phi of a symmetric D; two rows of its lower triangle at a time, and what comes with them. */
static void carry_back(int n, const v4 *D, const v4 *Phi, v4 *restrict carried) {
  v4 product[n * n], turned[2 * n];
  multiply(n, D, Phi, product);
  for (int i = 0; i < n; i += 2) {
    int rows = i + 1 < n ? 2 : 1, columns = i + rows;
    for (int a = 0; a < rows; a++)
      for (int k = 0; k < n; k++) turned[a * n + k] = Phi[k * n + i + a];
    for (int j = 0; j < columns; j += 4) {
      int some = columns - j;
      v4 *to = carried + i * n + j;
#define BLOCK_OF(rows, columns) multiply_block(rows, columns, n, n, n, 0, turned, product + j, to)
      if (some >= 4) rows == 2 ? BLOCK_OF(2, 4) : BLOCK_OF(1, 4);
      else if (some == 3) rows == 2 ? BLOCK_OF(2, 3) : BLOCK_OF(1, 3);
      else if (some == 2) rows == 2 ? BLOCK_OF(2, 2) : BLOCK_OF(1, 2);
      else BLOCK_OF(1, 1);
    }
  }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) carried[j * n + i] = carried[i * n + j];
}

/* L(D) = D M + M' D. */
static void differentiate(int n, const v4 *D, const v4 *M, v4 *restrict LD) {
  v4 product[n * n];
  multiply(n, D, M, product);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) LD[i * n + j] = product[i * n + j] + product[j * n + i];
}

/* D (nodes, E) of -D' = M' D + D M + F, backwards from D (n, n) at the end of each part; Phi: of the whole part. */
static void solve_backwards(const Loop *loop, const v4 *F, const v4 *end, v4 *D, v4 *restrict Phi) {
  int n = loop->n, z = n * n, E = triangle(n), many = loop->doublings;
  double s = ldexp(loop->h, -many);
  v4 behind[z], ahead[z], here[z], next[z], change[z], K[z], first[z], one[z], two[z], a[z], b[z];
  memcpy(behind, end, sizeof behind);
  unfold(n, F, one);
  for (int i = 0; i < z; i++) next[i] = turn(one[i], 1);
  memset(Phi, 0, z * sizeof(v4));
  for (int i = 0; i < n; i++) Phi[i * n + i] = splat(1.0);
  for (long j = loop->nodes - 1; j >= 0; j--) {
    const v4 *M = loop->M + j * z, *after = j + 1 < loop->nodes ? M + z : loop->M, *power = loop->powers + j * (many + 1) * z;
    for (int i = 0; i < z; i++) change[i] = (j + 1 < loop->nodes ? after[i] : turn(after[i], 1)) - M[i];
    for (int i = 0; i < z; i++) ahead[i] = j + 1 < loop->nodes ? power[(2 * many) * z + i] : turn(loop->powers[(many - 1) * z + i], 1);
    unfold(n, F + j * E, here);
    differentiate(n, behind, change, K);
    for (int i = 0; i < z; i++) K[i] = (K[i] + next[i] - here[i]) * ldexp(1.0, -many);
    differentiate(n, here, M, first);
    for (int i = 0; i < z; i++) one[i] = s * (0.5 * here[i] + K[i] / 3.0 + s / 6.0 * first[i]);
    differentiate(n, one, M, a);
    differentiate(n, K, M, b);
    for (int i = 0; i < z; i++) a[i] = s * (here[i] + 0.5 * K[i] + a[i]), b[i] = s * (K[i] + 0.5 * s * b[i]);
    for (int k = 0; k < many; k++, power += z) {
      for (int i = 0; i < z; i++) two[i] = a[i] + b[i];
      carry_back(n, two, power, one);
      carry_back(n, b, power, two);
      for (int i = 0; i < z; i++) a[i] += one[i], b[i] = 2.0 * (b[i] + two[i]);
    }
    carry_back(n, behind, power, one);
    for (int i = 0; i < n; i++)
      for (int l = 0; l <= i; l++) {
        v4 sum = 0.5 * (one[i * n + l] + one[l * n + i] + a[i * n + l] + a[l * n + i]);
        behind[i * n + l] = behind[l * n + i] = D[j * E + triangle(i) + l] = sum;
      }
    multiply(n, Phi, ahead, one);
    multiply(n, one, power - z, Phi);
    memcpy(next, here, sizeof here);
  }
}

/* The same over the whole period, D repeating; false where the loop does not forget. */
static int solve_periodic(const Loop *loop, const v4 *F, v4 *D) {
  int n = loop->n, z = n * n;
  v4 end[z], Phi[z], begin[z], gap[z], change[z];
  double most = 0.0;
  memset(end, 0, sizeof end);
  for (int k = 0; k < CLOSINGS; k++) {
    solve_backwards(loop, F, end, D, Phi);
    unfold(n, D, begin);
    for (int i = 0; i < z; i++) gap[i] = turn(begin[i], 1) - end[i];
    if (!isfinite(largest(z, gap)) || !close_parts(n, gap, Phi, change)) return 0;
    for (int i = 0; i < z; i++) end[i] += change[i];
    most = fmax(most, largest(z, end));
    if (k && largest(z, change) <= CLOSE * most) return 1;
  }
  return 1;
}

/* X, its slopes and the residual F = X' + A' X + X A - X S X + Q of a series at every second node, all (nodes, E). */
static void find_residual(const Equation *is, double T, int H, const double *cosines, const double *series, v8 *work, v4 *X, v4 *slopes, v4 *F) {
  int n = is->n, E = triangle(n);
  long nodes = is->nodes / 2;
  v4 half[n * n];
  evaluate(E, 4 * nodes, nodes, 0, T, H, cosines, series, work, X, slopes);
  for (long j = 0; j < nodes; j++) {
    riccati(is, 2 * j, X + j * E, F + j * E, half);
    for (int e = 0; e < E; e++) F[j * E + e] += slopes[j * E + e];
  }
}

/* The periodic solution on every second node as a series, from nothing or from a series (2 H + 1, E) that is close to it, until it changes by
 * less than `near` of itself, or by rounding. rate: the Hamiltonian's spectral radius; tol, X, series, shape: as of `sweep_until_closed`.
 * Returns 0 where it does not settle, or there is no memory. */
int correct_until_closed(const Equation *is, double T, double rate, double near, int start, const double *close, double tol, v4 *X, double *series,
                         long *shape) {
  int n = is->n, z = n * n, E = triangle(n), H, found = 0;
  long nodes = is->nodes / 2, count = 4 * nodes;
  double h = T / count, last = INFINITY;
  v8 *work;
  double *cosines = find_room(count, &work), *wave = calloc((size_t)count * E, sizeof(double));
  Loop loop = {.M = malloc(nodes * z * sizeof(v4))};
  v4 *slopes = malloc(3 * nodes * E * sizeof(v4)), *F = slopes + nodes * E, *D = F + nodes * E;
  H = count / 3 - 1;
  if (!cosines || !wave || !slopes || !loop.M) goto end;
  if (close) {
    int few = start < H ? start : H;
    memcpy(series, close, (few + 1) * E * sizeof(double));
    memset(series + (few + 1) * E, 0, (H - few) * E * sizeof(double));
    memcpy(series + (H + 1) * E, close + (start + 1) * E, few * E * sizeof(double));
    memset(series + (H + 1 + few) * E, 0, (H - few) * E * sizeof(double));
  } else if (!begin_coarsely(is, h, rate, X)) goto end;
  else transform(E, count, 1, H, cosines, X, work, series);
  for (int k = 0; k < ROUNDS; k++) {
    v4 change[z];
    double moved = 0.0;
    find_residual(is, T, H, cosines, series, work, X, slopes, F);
    if (last > KNOWN_LOOP && !prepare(is, X, h, &loop)) goto end;
    if (!solve_periodic(&loop, F, D)) goto end;
    transform(E, count, 1, H, cosines, D, work, wave);
    for (long i = 0; i < (2 * H + 1) * E; i++) series[i] += wave[i];
    for (long j = 0; j < nodes; j++) {
      unfold(n, D + j * E, change);
      moved = fmax(moved, compare(n, change, X + j * E));
    }
    if (!isfinite(moved)) goto end;
    if (moved <= near || (k && moved * moved <= near * last) || (moved <= FAR && moved > SLOWER * last)) {
      found = 1;
      break;
    }
    if (k > 2 && moved > (k > 5 ? SLOWER : 1.0) * last) goto end;
    last = moved;
  }
  if (found) {
    evaluate(E, count, nodes, 0, T, H, cosines, series, work, X, 0);
    shape[0] = fold(E, nodes, tol, X, series, shape + 1);
    found = shape[0] >= 0;
  }
end:
  free(cosines);
  free(wave);
  free(slopes);
  free(loop.M);
  free(loop.powers);
  return found;
}

/* D (many, nodes, E) of -D' = M' D + D M + F for several F (many, nodes, E), M = A - S X the loop of X (nodes, E) at every second node, until D
 * changes by less than `near` of itself, or grows again after little; all but the first are solved once. 0: no solution. */
int solve_lyapunov(const Equation *is, double T, double near, const v4 *X, int many, const v4 *F, v4 *D) {
  int n = is->n, z = n * n, E = triangle(n), H, found = 0;
  long nodes = is->nodes / 2, count = 4 * nodes;
  v8 *work;
  double h = T / count, *cosines = find_room(count, &work), *series = malloc(2 * (size_t)count * E * sizeof(double)), *wave = series + count * E;
  Loop loop = {.M = malloc(nodes * z * sizeof(v4))};
  v4 *more = malloc(3 * nodes * E * sizeof(v4)), *left = more + nodes * E, *slopes = left + nodes * E;
  if (!cosines || !series || !more || !loop.M || !prepare(is, X, h, &loop)) goto end;
  H = count / 3 - 1;
  for (int i = 0; i < many; i++, F += nodes * E, D += nodes * E) {
    memcpy(left, F, nodes * E * sizeof(v4));
    memset(series, 0, (2 * H + 1) * E * sizeof(double));
    memset(D, 0, nodes * E * sizeof(v4));
    double last = INFINITY;
    for (int k = found = 0; k < ROUNDS && !found; k++) {
      double moved = 0.0, size = 0.0;
      v4 whole[z], product[z];
      if (!solve_periodic(&loop, left, more)) goto end;
      transform(E, count, 1, H, cosines, more, work, wave);
      for (long e = 0; e < (2 * H + 1) * E; e++) series[e] += wave[e];
      memcpy(more, D, nodes * E * sizeof(v4));
      evaluate(E, count, nodes, 0, T, H, cosines, series, work, D, slopes);
      for (long e = 0; e < nodes * E; e++) more[e] = D[e] - more[e];
      for (long j = 0; j < nodes; j++) {
        unfold(n, more + j * E, whole);
        moved = fmax(moved, compare(n, whole, X + j * E));
        unfold(n, D + j * E, whole);
        size = fmax(size, compare(n, whole, X + j * E));
        differentiate(n, whole, loop.M + j * z, product);
        for (int a = 0, e = j * E; a < n; a++)
          for (int b = 0; b <= a; b++, e++) left[e] = F[e] + slopes[e] + product[a * n + b];
      }
      found = i || (k && (moved <= near * size || (moved > last && moved <= ENOUGH * size)));
      if (!isfinite(moved) || (k && !found && moved > last)) goto end;
      last = moved;
    }
    if (!found) goto end;
  }
end:
  free(cosines);
  free(series);
  free(more);
  free(loop.M);
  free(loop.powers);
  return found;
}

/* `find_residual` of a series of fewer waves than half of every second node; 0 where there is no memory. */
int evaluate_residual(const Equation *is, double T, int H, const double *series, v4 *X, v4 *slopes, v4 *F) {
  v8 *work;
  double *cosines = find_room(2 * is->nodes, &work);
  if (!cosines) return 0;
  find_residual(is, T, H, cosines, series, work, X, slopes, F);
  free(cosines);
  return 1;
}
