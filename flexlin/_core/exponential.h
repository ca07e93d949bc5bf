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

enum { OFF = S - H, MOST_SQUARINGS = 200 }; /* rows above W, which are those of [0 I] */
#define IS_FULL (STATES == ROWS)
/* Z = A B, added to what is there where `add`, for A (rows, inner) in a matrix with `stride` columns, B (inner, S). */
FORCED void multiply_rows(int rows, int inner, const vec *restrict A, int stride, const vec *restrict B, int add, vec *restrict Z) {
  for (int i = 0; i < rows; i++) {
    vec sum[S];
    for (int j = 0; j < S; j++) sum[j] = add ? Z[i * S + j] : splat(0.0);
    for (int k = 0; k < inner; k++)
      for (int j = 0; j < S; j++) sum[j] += A[i * stride + k] * B[k * S + j];
    for (int j = 0; j < S; j++) Z[i * S + j] = sum[j];
  }
}

static void multiply(const vec *restrict A, const vec *restrict B, vec *restrict Z) { multiply_rows(S, S, A, S, B, 0, Z); }

/* Z += V P, lower rows. */
static void add_product(const vec *V, const vec *P, vec *Z) { multiply_rows(H, S, V, S, P, 1, Z); }

/* V B; for V = [v1 v2] and B = [0 I; X Y] it is [v2 X, v1 + v2 Y]. */
static void raise(const vec *restrict V, const vec *restrict W, vec *restrict below) {
  for (int i = 0; i < H; i++)
    for (int j = 0; j < S; j++) below[i * S + j] = j < H ? splat(0.0) : V[i * S + j - H];
  multiply_rows(H, H, V + OFF, S, W, 1, below);
}

/* The lower rows of P from its upper ones, where it has any. */
static void complete(vec *P, const vec *W) {
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

/* V of q0 + q1 A + q2 A^2 + q3 A^3. */
static void combine(const double *q, double c, const Powers *p, vec *restrict V) {
  const double a = c * q[1], b = c * c * q[2], e = c * c * c * q[3];
  for (int i = 0; i < H * S; i++) V[i] = b * p->square[i] + e * p->cube[i];
  if (IS_FULL)
    for (int i = 0; i < H * S; i++) V[i] += a * p->W[i];
  else
    for (int i = 0; i < H; i++) V[i * S + OFF + i] += a;
}

/* P from the powers of B by Taylor's polynomial of order 12 of exp(A). Source: Bader, Blanes, Casas, Mathematics 7 (2019) 1174, Eq. (13). */
static void expand(const Powers *p, double c, vec *P) {
  static const double q[4][4] = {
    {-0.01860232051462055322, -0.00500702322573317730, -0.57342012296052226390, -0.13339969394389205970},
    {4.60000000000000000000, 0.99287510353848683614, -0.13244556105279963884, 0.00172990000000000000},
    {0.21169311829980944294, 0.15822438471572672537, 0.16563516943672741501, 0.01078627793157924250},
    {0.0, -0.13181061013830184015, -0.02027855540589259079, -0.00675951846863086359}};
  vec Q[S * S], *A6 = Q, V[H * S];
  combine(q[3], c, p, P); /* A6 = q3^2 + q2 */
  complete(P, p->W);
  combine(q[2], c, p, A6);
  add_product(P, P, A6);
  complete(A6, p->W);
  combine(q[1], c, p, V); /* exp A = (q1 + A6) A6 + q0 */
  combine(q[0], c, p, P);
  const double left = q[1][0] + q[2][0], right = q[2][0];
  for (int i = 0; i < H * S; i++) {
    P[i] += (left + right) * A6[i] + right * V[i];
    V[i] += A6[i];
  }
  add_product(V, A6, P);
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

/* P = exp(c B) - I by the polynomial, then squared.
 *
 * reach: the largest |A^2|^(1/2) that the polynomial takes as it is: the first term left out is A times a power of A^2. */
static void exponentiate(const vec *W, double c, double reach, vec *P) {
  Powers p;
  vec other[S * S], *now, *next;
  int squarings = 0;
  find_powers(W, &p);
  for (double size = c * sqrt(norm_of_square(&p)); size > reach && squarings < MOST_SQUARINGS; size *= 0.5) squarings++;
  now = squarings % 2 ? other : P; /* so that the last square stands in P */
  next = squarings % 2 ? P : other;
  expand(&p, ldexp(c, -squarings), now);
  complete(now, W);
  for (; squarings > 0; squarings--) {
    vec *squared = next;
    for (int i = 0; i < H * S; i++) squared[i] = 2.0 * now[i];
    add_product(now, now, squared);
    complete(squared, W);
    next = now;
    now = squared;
  }
}

#endif
