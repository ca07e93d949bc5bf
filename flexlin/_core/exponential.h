/* exp(A) of A = c B, L at a time, for B = [0 I; W] with W (H, S), or a full matrix B = W where H = S.
 *
 * Where B = [0 I; W], the upper half of B^k is the lower half of B^(k-1). So a polynomial p(B) = p0 + B q(B) is known by p0 and V, the lower half
 * of q(B), and what belongs to a product r = p q follows:
 *     p(B) = p0 I + P,   P = [V; V B],   V_r = p0 V_q + q0 V_p + V_p P_q.
 * A power of B costs a quarter of a product of full matrices, a product of polynomials three quarters, a sum one half. A full matrix has V = P.
 */
#ifndef FLEXLIN_EXPONENTIAL_H
#define FLEXLIN_EXPONENTIAL_H

#include "vectors.h"


enum { OFF = S - H }; /* rows above W, which are those of [0 I] */
#define IS_FULL (STATES == ROWS)
#define WRITTEN_OUT (STATES * ROWS <= 18 && REGISTERS == 32) /* all loops of an exponential are written out: what callers keep in arrays stays in registers */
#if WRITTEN_OUT
#define SHORT FORCED
#else
#define SHORT static
#endif
enum { DOWN = REGISTERS == 16 ? 2 : H % 3 ? 4 : 3, ACROSS = REGISTERS == 16 ? 2 : S % 6 ? 4 : 6 }; /* a block of a product that stays in registers */

/* A block of Z = A B of `rows` rows and `columns` columns. */
FORCED void multiply_block_of(int rows, int columns, int inner, const vec *restrict A, int stride, const vec *restrict B, int add, vec *restrict Z) {
  vec sum[DOWN][ACROSS];
  UNROLL for (int r = 0; r < rows; r++)
    UNROLL for (int c = 0; c < columns; c++) sum[r][c] = add ? Z[r * S + c] : splat(0.0);
#pragma GCC unroll 1
  for (int k = 0; k < inner; k++) {
    vec row[ACROSS];
    UNROLL for (int c = 0; c < columns; c++) { row[c] = B[k * S + c]; HOLD(row[c]); }
    UNROLL for (int r = 0; r < rows; r++) {
      vec a = A[r * stride + k];
      HOLD(a);
      UNROLL for (int c = 0; c < columns; c++) sum[r][c] += a * row[c];
    }
  }
  UNROLL for (int r = 0; r < rows; r++)
    UNROLL for (int c = 0; c < columns; c++) Z[r * S + c] = sum[r][c];
}

/* Z = A B, added to what is there where `add`, for A (rows, inner) in a matrix with `stride` columns, B (inner, S). */
FORCED void multiply_rows(int rows, int inner, const vec *restrict A, int stride, const vec *restrict B, int add, vec *restrict Z) {
#if WRITTEN_OUT
  UNROLL for (int i = 0; i < rows; i++)
    UNROLL for (int j = 0; j < S; j++) {
      vec sum = add ? Z[i * S + j] + A[i * stride] * B[j] : A[i * stride] * B[j];
      UNROLL for (int k = 1; k < inner; k++) sum += A[i * stride + k] * B[k * S + j];
      Z[i * S + j] = sum;
    }
#else
  const int last = rows % DOWN, rest = S % ACROSS;
  for (int i = 0; i + DOWN <= rows; i += DOWN) {
    for (int j = 0; j + ACROSS <= S; j += ACROSS) multiply_block_of(DOWN, ACROSS, inner, A + i * stride, stride, B + j, add, Z + i * S + j);
    if (rest) multiply_block_of(DOWN, rest, inner, A + i * stride, stride, B + S - rest, add, Z + (i + 1) * S - rest);
  }
  if (!last) return;
  A += (rows - last) * stride;
  Z += (rows - last) * S;
  for (int j = 0; j + ACROSS <= S; j += ACROSS) multiply_block_of(last, ACROSS, inner, A, stride, B + j, add, Z + j);
  if (rest) multiply_block_of(last, rest, inner, A, stride, B + S - rest, add, Z + S - rest);
#endif
}

static void multiply(const vec *restrict A, const vec *restrict B, vec *restrict Z) {
#if STATES <= 6 && REGISTERS == 32 /* a panel of B stays in registers while the rows of A pass */
  enum { PANEL = S == 6 ? 3 : S };
  for (int j = 0; j < S; j += PANEL) {
    vec panel[S][PANEL];
    UNROLL for (int k = 0; k < S; k++)
      UNROLL for (int c = 0; c < PANEL; c++) { panel[k][c] = B[k * S + j + c]; HOLD(panel[k][c]); }
#pragma GCC unroll 1
    for (int i = 0; i < S; i++) {
      vec sum[PANEL];
      UNROLL for (int c = 0; c < PANEL; c++) sum[c] = A[i * S] * panel[0][c];
      for (int k = 1; k < S; k++)
        UNROLL for (int c = 0; c < PANEL; c++) sum[c] += A[i * S + k] * panel[k][c];
      UNROLL for (int c = 0; c < PANEL; c++) Z[i * S + j + c] = sum[c];
    }
  }
#else
  multiply_rows(S, S, A, S, B, 0, Z);
#endif
}

/* Z += V P, lower rows. */
SHORT void add_product(const vec *V, const vec *P, vec *Z) { multiply_rows(H, S, V, S, P, 1, Z); }

/* V B; for V = [v1 v2] and B = [0 I; X Y] it is [v2 X, v1 + v2 Y]. */
SHORT void raise(const vec *restrict V, const vec *restrict W, vec *restrict below) {
  for (int i = 0; i < H; i++)
    for (int j = 0; j < S; j++) below[i * S + j] = j < H ? splat(0.0) : V[i * S + j - H];
  multiply_rows(H, H, V + OFF, S, W, 1, below);
}

/* The lower rows of P from its upper ones. */
SHORT void complete(vec *P, const vec *W) {
#if IS_FULL
  (void)P, (void)W;
#else
  raise(P, W, P + OFF * S);
#endif
}

typedef struct { const vec *W, *square; vec squared[H * S], cube[S * S]; } Powers; /* V of B, B^2, B^3; that of [0 I; W] is [0 I], its square's W */

static void find_powers(const vec *W, Powers *p) {
  p->W = p->square = W;
  if (IS_FULL) {
    raise(W, W, p->squared);
    p->square = p->squared;
  }
  raise(p->square, W, p->cube);
}

/* V of q0 + q1 A + q2 A^2 + q3 A^3 + q6 A^6. */
SHORT void combine(const double *q, double c, const Powers *p, double q6, const vec *restrict A6, vec *restrict V) {
  const double a = c * q[1], b = c * c * q[2], e = c * c * c * q[3];
  if (A6)
    for (int i = 0; i < H * S; i++) V[i] = b * p->square[i] + e * p->cube[i] + q6 * A6[i];
  else
    for (int i = 0; i < H * S; i++) V[i] = b * p->square[i] + e * p->cube[i];
  if (IS_FULL)
    for (int i = 0; i < H * S; i++) V[i] += a * p->W[i];
  else
    for (int i = 0; i < H; i++) V[i * S + OFF + i] += a;
}

/* Taylor's polynomials of order 12 and 18 of exp(A), P from the powers of B. Source: Bader, Blanes, Casas, Mathematics 7 (2019) 1174,
 * Eqs (13), (14). */

static void taylor_12(const Powers *p, double c, vec *P) {
  static const double q[4][4] = {
    {-0.01860232051462055322, -0.00500702322573317730, -0.57342012296052226390, -0.13339969394389205970},
    {4.60000000000000000000, 0.99287510353848683614, -0.13244556105279963884, 0.00172990000000000000},
    {0.21169311829980944294, 0.15822438471572672537, 0.16563516943672741501, 0.01078627793157924250},
    {0.0, -0.13181061013830184015, -0.02027855540589259079, -0.00675951846863086359}};
  vec Q[S * S], *A6 = Q, V[H * S];
  combine(q[3], c, p, 0.0, NULL, P); /* A6 = q3^2 + q2 */
  complete(P, p->W);
  combine(q[2], c, p, 0.0, NULL, A6);
  add_product(P, P, A6);
  complete(A6, p->W);
  combine(q[1], c, p, 0.0, NULL, V); /* exp A = (q1 + A6) A6 + q0 */
  combine(q[0], c, p, 0.0, NULL, P);
  const double left = q[1][0] + q[2][0], right = q[2][0];
  for (int i = 0; i < H * S; i++) {
    P[i] += (left + right) * A6[i] + right * V[i];
    V[i] += A6[i];
  }
  add_product(V, A6, P);
}

static void taylor_18(Powers *p, double c, vec *P) {
  static const double b[5][5] = {
    {0.0, -1.00365581030144618291e-01, -8.02924648241156932449e-03, -8.92138498045729985177e-04, 0.0},
    {0.0, 3.97849749499645077844e-01, 1.36783778460411720168e+00, 4.98289622525382669416e-01, -6.37898194594723280150e-04},
    {-1.09676396052962061844e+01, 1.68015813878906206114e+00, 5.71779846478865511061e-02, -6.98210122488052056106e-03,
     3.34975017086070470649e-05},
    {-9.04316832390810593223e-02, -6.76404519071381882256e-02, 6.75961301770459654925e-02, 2.95552570429315521194e-02,
     -1.39180257516060693404e-05},
    {0.0, 0.0, -9.23364619367118555360e-02, -1.69364939002081722752e-02, -1.40086798182036094347e-05}};
  const double c6 = c * c * c * c * c * c, left = b[2][0] + b[3][0], right = b[3][0];
  vec A6[H * S], V[H * S], Q[S * S], *A9 = Q;
  complete(p->cube, p->W);
  for (int i = 0; i < H * S; i++) A6[i] = splat(0.0);
  add_product(p->cube, p->cube, A6); /* B^6 */
  combine(b[4], c, p, c6 * b[4][4], A6, P);
  complete(P, p->W);
  combine(b[3], c, p, c6 * b[3][4], A6, A9); /* A9 = b0 b4 + b3 */
  combine(b[0], c, p, 0.0, NULL, V);
  add_product(V, P, A9);
  complete(A9, p->W);
  combine(b[2], c, p, c6 * b[2][4], A6, V); /* exp A = (b2 + A9) A9 + b1 */
  combine(b[1], c, p, c6 * b[1][4], A6, P);
  for (int i = 0; i < H * S; i++) {
    P[i] += (left + right) * A9[i] + right * V[i];
    V[i] += A9[i];
  }
  add_product(V, A9, P);
}

/* The largest 1-norm of B^2 over the lanes that are within reason; a lane that is not is judged by its result. */
static double norm_of_square(const Powers *p) {
  vec worst = splat(0.0);
  for (int j = 0; j < S; j++) {
    vec sum = splat(0.0);
    for (int i = 0; i < H; i++) sum += IS_FULL ? v_abs(p->square[i * S + j]) : v_abs(p->square[i * S + j]) + v_abs(p->cube[i * S + j]);
    worst = v_max(worst, sum);
  }
  double largest = 0.0;
  for (int l = 0; l < L; l++) largest = worst[l] > largest && worst[l] < 1e30 ? worst[l] : largest;
  return largest;
}

/* The least s for which size / 2^s <= reach. */
static int count_squarings(double size, double reach) {
  int s = 0;
  for (; size > reach && s < 200; s++) size *= 0.5;
  return s;
}

/* p(B)^(2^times) - I from P = p(B) - I: in P where all loops are written out, else in P and `other` by turns. */
static void square_often(vec *P, vec *other, const vec *W, int times) {
#if WRITTEN_OUT
  (void)other;
  vec p[S * S], w[H * S], z[H * S];
  UNROLL for (int i = 0; i < S * S; i++) p[i] = P[i];
  UNROLL for (int i = 0; i < H * S; i++) w[i] = W[i];
#pragma GCC unroll 1
  for (; times > 0; times--) {
    UNROLL for (int i = 0; i < H * S; i++) z[i] = 2.0 * p[i];
    add_product(p, p, z);
    UNROLL for (int i = 0; i < H * S; i++) p[i] = z[i];
    complete(p, w);
  }
  UNROLL for (int i = 0; i < S * S; i++) P[i] = p[i];
#else
  for (; times > 0; times--) {
    vec *squared = other;
    for (int i = 0; i < H * S; i++) squared[i] = 2.0 * P[i];
    add_product(P, P, squared);
    complete(squared, W);
    other = P;
    P = squared;
  }
#endif
}

/* P = exp(c B) - I, by the one of the polynomials that costs least, then squared.
 *
 * reach: the largest |A^2|^(1/2) that each polynomial takes as it is: the first term left out is A times a power of A^2. Costs are counted in
 * products. */
static void exponentiate(const vec *W, double c, const double *reach, vec *P) {
  static const double cost[2] = {IS_FULL ? 4.0 : 16.0 + 22.0 / H, IS_FULL ? 5.0 : 22.0 + 38.0 / H}, squaring = IS_FULL ? 1.0 : 6.0 + 2.0 / H;
  Powers p;
  vec other[S * S];
  find_powers(W, &p);
  double size = c * sqrt(norm_of_square(&p)), scale = c;
  int few = count_squarings(size, reach[0]), fewer = count_squarings(size, reach[1]);
  int high = cost[1] + squaring * fewer < cost[0] + squaring * few, squarings = high ? fewer : few;
  for (int k = 0; k < squarings; k++) scale *= 0.5;
  vec *start = !WRITTEN_OUT && squarings % 2 ? other : P; /* so that the last square stands in P */
  if (high) taylor_18(&p, scale, start);
  else taylor_12(&p, scale, start);
  complete(start, W);
  square_often(start, start == P ? other : P, W, squarings);
}

#endif
