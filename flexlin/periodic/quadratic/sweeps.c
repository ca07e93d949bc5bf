/* Matrices at four times at once, one in each number of a vector, for the Riccati equation -X' = A' X + X A - X S X + Q over four equal
 * parts of a period: what the calls of backward.py share.
 *
 * A matrix is n x n vectors, a symmetric one its lower triangle, row by row. Of S, which is given times -1/2, rows and columns from `first`
 * to `last` stand alone: the others are zero. Samples at the nodes of a part stand one after the other, `step` vectors apart: 0 for a
 * constant. Part l begins at l T / 4; node j of it stands there plus j h.
 */
#include <math.h>
#include <string.h>

#define CLOSED 1e-4 /* what is left of a loop that has forgotten */
#define PARTS 4

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

