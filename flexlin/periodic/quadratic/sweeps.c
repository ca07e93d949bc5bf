/* The Riccati equation -X' = A' X + X A - X S X + Q swept backwards over a period by Adams' methods: the calls of backward.py.
 *
 * A matrix is n rows of w numbers, w a multiple of four, zeros behind column n. Samples at K nodes stand one after the other, `step`
 * numbers apart: 0 for a constant; S is given times -1/2, and of Q its half. Node k stands at k h; node K is node 0 of the next period.
 */
#include <math.h>
#include <string.h>

#define MOST 12     /* the highest order */
#define SWEEPS 30
#define CLOSED 1e-4 /* what is left of a loop that has forgotten */
#define LEAST 1e-10 /* of a diagonal entry: a smaller pivot is rounding */
#define SOME 4      /* every so many times the sizes of terms are looked at */

typedef double v4 __attribute__((vector_size(32), aligned(8)));
typedef struct { const double *at; long step; } Samples;

static inline v4 splat(double x) { return (v4){x, x, x, x}; }

/* C = C0 + A B, C apart from A and B: two rows and eight columns at a time. No C0: 0. */
static inline __attribute__((always_inline)) void multiply_onto(int n, int w, const double *restrict C0, const double *restrict A,
                                                                const double *restrict B, double *restrict C) {
  for (int i = 0; i < n; i += 2) {
    const double *a = A + i * w, *b = i + 1 < n ? a + w : a;
    for (int j = 0; j < w; j += 8) {
      v4 r0 = splat(0.0), r1 = r0, s0 = r0, s1 = r0;
      const double *column = B + j, *c = C0 ? C0 + i * w + j : A, *d = i + 1 < n ? c + w : c;
      if (C0) r0 = *(const v4 *)c, s0 = *(const v4 *)d;
      if (j + 4 < w) {
        if (C0) r1 = *(const v4 *)(c + 4), s1 = *(const v4 *)(d + 4);
        for (int k = 0; k < n; k++, column += w) {
          v4 x = splat(a[k]), y = splat(b[k]), u = *(const v4 *)column, v = *(const v4 *)(column + 4);
          r0 += x * u; r1 += x * v; s0 += y * u; s1 += y * v;
        }
        *(v4 *)(C + i * w + j + 4) = r1;
        if (i + 1 < n) *(v4 *)(C + (i + 1) * w + j + 4) = s1;
      } else {
        for (int k = 0; k < n; k++, column += w) {
          v4 u = *(const v4 *)column;
          r0 += splat(a[k]) * u; s0 += splat(b[k]) * u;
        }
      }
      *(v4 *)(C + i * w + j) = r0;
      if (i + 1 < n) *(v4 *)(C + (i + 1) * w + j) = s0;
    }
  }
}

static void multiply(int n, int w, const double *A, const double *B, double *restrict C) { multiply_onto(n, w, 0, A, B, C); }

/* rate = -X'; half = A - S X / 2. S: times -1/2; Q: its half. */
static void riccati(int n, int w, const double *A, const double *S, const double *Q, const double *X, double *restrict rate, double *restrict half) {
  double P[n * w];
  multiply_onto(n, w, A, S, X, half);
  multiply_onto(n, w, Q, X, half, P);
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) rate[i * w + j] = rate[j * w + i] = P[i * w + j] + P[j * w + i];
}

/* Phi exp(h M) to second order; no Phi: of 1. */
static void carry(int n, int w, double h, const double *M, const double *Phi, double *restrict next) {
  int z = n * w;
  double step[z], turn[z];
  for (int i = 0; i < z; i++) step[i] = h * M[i];
  multiply(n, w, step, step, turn);
  for (int i = 0; i < z; i++) turn[i] = step[i] + 0.5 * turn[i];
  for (int i = 0; i < n; i++) turn[i * w + i] += 1.0;
  if (Phi) multiply(n, w, Phi, turn, next);
  else memcpy(next, turn, sizeof turn);
}

/* X at the nodes K - 1 ... 1 and, as `end`, at 0; X at the nodes 0 ... p - 1 continues it behind T. K is even. weights: p of Adams'
 * explicit method, then p of his implicit one. transition[k]: Phi(T, t_k), k < p, of the loop A - S X, by the midpoint's rule over pairs of
 * steps, and half a pair for odd k. */
static void sweep(int n, int w, long K, int p, double h, const double *weights, const double *A, long a, const double *S, long s, const double *Q,
           long q, double *X, double *end, double *transition) {
  int z = n * w;
  const double *explicit = weights, *implicit = weights + p, *Phi = 0;
  double rates[MOST * z], half[z], x[z], y[z], known[z], pair[2][z];
  memset(rates, 0, sizeof rates);
  for (long k = p - 1; k >= 0; k--) riccati(n, w, A + k * a, S + k * s, Q + k * q, X + k * z, rates + (K + k) % p * z, half);
  memcpy(x, X, sizeof x);
  for (long k = K - 1; k >= 0; k--) {
    const double *A_k = A + k * a, *S_k = S + k * s, *Q_k = Q + k * q, *F[MOST];
    double *rate = rates + k % p * z;
    for (int j = 0; j < p; j++) F[j] = rates + (k + 1 + j) % p * z;
    for (int i = 0; i < z; i += 4) {
      v4 u = explicit[p - 1] * *(const v4 *)(F[p - 1] + i), v = splat(0.0), start = *(const v4 *)(x + i);
      for (int j = 0; j < p - 1; j++) {
        v4 f = *(const v4 *)(F[j] + i);
        u += explicit[j] * f;
        v += implicit[j + 1] * f;
      }
      *(v4 *)(y + i) = start + h * u;
      *(v4 *)(known + i) = start + h * v;
    }
    riccati(n, w, A_k, S_k, Q_k, y, rate, half);
    for (int i = 0; i < z; i++) x[i] = known[i] + h * implicit[0] * rate[i];
    riccati(n, w, A_k, S_k, Q_k, x, rate, half);
    memcpy(k ? X + k * z : end, x, sizeof x);
    if (k % 2) {
      double *next = pair[k / 2 % 2];
      for (int i = 0; i < z; i++) half[i] = 2 * half[i] - A_k[i];
      if (k < p) carry(n, w, h, half, Phi, transition + k * z);
      carry(n, w, 2 * h, half, Phi, next);
      if (k <= p) memcpy(transition + (k - 1) * z, next, sizeof half);
      Phi = next;
    }
  }
}

/* A' B, n x n in rows of w. */
static void multiply_left(int n, int w, const double *A, const double *B, double *restrict C) {
  double turned[n * w];
  memset(turned, 0, sizeof turned);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) turned[j * w + i] = A[i * w + j];
  multiply(n, w, turned, B, C);
}

/* The largest size; NaN where one is not finite. */
static double largest(int z, const double *A) {
  double size = 0.0, broken = 0.0;
  for (int i = 0; i < z; i++) {
    size = fmax(size, fabs(A[i]));
    broken += A[i] - A[i];
  }
  return size + broken;
}

/* E = Phi' E Phi + gap by doubling, to about what Phi is known; gap is lost. False where the loop does not forget. */
static int close_period(int n, int w, double *gap, const double *Phi, double *E) {
  int z = n * w;
  double power[z], product[z], more[z];
  memcpy(power, Phi, sizeof power);
  memcpy(E, gap, sizeof power);
  for (int k = 0; k < 40; k++) {
    multiply(n, w, E, power, product);
    multiply_left(n, w, power, product, more);
    for (int i = 0; i < z; i++) E[i] += more[i];
    double size = largest(z, E);
    if (!isfinite(size)) return 0;
    if (largest(z, more) <= CLOSED * size) return 1;
    multiply(n, w, power, power, product);
    memcpy(power, product, sizeof power);
  }
  return 0;
}

/* Sweep from X at the first p nodes, and close the period by Newton's method, until X(T) changes by less than `near` of X: the sweeps it took,
 * 0 where it does not settle. A loop that does not forget is swept on. */
int close_by_newton(int n, int w, long K, int p, double h, const double *weights, const double *A, long a, const double *S, long s,
                    const double *Q, long q, double *X, double near) {
  int z = n * w;
  double end[z], gap[z], E[z], product[z], transition[MOST * z];
  for (int k = 1; k <= SWEEPS; k++) {
    sweep(n, w, K, p, h, weights, A, a, S, s, Q, q, X, end, transition);
    for (int i = 0; i < z; i++) gap[i] = end[i] - X[i];
    memcpy(X, end, sizeof end);
    if (!isfinite(largest(z, gap))) return 0;
    if (!close_period(n, w, gap, transition, E)) continue;
    for (int j = 0; j < p; j++) {
      multiply(n, w, E, transition + j * z, product);
      multiply_left(n, w, transition + j * z, product, gap);
      for (int i = 0; i < z; i++) X[j * z + i] += gap[i];
    }
    if (largest(z, E) <= near * largest(z, X)) return k;
  }
  return 0;
}

/* L^-1 of C = L L', in place of C; false where C is not positive. */
static int invert_root(int n, int w, double *C) {
  for (int j = 0; j < n; j++) {
    double size = C[j * w + j], pivot = size;
    for (int k = 0; k < j; k++) pivot -= C[j * w + k] * C[j * w + k];
    if (!(pivot > LEAST * size)) return 0;
    C[j * w + j] = sqrt(pivot);
    for (int i = j + 1; i < n; i++) {
      double sum = C[i * w + j];
      for (int k = 0; k < j; k++) sum -= C[i * w + k] * C[j * w + k];
      C[i * w + j] = sum / C[j * w + j];
    }
  }
  for (int j = 0; j < n; j++) {
    C[j * w + j] = 1.0 / C[j * w + j];
    for (int i = j + 1; i < n; i++) {
      double sum = 0.0;
      for (int k = j; k < i; k++) sum -= C[i * w + k] * C[k * w + j];
      C[i * w + j] = sum / C[i * w + i];
    }
    for (int i = 0; i < j; i++) C[i * w + j] = 0.0;
  }
  return 1;
}

/* |L F L'| in Frobenius' norm; F symmetric, L a lower triangle. */
static double measure(int n, int w, const double *L, const double *F) {
  double P[n * w], total = 0.0;
  multiply(n, w, L, F, P);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double sum = 0.0;
      for (int k = 0; k <= j; k++) sum += P[i * w + k] * L[j * w + k];
      total += sum * sum;
    }
  return sqrt(total);
}

/* The least r with -r C <= F <= r C at all K times, C = Q + X S X, F the residual with what rounding may make of it; infinity: none.
 * slopes: X'; unit: rounding of a sum relative to the sum of its sizes. residual: the largest entry of F. */
double find_share(int n, int w, long K, const double *A, long a, const double *S, long s, const double *Q, long q, const double *X,
                  const double *slopes, double unit, double *residual) {
  int z = n * w;
  double seen = 0.0, hidden = 0.0, C[z], F[z], P[z], XA[z], XSX[z], size_X[z], size[z];
  *residual = 0.0;
  for (long k = 0; k < K; k++) {
    const double *A_k = A + k * a, *S_k = S + k * s, *Q_k = Q + k * q, *x = X + k * z, *slope = slopes + k * z;
    multiply(n, w, x, A_k, XA);
    multiply(n, w, S_k, x, P);
    multiply(n, w, x, P, XSX);
    memset(F, 0, sizeof F);
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) {
        int ij = i * w + j;
        double q_ij = 2 * Q_k[ij], curved = -2 * XSX[ij];
        C[ij] = q_ij + curved;
        F[ij] = slope[ij] + XA[ij] + XA[j * w + i] - curved + q_ij;
      }
    *residual = fmax(*residual, largest(z, F));
    if (!invert_root(n, w, C)) return INFINITY;
    double share = measure(n, w, C, F);
    if (!isfinite(share)) return INFINITY;
    seen = fmax(seen, share);
    if (k % SOME) continue;
    for (int i = 0; i < z; i++) size_X[i] = fabs(x[i]), size[i] = fabs(A_k[i]);
    multiply(n, w, size_X, size, XA);
    for (int i = 0; i < z; i++) size[i] = fabs(S_k[i]);
    multiply(n, w, size, size_X, P);
    multiply(n, w, size_X, P, XSX);
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) {
        int ij = i * w + j;
        F[ij] = unit * (fabs(slope[ij]) + XA[ij] + XA[j * w + i] + 2 * XSX[ij] + 2 * fabs(Q_k[ij]));
        C[ij] = fabs(C[ij]);
      }
    hidden = fmax(hidden, measure(n, w, C, F));
  }
  return isfinite(hidden) ? seen + hidden : INFINITY;
}
