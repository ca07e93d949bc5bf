/* The residual of Riccati's equation against its running cost, and what is needed before: the calls of running_cost.py and backward.py.
 *
 * Samples as in sweeps.c: four times at once, one of each part of the period; S times -1/2.
 */
#include <math.h>
#include <string.h>

#define LEAST 1e-10 /* of a diagonal entry: a smaller pivot is rounding */
#define SOME 4      /* every so many nodes the sizes of terms are looked at */
#define POWERS 6    /* squarings by which eigenvalues are measured */

static inline v4 absolute(v4 x) { return (v4){fabs(x[0]), fabs(x[1]), fabs(x[2]), fabs(x[3])}; }

static inline double larger(double x, double y) { return x > y ? x : y; }

static inline v4 larger_four(v4 x, v4 y) { return (v4){larger(x[0], y[0]), larger(x[1], y[1]), larger(x[2], y[2]), larger(x[3], y[3])}; }

static inline double greatest(v4 x) { return fmax(fmax(x[0], x[1]), fmax(x[2], x[3])); }

/* X S X, S of the states that are acted on; the lower triangle counts. */
static void weigh_states(const Equation *is, const v4 *X, const v4 *S, v4 *restrict XSX) {
  int n = is->n, first = is->first, some = is->last - first;
  v4 left[n * some + 1], product[n * some + 1];
  for (int i = 0; i < n; i++)
    for (int k = 0; k < some; k++) left[i * some + k] = X[i * n + first + k];
  multiply_onto(some, some, n, 0, S, X + first * n, product);
  multiply_onto(n, some, n, 0, left, product, XSX);
}

/* L^-1 of C = L L', in place of C's lower triangle; false where C is not positive at all four times. */
static int invert_root(int n, v4 *C) {
  for (int j = 0; j < n; j++) {
    v4 size = C[j * n + j], pivot = size, root;
    for (int k = 0; k < j; k++) pivot -= C[j * n + k] * C[j * n + k];
    for (int l = 0; l < 4; l++) {
      if (!(pivot[l] > LEAST * size[l])) return 0;
      root[l] = sqrt(pivot[l]);
    }
    root = 1.0 / root;
    for (int i = j + 1; i < n; i++) {
      v4 sum = C[i * n + j];
      for (int k = 0; k < j; k++) sum -= C[i * n + k] * C[j * n + k];
      C[i * n + j] = sum * root;
    }
    C[j * n + j] = root;
  }
  for (int j = 0; j < n; j++)
    for (int i = j + 1; i < n; i++) {
      v4 sum = splat(0.0);
      for (int k = j; k < i; k++) sum -= C[i * n + k] * C[k * n + j];
      C[i * n + j] = sum * C[i * n + i];
    }
  return 1;
}

/* |L F L'| in Frobenius' norm at the worst of four times; L, F: lower triangles, F symmetric; work: as large as F. */
static double measure(int n, const v4 *L, v4 *F, v4 *work) {
  v4 total = splat(0.0);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) F[j * n + i] = F[i * n + j];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      v4 sum = splat(0.0);
      for (int k = 0; k <= i; k++) sum += L[i * n + k] * F[k * n + j];
      work[i * n + j] = sum;
    }
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      v4 sum = splat(0.0);
      for (int k = 0; k <= j; k++) sum += work[i * n + k] * L[j * n + k];
      total += (i == j ? 1.0 : 2.0) * sum * sum;
    }
  double squares = 0.0, broken = 0.0;
  for (int l = 0; l < 4; l++) squares = fmax(squares, total[l]), broken += total[l] - total[l];
  return sqrt(squares) + broken;
}

/* The least r with -r C <= F <= r C at every `stride`-th node from `offset` on, C = Q + X S X, F the residual with what rounding may make of
 * it; infinity: none, or X is not positive at the first. X, slopes: X and X' there (., E); unit: rounding of a sum relative to the sum of its
 * sizes. seen: the largest entries of F and of X, and the largest size of each entry of F with its rounding (E). */
static double find_share(const Equation *is, long offset, long stride, const v4 *X, const v4 *slopes, double unit, double *seen) {
  int n = is->n, z = n * n, E = triangle(n), some = is->last - is->first;
  int positive = 1;
  double share = 0.0, hidden = 0.0;
  v4 room[7 * z], *x = room, *XA = x + z, *P = XA + z, *XSX = P + z, *F = XSX + z, *C = F + z, *sizes = C + z;
  v4 size_x = splat(0.0), size_F[E], noise[E];
  memset(size_F, 0, sizeof size_F);
  memset(noise, 0, sizeof noise);
  for (long j = 0; offset + j * stride < is->nodes; j++) {
    long at = offset + j * stride;
    const v4 *A = is->A.at + at * is->A.step, *S = is->S.at + at * is->S.step, *Q = is->Q.at + at * is->Q.step, *rate = slopes + j * E;
    unfold(n, X + j * E, x);
    multiply(n, x, A, XA);
    weigh_states(is, x, S, XSX);
    for (int i = 0, e = 0; i < n; i++)
      for (int k = 0; k <= i; k++, e++) {
        int ik = i * n + k;
        v4 weighed = -2.0 * XSX[ik];
        F[ik] = rate[e] + XA[ik] + XA[k * n + i] - weighed + Q[e];
        C[ik] = Q[e] + weighed;
        size_F[e] = larger_four(size_F[e], absolute(F[ik]));
        size_x = larger_four(size_x, absolute(X[j * E + e]));
      }
    positive = positive && invert_root(n, C);
    if (positive) share = fmax(share, measure(n, C, F, P));
    if (!isfinite(share)) return INFINITY;
    if (j % SOME) continue;
    for (int i = 0; i < z; i++) x[i] = absolute(x[i]), F[i] = absolute(A[i]);
    for (int i = 0; i < some * some; i++) sizes[i] = absolute(S[i]);
    multiply(n, x, F, XA);
    weigh_states(is, x, sizes, XSX);
    for (int i = 0, e = 0; i < n; i++)
      for (int k = 0; k <= i; k++, e++) {
        int ik = i * n + k;
        F[ik] = unit * (absolute(rate[e]) + XA[ik] + XA[k * n + i] + 2.0 * XSX[ik] + absolute(Q[e]));
        C[ik] = positive ? absolute(C[ik]) : splat(0.0);
        noise[e] = larger_four(noise[e], F[ik]);
      }
    hidden = fmax(hidden, measure(n, C, F, P));
  }
  unfold(n, X, C);
  positive = positive && invert_root(n, C);
  seen[0] = 0.0;
  seen[1] = greatest(size_x);
  for (int e = 0; e < E; e++) {
    seen[0] = larger(seen[0], greatest(size_F[e]));
    seen[2 + e] = greatest(size_F[e]) + greatest(noise[e]);
  }
  return positive && isfinite(hidden) ? share + hidden : INFINITY;
}

/* -1/2 B W B' of the states from `first` on, at the nodes of each part; B (K, n, m), b numbers apart, W (m, m) symmetric, v numbers apart. */
void weigh_inputs(int first, int last, int m, long nodes, const double *B, long b, const double *W, long v, v4 *S) {
  int some = last - first;
  double by[m];
  for (int l = 0; l < 4; l++)
    for (long j = 0; j < nodes; j++) {
      const double *rows = B + (l * nodes + j) * b + first * m, *weight = W + (l * nodes + j) * v;
      v4 *to = S + j * some * some;
      for (int i = 0; i < some; i++) {
        for (int k = 0; k < m; k++) {
          by[k] = 0.0;
          for (int c = 0; c < m; c++) by[k] -= 0.5 * rows[i * m + c] * weight[c * m + k];
        }
        for (int k = 0; k <= i; k++) {
          double sum = 0.0;
          for (int c = 0; c < m; c++) sum += by[c] * rows[k * m + c];
          to[i * some + k][l] = to[k * some + i][l] = sum;
        }
      }
    }
}

/* What an error -k X <= E <= k X makes of K = W (B' X + N'), at every `stride`-th node from `offset` on: found: the largest
 * (W B' X B W)_ii X_jj, the largest entry of |W B'| |X|, and that of K. B (n, m), W (m, m), N (n, m): b, v, c numbers apart at all times of
 * the period; X (., E), one after the other, and every so many of these. */
void bound_gain(const Equation *is, long offset, long stride, long every, int m, const double *B, long b, const double *W, long v,
                const double *N, long c, const v4 *X, double *found) {
  int n = is->n, E = triangle(n);
  double by[n], x[n * n];
  found[0] = found[1] = found[2] = 0.0;
  for (long i = 0; offset + i * stride < is->nodes; i += every)
    for (int part = 0; part < 4; part++) {
      long k = part * is->nodes + offset + i * stride;
      const double *B_k = B + k * b, *W_k = W + k * v, *N_k = N + k * c;
      double reach = 0.0, height = 0.0;
      for (int j = 0, e = 0; j < n; j++)
        for (int l = 0; l <= j; l++) x[j * n + l] = x[l * n + j] = X[i * E + e++][part];
      for (int j = 0; j < n; j++) height = fmax(height, x[j * n + j]);
      for (int a = 0; a < m; a++) {
        double reached = 0.0;
        for (int j = 0; j < n; j++) {
          by[j] = 0.0;
          for (int l = 0; l < m; l++) by[j] += W_k[a * m + l] * B_k[j * m + l];
        }
        for (int j = 0; j < n; j++) {
          double sum = 0.0, sizes = 0.0, cross = 0.0;
          for (int l = 0; l < n; l++) sum += by[l] * x[l * n + j], sizes += fabs(by[l] * x[l * n + j]);
          for (int l = 0; l < m; l++) cross += W_k[a * m + l] * N_k[j * m + l];
          reached += sum * by[j];
          found[1] = fmax(found[1], sizes);
          found[2] = fmax(found[2], fabs(sum + cross));
        }
        reach = fmax(reach, reached);
      }
      found[0] = fmax(found[0], reach * height);
    }
}

/* What is needed for a bound on the error of a series of X, of fewer waves than half of the times: `find_share` half-way between every
 * `stride`-th node, and `bound_gain` at about `seen` of these. found: three numbers of that, and then those of `find_share`. */
double compare_with_equation(const Equation *is, long stride, double T, int H, const double *series, double unit, long seen, int m, const double *B, long b,
                    const double *W, long v, const double *N, long c, double *found) {
  long E = triangle(is->n), count = 4 * is->nodes / stride, q = count / 4;
  v8 *work;
  double share = INFINITY, *cosines = find_room(count, &work);
  v4 *X = malloc(2 * q * E * sizeof(v4)), *slopes = X + q * E;
  if (cosines && X) {
    evaluate(E, count, q, 1, T, H, cosines, series, work, X, slopes);
    share = find_share(is, stride / 2, stride, X, slopes, unit, found + 3);
    bound_gain(is, stride / 2, stride, q * 4 / seen ? q * 4 / seen : 1, m, B, b, W, v, N, c, X, found);
  }
  free(cosines);
  free(X);
  return share;
}

/* About the largest spectral radius of [[A, -S], [-Q, -A']] at a node of each part: |trace H^k|^(1 / k) of two powers k, whatever the
 * states' units. */
double find_rate(const Equation *is) {
  int n = is->n, m = 2 * n, some = is->last - is->first;
  const v4 *A = is->A.at, *S = is->S.at, *Q = is->Q.at;
  double radius = 0.0, logarithm[4] = {0.0};
  v4 H[m * m], square[m * m];
  memset(H, 0, sizeof H);
  for (int i = 0, e = 0; i < n; i++) {
    for (int j = 0; j < n; j++) H[i * m + j] = A[i * n + j], H[(n + j) * m + n + i] = -A[i * n + j];
    for (int j = 0; j <= i; j++, e++) H[(n + i) * m + j] = H[(n + j) * m + i] = -Q[e];
  }
  for (int i = 0; i < some; i++)
    for (int j = 0; j < some; j++) H[(is->first + i) * m + n + is->first + j] = 2.0 * S[i * some + j];
  for (int power = 1; power <= POWERS; power++) {
    v4 size = splat(0.0), trace = splat(0.0);
    multiply(m, H, H, square);
    for (int i = 0; i < m * m; i++) size = larger_four(size, absolute(square[i]));
    for (int l = 0; l < 4; l++) logarithm[l] = 2 * logarithm[l] + (size[l] > 0.0 ? log(size[l]) : 0.0), size[l] += size[l] == 0.0;
    for (int i = 0; i < m * m; i++) H[i] = square[i] / size;
    for (int i = 0; i < m; i++) trace += H[i * m + i];
    double part = ldexp(1.0, -power);
    for (int l = 0; l < 4 && power > POWERS - 2; l++) radius = fmax(radius, pow(fabs(trace[l]), part) * exp(logarithm[l] * part));
  }
  return radius;
}
