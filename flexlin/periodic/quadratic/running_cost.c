/* The residual of Riccati's equation against its running cost, and what is needed before: the calls of running_cost.py and backward.py.
 *
 * Samples as in sweeps.c: S times -1/2, Q its half, rows of w numbers, times `step` numbers apart. Four times are worked on at once.
 */
#include <math.h>
#include <string.h>

#define LEAST 1e-10 /* of a diagonal entry: a smaller pivot is rounding */
#define SOME 4      /* every so many fours of times the sizes of terms are looked at */
#define POWERS 6    /* squarings by which eigenvalues are measured */

static inline v4 absolute(v4 x) { return (v4){fabs(x[0]), fabs(x[1]), fabs(x[2]), fabs(x[3])}; }

static inline double larger(double x, double y) { return x > y ? x : y; }

static inline v4 larger_four(v4 x, v4 y) { return (v4){larger(x[0], y[0]), larger(x[1], y[1]), larger(x[2], y[2]), larger(x[3], y[3])}; }

static inline double greatest(v4 x) { return fmax(fmax(x[0], x[1]), fmax(x[2], x[3])); }

/* A matrix at four times, rows of n. */
static void gather(int n, int w, const double *A, long a, double factor, v4 *to) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      const double *x = A + i * w + j;
      to[i * n + j] = factor * (a ? (v4){x[0], x[a], x[2 * a], x[3 * a]} : splat(x[0]));
    }
}

/* C = A B; of a symmetric C the lower triangle alone. */
static void multiply_four(int n, int symmetric, const v4 *A, const v4 *B, v4 *restrict C) {
  for (int i = 0; i < n; i++) {
    int end = symmetric ? i + 1 : n, j = 0;
    for (; j + 2 <= end; j += 2) {
      v4 x = splat(0.0), y = x;
      for (int k = 0; k < n; k++) x += A[i * n + k] * B[k * n + j], y += A[i * n + k] * B[k * n + j + 1];
      C[i * n + j] = x, C[i * n + j + 1] = y;
    }
    for (; j < end; j++) {
      v4 x = splat(0.0);
      for (int k = 0; k < n; k++) x += A[i * n + k] * B[k * n + j];
      C[i * n + j] = x;
    }
  }
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

/* The least r with -r C <= F <= r C at all K times, C = Q + X S X, F the residual with what rounding may make of it; infinity: none, or X is
 * not positive at the first. K: a multiple of four.
 *
 * X, slopes: X and X' (n (n + 1) / 2, K), the lower triangle row by row; unit: rounding of a sum relative to the sum of its sizes.
 * seen: the largest entries of F and of X, and the largest size of each entry of F with its rounding (n (n + 1) / 2). */
double find_share(int n, int w, long K, const double *A, long a, const double *S, long s, const double *Q, long q, const double *X,
                  const double *slopes, double unit, double *seen) {
  int z = n * n;
  double share = 0.0, hidden = 0.0;
  v4 room[9 * z], *A_k = room, *S_k = A_k + z, *Q_k = S_k + z, *x = Q_k + z, *XA = x + z, *P = XA + z, *XSX = P + z, *F = XSX + z, *C = F + z;
  v4 size_x = splat(0.0), size_F[n * (n + 1) / 2], noise[n * (n + 1) / 2];
  memset(size_F, 0, sizeof size_F);
  memset(noise, 0, sizeof noise);
  for (long k = 0; k < K; k += 4) {
    if (a || !k) gather(n, w, A + k * a, a, 1.0, A_k);
    if (s || !k) gather(n, w, S + k * s, s, -2.0, S_k);
    if (q || !k) gather(n, w, Q + k * q, q, 2.0, Q_k);
    for (int i = 0, e = 0; i < n; i++)
      for (int j = 0; j <= i; j++, e++) x[i * n + j] = x[j * n + i] = at(X + K * e + k);
    multiply_four(n, 0, x, A_k, XA);
    multiply_four(n, 0, S_k, x, P);
    multiply_four(n, 1, x, P, XSX);
    for (int i = 0, e = 0; i < n; i++)
      for (int j = 0; j <= i; j++, e++) {
        int ij = i * n + j;
        v4 f = at(slopes + K * e + k) + XA[ij] + XA[j * n + i] - XSX[ij] + Q_k[ij];
        C[ij] = Q_k[ij] + XSX[ij];
        F[ij] = f;
        size_F[e] = larger_four(size_F[e], absolute(f));
        size_x = larger_four(size_x, absolute(x[ij]));
      }
    if (!invert_root(n, C)) return INFINITY;
    share = fmax(share, measure(n, C, F, P));
    if (!isfinite(share)) return INFINITY;
    if (k / 4 % SOME) continue;
    for (int i = 0; i < z; i++) x[i] = absolute(x[i]), F[i] = absolute(A_k[i]);
    multiply_four(n, 0, x, F, XA);
    for (int i = 0; i < z; i++) F[i] = absolute(S_k[i]);
    multiply_four(n, 0, F, x, P);
    multiply_four(n, 1, x, P, XSX);
    for (int i = 0, e = 0; i < n; i++)
      for (int j = 0; j <= i; j++, e++) {
        int ij = i * n + j;
        F[ij] = unit * (absolute(at(slopes + K * e + k)) + XA[ij] + XA[j * n + i] + XSX[ij] + absolute(Q_k[ij]));
        C[ij] = absolute(C[ij]);
        noise[e] = larger_four(noise[e], F[ij]);
      }
    hidden = fmax(hidden, measure(n, C, F, P));
  }
  for (int i = 0, e = 0; i < n; i++)
    for (int j = 0; j <= i; j++, e++) C[i * n + j] = splat(X[K * e]);
  if (!invert_root(n, C)) return INFINITY;
  seen[0] = 0.0;
  seen[1] = greatest(size_x);
  for (int e = 0; e < n * (n + 1) / 2; e++) {
    seen[0] = larger(seen[0], greatest(size_F[e]));
    seen[2 + e] = greatest(size_F[e]) + greatest(noise[e]);
  }
  return isfinite(hidden) ? share + hidden : INFINITY;
}

/* -1/2 B W B' at K times, rows of w numbers; B (K, n, m), b numbers apart, W (m, m) symmetric, v numbers apart. */
void weigh_inputs(int n, int w, int m, long K, const double *B, long b, const double *W, long v, double *S) {
  double by[m];
  memset(S, 0, (size_t)K * n * w * sizeof(double));
  for (long k = 0; k < K; k++, B += b, W += v, S += n * w)
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < m; j++) {
        by[j] = 0.0;
        for (int l = 0; l < m; l++) by[j] -= 0.5 * B[i * m + l] * W[l * m + j];
      }
      for (int j = 0; j <= i; j++) {
        double sum = 0.0;
        for (int l = 0; l < m; l++) sum += by[l] * B[j * m + l];
        S[i * w + j] = S[j * w + i] = sum;
      }
    }
}

/* What an error -k X <= E <= k X makes of K = W (B' X + N'), at every so many of K times: found: the largest (W B' X B W)_ii X_jj, the largest
 * entry of |W B'| |X|, and that of K. B (n, m), W (m, m), N (n, m): b, v, c numbers apart. X: (n (n + 1) / 2, K), the lower triangle. */
void bound_gain(int n, int m, long K, long every, const double *B, long b, const double *W, long v, const double *N, long c, const double *X,
                double *found) {
  double by[n], x[n * n];
  found[0] = found[1] = found[2] = 0.0;
  for (long k = 0; k < K; k += every) {
    const double *B_k = B + k * b, *W_k = W + k * v, *N_k = N + k * c;
    double reach = 0.0, height = 0.0;
    for (int i = 0, e = 0; i < n; i++)
      for (int j = 0; j <= i; j++) x[i * n + j] = x[j * n + i] = X[K * e++ + k];
    for (int j = 0; j < n; j++) height = fmax(height, x[j * n + j]);
    for (int i = 0; i < m; i++) {
      double reached = 0.0;
      for (int j = 0; j < n; j++) {
        by[j] = 0.0;
        for (int l = 0; l < m; l++) by[j] += W_k[i * m + l] * B_k[j * m + l];
      }
      for (int j = 0; j < n; j++) {
        double sum = 0.0, sizes = 0.0, cross = 0.0;
        for (int l = 0; l < n; l++) sum += by[l] * x[l * n + j], sizes += fabs(by[l] * x[l * n + j]);
        for (int l = 0; l < m; l++) cross += W_k[i * m + l] * N_k[j * m + l];
        reached += sum * by[j];
        found[1] = fmax(found[1], sizes);
        found[2] = fmax(found[2], fabs(sum + cross));
      }
      reach = fmax(reach, reached);
    }
    found[0] = fmax(found[0], reach * height);
  }
}

/* About the largest spectral radius of [[A, -S], [-Q, -A']] at K times: |trace H^k|^(1 / k) of two powers k, whatever the states' units. */
double find_rate(int n, int w, long K, const double *A, long a, const double *S, long s, const double *Q, long q) {
  int m = 2 * n;
  double radius = 0.0, H[m * m], square[m * m];
  for (long k = 0; k < K; k++, A += a, S += s, Q += q) {
    double logarithm = 0.0;
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) {
        H[i * m + j] = A[i * w + j];
        H[i * m + n + j] = 2 * S[i * w + j];
        H[(n + i) * m + j] = -2 * Q[i * w + j];
        H[(n + i) * m + n + j] = -A[j * w + i];
      }
    for (int power = 1; power <= POWERS; power++) {
      double size = 0.0, trace = 0.0;
      memset(square, 0, sizeof square);
      for (int i = 0; i < m; i++)
        for (int l = 0; l < m; l++)
          for (int j = 0; j < m; j++) square[i * m + j] += H[i * m + l] * H[l * m + j];
      for (int i = 0; i < m * m; i++) size = fmax(size, fabs(square[i]));
      if (!(size > 0.0)) break;
      for (int i = 0; i < m * m; i++) H[i] = square[i] / size;
      logarithm = 2 * logarithm + log(size);
      for (int i = 0; i < m; i++) trace += H[i * m + i];
      double part = ldexp(1.0, -power);
      if (power > POWERS - 2) radius = fmax(radius, pow(fabs(trace), part) * exp(logarithm * part));
    }
  }
  return radius;
}
