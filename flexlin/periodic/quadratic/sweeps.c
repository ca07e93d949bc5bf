/* The Riccati equation -X' = A' X + X A - X S X + Q swept backwards over a period by Adams' methods: the calls of backward.py.
 *
 * A matrix is n rows of w numbers, w a multiple of four, zeros behind column n. Samples at K nodes stand one after the other, `step`
 * numbers apart: 0 for a constant; S is given times -1/2, and of Q its half. Node k stands at k h; node K is node 0 of the next period.
 */
#include <math.h>
#include <string.h>

#define MOST 12     /* the highest order */
#define SWEEPS 30
#define FAINT 1e-10  /* changes of X below that do not shrink to RESTING of themselves are rounding */
#define RESTING 0.3
#define CLOSED 1e-4 /* what is left of a loop that has forgotten */

#define INLINE static inline __attribute__((always_inline))

typedef double v4 __attribute__((vector_size(32), aligned(8)));
typedef struct { const double *at; long step; } Samples;

static inline v4 splat(double x) { return (v4){x, x, x, x}; }

static inline v4 at(const double *x) { return *(const v4 *)x; }

static inline void put(double *to, v4 x) { *(v4 *)to = x; }

/* C = C0 + A B, C apart from A and B: two rows and eight columns at a time. No C0: 0. */
INLINE void multiply_eight(int n, int w, const double *restrict C0, const double *restrict A,
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

/* The same for rows of twelve, three at a time; the last ones are done twice where n is no multiple. */
INLINE void multiply_twelve(int n, const double *restrict C0, const double *restrict A,
                                                                  const double *restrict B, double *restrict C) {
  const int w = 12;
  for (int first = 0; first < n; first += 3) {
    int i = first + 3 <= n ? first : n - 3;
    const double *a = A + i * w, *c = C0 ? C0 + i * w : A;
    double *to = C + i * w;
    v4 r0 = splat(0.0), r1 = r0, r2 = r0, s0 = r0, s1 = r0, s2 = r0, t0 = r0, t1 = r0, t2 = r0;
    if (C0) {
      r0 = at(c + 0); r1 = at(c + 4); r2 = at(c + 8);
      s0 = at(c + 12); s1 = at(c + 16); s2 = at(c + 20);
      t0 = at(c + 24); t1 = at(c + 28); t2 = at(c + 32);
    }
    for (int k = 0; k < n; k++) {
      const double *row = B + k * w;
      v4 u0 = at(row), u1 = at(row + 4), u2 = at(row + 8), x = splat(a[k]), y = splat(a[w + k]), z = splat(a[2 * w + k]);
      r0 += x * u0; r1 += x * u1; r2 += x * u2;
      s0 += y * u0; s1 += y * u1; s2 += y * u2;
      t0 += z * u0; t1 += z * u1; t2 += z * u2;
    }
    put(to + 0, r0); put(to + 4, r1); put(to + 8, r2);
    put(to + 12, s0); put(to + 16, s1); put(to + 20, s2);
    put(to + 24, t0); put(to + 28, t1); put(to + 32, t2);
  }
}

INLINE void multiply_onto(int n, int w, const double *restrict C0, const double *restrict A,
                                                                const double *restrict B, double *restrict C) {
  if (w == 12) multiply_twelve(n, C0, A, B, C);
  else multiply_eight(n, w, C0, A, B, C);
}

INLINE void multiply(int n, int w, const double *A, const double *B, double *restrict C) { multiply_onto(n, w, 0, A, B, C); }

/* rate = -X'; half = A - S X / 2. S: times -1/2; Q: its half. */
INLINE void riccati(int n, int w, const double *A, const double *S, const double *Q, const double *X, double *restrict rate, double *restrict half) {
  double P[n * w];
  multiply_onto(n, w, A, S, X, half);
  multiply_onto(n, w, Q, X, half, P);
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) rate[i * w + j] = rate[j * w + i] = P[i * w + j] + P[j * w + i];
}

/* rate at y + d of the rate at y, loop A - S y; what is of second order in the corrector's small d is left out. */
INLINE void correct_rate(int n, int w, const double *loop, const double *d, double *restrict rate) {
  double P[n * w];
  multiply(n, w, d, loop, P);
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) rate[i * w + j] = rate[j * w + i] = rate[i * w + j] + P[i * w + j] + P[j * w + i];
}

/* Phi exp(h M) to second order; no Phi: of 1. */
INLINE void carry(int n, int w, double h, const double *M, const double *Phi, double *restrict next) {
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
INLINE void sweep(int n, int w, long K, int p, double h, const double *weights, const double *A, long a, const double *S, long s, const double *Q,
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
    for (int i = 0; i < z; i++) {
      x[i] = known[i] + h * implicit[0] * rate[i];
      y[i] = x[i] - y[i];
      half[i] = 2 * half[i] - A_k[i];
    }
    correct_rate(n, w, half, y, rate);
    memcpy(k ? X + k * z : end, x, sizeof x);
    if (k % 2) {
      double *next = pair[k / 2 % 2];
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

/* The largest |E_ij| / sqrt(X_ii X_jj). */
static double compare(int n, int w, const double *E, const double *X) {
  double most = 0.0;
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      double size = fabs(X[i * w + i] * X[j * w + j]), square = E[i * w + j] * E[i * w + j];
      if (square > most * size) most = size > 0.0 ? square / size : INFINITY;
    }
  return sqrt(most);
}

/* Sweep from X at the first p nodes, and close the period by Newton's method, until X(T) changes by less than `near` of X, or no
 * less than before: the sweeps it took, 0 where it does not settle. A loop that does not forget is swept on. */
INLINE int close_by_newton(int n, int w, long K, int p, double h, const double *weights, const double *A,
                                                                 long a, const double *S, long s, const double *Q, long q, double *X,
                                                                 double near) {
  int z = n * w;
  double end[z], gap[z], E[z], product[z], transition[MOST * z], last = INFINITY;
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
    double moved = compare(n, w, E, X);
    if (moved <= near || (moved <= FAINT && moved > RESTING * last)) return k;
    last = moved;
  }
  return 0;
}

/* A copy of the code for each usual width: the compiler then knows how many numbers there are in a row. */
static int close_on_nodes(int n, int w, long K, int p, double h, const double *weights, const double *A, long a, const double *S, long s,
                          const double *Q, long q, double *X, double near) {
#define CLOSE(w) close_by_newton(n, w, K, p, h, weights, A, a, S, s, Q, q, X, near)
  return w == 8 ? CLOSE(8) : w == 12 ? CLOSE(12) : CLOSE(w);
}

/* Values (p, z) at 0, 1, ... to those (many, z) at 0, 1 / parts, ... of the polynomial through them. */
static void place_first(int z, int p, int many, double parts, const double *values, double *X) {
  for (int i = 0; i < many; i++) {
    for (int e = 0; e < z; e++) X[i * z + e] = 0.0;
    for (int j = 0; j < p; j++) {
      double weight = 1.0;
      for (int k = 0; k < p; k++)
        if (k != j) weight *= (i / parts - k) / (j - k);
      for (int e = 0; e < z; e++) X[i * z + e] += weight * values[j * z + e];
    }
  }
}

/* The periodic solution on K nodes by sweeps on ever more of them: steps, orders, ends: of each level every so many nodes, the order of
 * Adams' method, and the change of X(T) that is small enough; weights: one level after the other. X at the first nodes, as many as the
 * first order, to start from, in room for all; packed: (n (n + 1) / 2, K), the lower triangle row by row. A level that does not close
 * is left out. Returns how often a period was swept, 0 where the last level does not close. */
int sweep_until_closed(int n, int w, long K, double T, int levels, const int *steps, const int *orders, const double *ends,
                       const double *weights, const double *A, long a, const double *S, long s, const double *Q, long q, double *X,
                       double *packed) {
  int z = n * w, last = 0, total = 0, found = 0;
  double begin[MOST * z];
  memcpy(begin, X, orders[0] * z * sizeof(double));
  for (int i = 0; i < levels; weights += 2 * orders[i++]) {
    int step = steps[i], p = orders[i], from = last ? orders[last - 1] : orders[0], before = last ? steps[last - 1] : step;
    place_first(z, from, p, (double)before / step, begin, X);
    found = close_on_nodes(n, w, K / step, p, T * step / K, weights, A, a * step, S, s * step, Q, q * step, X, ends[i]);
    total += found;
    if (!found) continue;
    memcpy(begin, X, p * z * sizeof(double));
    last = i + 1;
  }
  if (!found) return 0;
  for (long k = 0; k < K; k++)
    for (int i = 0, e = 0; i < n; i++)
      for (int j = 0; j <= i; j++) packed[K * e++ + k] = X[k * z + i * w + j];
  return total;
}
