/* The Riccati equation -X' = A' X + X A - X S X + Q swept backwards by Adams' methods over four equal parts of a period at once, one in
 * each number of a vector, and closed by Newton's method: the calls of
 * backward.py.
 *
 * A matrix is n x n vectors, a symmetric one its lower triangle, row by row. Of S, which is given times -1/2, rows and columns from `first`
 * to `last` stand alone: the others are zero. Samples at the nodes of a part stand one after the other, `step` vectors apart: 0 for a
 * constant. Part l begins at l T / 4; node j of it stands there plus j h.
 */
#include <math.h>
#include <string.h>

#define MOST 12     /* the highest order */
#define SWEEPS 40
#define FAINT 1e-10  /* changes of X below that do not shrink to RESTING of themselves are rounding */
#define RESTING 0.3
#define CLOSED 1e-4 /* what is left of a loop that has forgotten */
#define PARTS 4
#define KNOWN 1e-3  /* a change of X after which the transition matrices are known well enough */

#define INLINE static inline __attribute__((always_inline))

typedef double v4 __attribute__((vector_size(32), aligned(8)));
typedef struct { const v4 *at; long step; } Samples;
typedef struct { long n, first, last, nodes; Samples A, S, Q; } Equation;

static inline v4 splat(double x) { return (v4){x, x, x, x}; }

static inline long triangle(long n) { return n * (n + 1) / 2; }

/* What the parts that lie so many further on hold. */
INLINE v4 turn(v4 x, int by) {
  return by == 1 ? (v4){x[1], x[2], x[3], x[0]} : by == 2 ? (v4){x[2], x[3], x[0], x[1]} : x;
}

/* C = C0 + A B for a few rows and columns: rows of A `a` vectors apart, those of B, C0 and C n. */
INLINE void multiply_block(int rows, int columns, int inner, int a, int n, const v4 *C0, const v4 *A, const v4 *B, v4 *restrict C) {
  v4 sum[2][4];
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < columns; j++) sum[i][j] = C0 ? C0[i * n + j] : splat(0.0);
  for (int k = 0; k < inner; k++)
    for (int i = 0; i < rows; i++)
      for (int j = 0; j < columns; j++) sum[i][j] += A[i * a + k] * B[k * n + j];
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < columns; j++) C[i * n + j] = sum[i][j];
}

/* C = C0 + A B for A of rows x inner, C apart from the others. No C0: 0. */
static void multiply_onto(int rows, int inner, int n, const v4 *C0, const v4 *A, const v4 *B, v4 *restrict C) {
  for (int i = 0; i < rows; i += 2) {
    const v4 *from = A + i * inner;
    for (int j = 0; j < n;) {
      const v4 *c = C0 ? C0 + i * n + j : 0;
      v4 *to = C + i * n + j;
#define BLOCK(columns) (i + 1 < rows ? multiply_block(2, columns, inner, inner, n, c, from, B + j, to) \
                                     : multiply_block(1, columns, inner, inner, n, c, from, B + j, to))
      if (j + 4 <= n) BLOCK(4), j += 4;
      else if (j + 2 <= n) BLOCK(2), j += 2;
      else BLOCK(1), j += 1;
    }
  }
}

static void multiply(int n, const v4 *A, const v4 *B, v4 *restrict C) { multiply_onto(n, n, n, 0, A, B, C); }

/* A' B. */
static void multiply_turned(int n, const v4 *A, const v4 *B, v4 *restrict C) {
  v4 turned[n * n];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) turned[j * n + i] = A[i * n + j];
  multiply(n, turned, B, C);
}

static void unfold(int n, const v4 *X, v4 *restrict full) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) full[i * n + j] = full[j * n + i] = *X++;
}

/* M + M', with what stands there already. */
static void add_symmetric(int n, const v4 *M, v4 *restrict sum) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) *sum++ += M[i * n + j] + M[j * n + i];
}

/* A + S X, S of the states that are acted on. */
static void add_inputs(const Equation *is, const v4 *A, const v4 *S, const v4 *X, v4 *restrict M) {
  int n = is->n, first = is->first * n, some = is->last - is->first;
  memcpy(M, A, n * n * sizeof(v4));
  multiply_onto(some, some, n, A + first, S, X + first, M + first);
}

/* rate = -X' at node j; half = A - S X / 2. */
static void riccati(const Equation *is, long j, const v4 *X, v4 *restrict rate, v4 *restrict half) {
  int n = is->n;
  v4 full[n * n], product[n * n];
  unfold(n, X, full);
  add_inputs(is, is->A.at + j * is->A.step, is->S.at + j * is->S.step, full, half);
  multiply(n, full, half, product);
  memcpy(rate, is->Q.at + j * is->Q.step, triangle(n) * sizeof(v4));
  add_symmetric(n, product, rate);
}

/* Phi exp(h M) to fourth order; no Phi: of 1. */
static void carry(int n, double h, const v4 *M, const v4 *Phi, v4 *restrict next) {
  int z = n * n;
  v4 step[z], square[z], higher[z], grown[z];
  for (int i = 0; i < z; i++) step[i] = h * M[i];
  multiply_onto(n, n, n, 0, step, step, square);
  for (int i = 0; i < z; i++) higher[i] = step[i] * (1.0 / 6.0) + square[i] * (1.0 / 24.0), step[i] += 0.5 * square[i];
  multiply_onto(n, n, n, step, square, higher, grown);
  for (int i = 0; i < n; i++) grown[i * n + i] += 1.0;
  if (Phi) multiply_onto(n, n, n, 0, Phi, grown, next);
  else memcpy(next, grown, sizeof grown);
}

/* Adams' explicit sum, and of his implicit one what is known, of the rates F, for `many` numbers at once. */
INLINE void add_rates(int many, int p, double h, const double *weights, const v4 *const *F, long e, const v4 *x, v4 *y, v4 *known) {
  v4 u[4], v[4];
  for (int i = 0; i < many; i++) u[i] = weights[p - 1] * F[p - 1][e + i], v[i] = splat(0.0);
  for (int j = 0; j < p - 1; j++)
    for (int i = 0; i < many; i++) {
      v4 f = F[j][e + i];
      u[i] += weights[j] * f;
      v[i] += weights[p + j + 1] * f;
    }
  for (int i = 0; i < many; i++) y[e + i] = x[e + i] + h * u[i], known[e + i] = x[e + i] + h * v[i];
}

/* X at all `nodes` nodes of each part, every `step`-th that is sampled, from X at the first p of the part behind it; start: where each
 * begins. weights: p of Adams' explicit method, then p of his implicit one. transition[j], where asked for: Phi from node j to the part's
 * end, j < p, of the loop A - S X, by the midpoint's rule over pairs of steps, and the trapezium's over half a
 * pair for odd j. */
static void sweep(const Equation *is, long nodes, long step, int p, double h, const double *weights, v4 *X, v4 *start, v4 *transition) {
  int n = is->n, z = n * n, E = triangle(n);
  v4 rates[p * E], half[z], x[E], y[E], known[E], apart[z], product[z], behind[z], pair[2][z], *Phi = 0;
  for (long i = p - 1; i >= 0; i--) {
    riccati(is, i * step, X + i * E, y, half);
    for (int e = 0; e < E; e++) rates[(nodes + i) % p * E + e] = turn(y[e], 1);
  }
  for (int e = 0; e < E; e++) x[e] = start[e] = turn(X[e], 1);
  for (long j = nodes - 1; j >= 0; j--) {
    const v4 *A = is->A.at + j * step * is->A.step, *F[MOST];
    v4 *rate = rates + j % p * E;
    for (int i = 0; i < p; i++) F[i] = rates + (j + 1 + i) % p * E;
    int e = 0;
    for (; e + 4 <= E; e += 4) add_rates(4, p, h, weights, F, e, x, y, known);
    for (; e < E; e++) add_rates(1, p, h, weights, F, e, x, y, known);
    riccati(is, j * step, y, rate, half);
    for (e = 0; e < E; e++) {
      x[e] = known[e] + h * weights[p] * rate[e];
      y[e] = x[e] - y[e];
    }
    for (int i = 0; i < z; i++) half[i] = 2 * half[i] - A[i];
    unfold(n, y, apart);
    multiply(n, apart, half, product);
    add_symmetric(n, product, rate); /* what is of second order in the corrector's small step is left out */
    memcpy(X + j * E, x, sizeof x);
    if (transition && j % 2 == 0) memcpy(behind, half, sizeof half);
    if (!transition || (j % 2 == 0 && j + 1 < nodes)) continue;
    v4 *next = pair[j / 2 % 2];
    if (j < p) {
      for (int i = 0; i < z; i++) apart[i] = 0.5 * (half[i] + behind[i]);
      carry(n, h, apart, Phi, transition + j * z);
    }
    if (j % 2 == 0) carry(n, h, half, Phi, next); /* the last of an odd number of nodes */
    else {
      carry(n, 2 * h, half, Phi, next);
      if (j <= p) memcpy(transition + (j - 1) * z, next, sizeof half);
    }
    Phi = next;
  }
}

/* The largest size; no number where one is not finite. */
static double largest(int z, const v4 *A) {
  double size = 0.0, broken = 0.0;
  for (int i = 0; i < z; i++)
    for (int l = 0; l < 4; l++) {
      size = fmax(size, fabs(A[i][l]));
      broken += A[i][l] - A[i][l];
    }
  return size + broken;
}

/* What the ends of all parts must change by: E_l = gap_l + Phi' E Phi of the part behind, by doubling, to about what Phi is known. Phi is
 * lost. False where the loop does not forget. */
static int close_parts(int n, const v4 *gap, v4 *Phi, v4 *E) {
  int z = n * n;
  v4 behind[z], product[z], more[z];
  for (int i = 0; i < z; i++) Phi[i] = turn(Phi[i], 1);
  memcpy(E, gap, sizeof more);
  for (int k = 0; k < 42; k++) {
    int parts = k < 2 ? k + 1 : 0; /* from four on it is the part itself, whole periods later */
    for (int i = 0; i < z; i++) behind[i] = turn(E[i], parts);
    multiply(n, behind, Phi, product);
    multiply_turned(n, Phi, product, more);
    for (int i = 0; i < z; i++) E[i] += more[i];
    double size = largest(z, E);
    if (!isfinite(size)) return 0;
    if (k > 1 && largest(z, more) <= CLOSED * size) return 1;
    for (int i = 0; i < z; i++) behind[i] = turn(Phi[i], parts);
    multiply(n, behind, Phi, product);
    memcpy(Phi, product, sizeof product);
  }
  return 0;
}

/* The largest |E_ij| / sqrt(X_ii X_jj); X: its triangle. */
static double compare(int n, const v4 *E, const v4 *X) {
  double most = 0.0;
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++)
      for (int l = 0; l < 4; l++) {
        double size = fabs(X[triangle(i) + i][l] * X[triangle(j) + j][l]), square = E[i * n + j][l] * E[i * n + j][l];
        if (square > most * size) most = size > 0.0 ? square / size : INFINITY;
      }
  return sqrt(most);
}

/* Sweep from X at the first p nodes of each part, and join the parts by Newton's method, until their ends change by less than `near` of X,
 * or no less than before: the sweeps it took, 0 where it does not settle. Parts that do not forget are swept on, and all for some sweeps
 * `before`: each adds a part to the horizon whose cost X is. */
static int close_by_newton(const Equation *is, long nodes, long step, int p, double h, const double *weights, v4 *X, int before,
                           double near) {
  int n = is->n, z = n * n, E = triangle(n);
  v4 start[E], gap[z], change[z], Phi[z], product[z], more[z], ends[E], transition[p * z];
  double last = INFINITY;
  for (int k = 1; k <= SWEEPS; k++) {
    sweep(is, nodes, step, p, h, weights, X, start, k >= before && last > KNOWN ? transition : 0);
    for (int e = 0; e < E; e++) ends[e] = turn(X[e], 1) - start[e];
    unfold(n, ends, gap);
    if (!isfinite(largest(z, gap))) return 0;
    if (k < before) continue;
    memcpy(Phi, transition, sizeof Phi);
    if (!close_parts(n, gap, Phi, change)) {
      last = INFINITY;
      continue;
    }
    double moved = compare(n, change, start);
    for (int j = 0; j < p; j++) {
      multiply(n, change, transition + j * z, product);
      multiply_turned(n, transition + j * z, product, more);
      for (int i = 0, e = j * E; i < n; i++)
        for (int l = 0; l <= i; l++) X[e++] += 0.5 * (more[i * n + l] + more[l * n + i]);
    }
    if (moved <= near || (moved <= FAINT && moved > RESTING * last)) return k;
    last = moved;
  }
  return 0;
}

/* Values (p, E) at 0, 1, ... to those (many, E) at 0, 1 / parts, ... of the polynomial through them. */
static void place_first(int E, int p, int many, double parts, const v4 *values, v4 *X) {
  for (int i = 0; i < many; i++) {
    for (int e = 0; e < E; e++) X[i * E + e] = splat(0.0);
    for (int j = 0; j < p; j++) {
      double weight = 1.0;
      for (int k = 0; k < p; k++)
        if (k != j) weight *= (i / parts - k) / (j - k);
      for (int e = 0; e < E; e++) X[i * E + e] += weight * values[j * E + e];
    }
  }
}
