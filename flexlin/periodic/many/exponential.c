/* exp(A) of A = c [0 I; X Y], eight at a time.
 *
 * With B = A / c the upper half of B^k is the lower half of B^(k-1). So a polynomial p(B) = p0 + B q(B) is known by p0 and V, the lower half of
 * q(B), and what belongs to a product r = p q follows:
 *     p(B) = p0 I + P,   P = [V; V B],   V_r = p0 V_q + q0 V_p + V_p P_q.
 * A power of B costs a quarter of a product of full matrices, a product of polynomials three quarters, a sum one half. W = [X Y].
 */
enum { N = COORDINATES, STEPS = 40 };
static const double WORTH = 8.0, SPARED = 4.0, CONVERGED = 3e-13, SLOWEST = 0.1;
#ifndef UNROLLED
#define UNROLLED 6 /* states up to which all loops of an exponential are written out */
#endif
#if S <= UNROLLED
#define SHORT static inline __attribute__((always_inline))
#else
#define SHORT static
#endif
#define UNROLL _Pragma("GCC unroll 36")

/* Z = A B, added to what is there where `add`, for A (rows, inner) in a matrix with `stride` columns, B (inner, S). */
static inline __attribute__((always_inline)) void multiply_rows(int rows, int inner, const v8 *restrict A, int stride, const v8 *restrict B, int add, v8 *restrict Z) {
#if S <= UNROLLED /* what callers keep in arrays stays in registers */
  UNROLL for (int i = 0; i < rows; i++)
    UNROLL for (int j = 0; j < S; j++) {
      v8 sum = add ? Z[i * S + j] + A[i * stride] * B[j] : A[i * stride] * B[j];
      UNROLL for (int k = 1; k < inner; k++) sum += A[i * stride + k] * B[k * S + j];
      Z[i * S + j] = sum;
    }
#else /* a block of the result stays in registers */
  for (int i = 0; i < rows; i += ROWS)
    for (int j = 0; j < S; j += COLUMNS) {
      v8 sum[ROWS][COLUMNS];
      for (int r = 0; r < ROWS; r++)
        for (int c = 0; c < COLUMNS; c++) sum[r][c] = add ? Z[(i + r) * S + j + c] : splat(0.0);
#pragma GCC unroll 1
      for (int k = 0; k < inner; k++) {
        v8 row[COLUMNS];
        for (int c = 0; c < COLUMNS; c++) { row[c] = B[k * S + j + c]; HOLD(row[c]); }
        for (int r = 0; r < ROWS; r++) {
          v8 a = A[(i + r) * stride + k];
          HOLD(a);
          for (int c = 0; c < COLUMNS; c++) sum[r][c] += a * row[c];
        }
      }
      for (int r = 0; r < ROWS; r++)
        for (int c = 0; c < COLUMNS; c++) Z[(i + r) * S + j + c] = sum[r][c];
    }
#endif
}

typedef struct { /* the largest eigenvalue of B where it is real, its left and right vectors with left right = 1; whether it is worth its cost */
  v8 left[S], right[S], value, before[2][2][S];
  int wanted;
} Dominant;

#if S > UNROLLED
/* The largest eigenvalue from that of a matrix nearby, by steps of the power method; whether it was found in all lanes. */
static int follow(const v8 *W, Dominant *d) {
  v8 *u = d->left, *v = d->right, x[S], y[S], last = splat(INFINITY), last_v = last;
  for (int k = 0; k < 2; k++) /* both vectors as the parabola through the last three goes on */
    for (int i = 0; i < S; i++) {
      v8 *w = k ? v : u, now = w[i], before = d->before[k][0][i];
      w[i] = 3.0 * (now - before) + d->before[k][1][i];
      d->before[k][1][i] = before;
      d->before[k][0][i] = now;
    }
  for (int step = 0; step < STEPS; step++) {
    v8 uv = splat(0.0), xv = splat(0.0), off = splat(0.0), most = splat(0.0), off_v = splat(0.0), most_v = splat(0.0);
    for (int j = 0; j < N; j++) {
      v8 a = splat(0.0), b = u[j], e = splat(0.0);
      for (int k = 0; k < N; k++) {
        a += u[N + k] * W[k * S + j];
        b += u[N + k] * W[k * S + N + j];
        e += W[j * S + k] * v[k] + W[j * S + N + k] * v[N + k];
      }
      x[j] = a;
      x[N + j] = b;
      y[j] = v[N + j];
      y[N + j] = e;
    }
    for (int i = 0; i < S; i++) { uv += u[i] * v[i]; xv += x[i] * v[i]; }
    v8 inverse = uv / xv;
    d->value = xv / uv;
    for (int i = 0; i < S; i++) {
      x[i] *= inverse;
      y[i] *= inverse;
      off = v_max(off, v_abs(x[i] - u[i]));
      most = v_max(most, v_abs(x[i]));
      off_v = v_max(off_v, v_abs(y[i] - v[i]));
      most_v = v_max(most_v, v_abs(y[i]));
      u[i] = x[i];
      v[i] = y[i];
    }
    off /= most;
    off_v /= most_v;
    v8 left = off * v_max(v_min(off / last, splat(1.0)), splat(SLOWEST)), left_v = off_v * v_max(v_min(off_v / last_v, splat(1.0)), splat(SLOWEST));
    last = off;
    last_v = off_v;
    if (step && all_lanes((m8)(left <= CONVERGED) & (m8)(left_v <= CONVERGED))) { /* changes fall as they fell so far */
      uv = splat(0.0);
      for (int i = 0; i < S; i++) uv += u[i] * v[i];
      for (int i = 0; i < S; i++) v[i] /= uv;
      return 1;
    }
  }
  return 0;
}

/* V - (V v) u. */
static void take_out(v8 *V, const Dominant *d) {
  for (int i = 0; i < N; i++) {
    v8 part = splat(0.0);
    for (int j = 0; j < S; j++) part += V[i * S + j] * d->right[j];
    for (int j = 0; j < S; j++) V[i * S + j] -= part * d->left[j];
  }
}
#endif

static void multiply(const v8 *restrict A, const v8 *restrict B, v8 *restrict Z) {
#if S <= 6 /* a panel of B stays in registers while the rows of A pass */
  for (int j = 0; j < S; j += PANEL) {
    v8 panel[S][PANEL];
    for (int k = 0; k < S; k++)
      for (int c = 0; c < PANEL; c++) { panel[k][c] = B[k * S + j + c]; HOLD(panel[k][c]); }
#pragma GCC unroll 1
    for (int i = 0; i < S; i++) {
      v8 sum[PANEL];
      for (int c = 0; c < PANEL; c++) sum[c] = A[i * S] * panel[0][c];
      for (int k = 1; k < S; k++)
        for (int c = 0; c < PANEL; c++) sum[c] += A[i * S + k] * panel[k][c];
      for (int c = 0; c < PANEL; c++) Z[i * S + j + c] = sum[c];
    }
  }
#else
  multiply_rows(S, S, A, S, B, 0, Z);
#endif
}

/* Z += V P, lower halves. */
SHORT void add_product(const v8 *V, const v8 *P, v8 *Z) { multiply_rows(N, S, V, S, P, 1, Z); }

#if S > UNROLLED
#define TAKE_OUT(P, d) if (d) take_out(P, d)
#else
#define TAKE_OUT(P, d)
#endif

/* V B = [v2 X, v1 + v2 Y] of V = [v1 v2]. */
SHORT void raise(const v8 *restrict V, const v8 *restrict W, v8 *restrict below) {
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) { below[i * S + j] = splat(0.0); below[i * S + N + j] = V[i * S + j]; }
  multiply_rows(N, N, V + N, S, W, 1, below);
}

/* The lower half of P from its upper one. What rounding has left of an eigenvalue d goes first. */
SHORT void complete(v8 *P, const v8 *W, const Dominant *d) {
  TAKE_OUT(P, d);
  raise(P, W, P + N * S);
}

/* V of q0 + q1 A + q2 A^2 + q3 A^3 + q6 A^6; below, U, A6: those of B^2, B^3 and A^6. */
SHORT void combine(const double *q, double c, const v8 *restrict below, const v8 *restrict U, double q6, const v8 *restrict A6, const Dominant *d,
                   v8 *restrict V) {
  const double a = c * q[1], b = c * c * q[2], e = c * c * c * q[3];
  if (A6)
    for (int i = 0; i < N * S; i++) V[i] = b * below[i] + e * U[i] + q6 * A6[i];
  else
    for (int i = 0; i < N * S; i++) V[i] = b * below[i] + e * U[i];
  for (int i = 0; i < N; i++) V[i * S + N + i] += a;
#if S > UNROLLED
  if (d)
    for (int i = 0; i < N; i++)
      for (int j = 0; j < S; j++) V[i * S + j] -= a * d->right[N + i] * d->left[j];
#endif
}

/* Taylor's polynomials of order 12 and 18 of exp(A), P from V of B^2 and B^3, `below` and U. Source: Bader, Blanes, Casas, Mathematics 7 (2019) 1174,
 * Eqs (13), (14). */

static void taylor_12(const v8 *W, const v8 *below, const v8 *U, double c, const Dominant *d, v8 *P) {
  static const double q[4][4] = {
    {-0.01860232051462055322, -0.00500702322573317730, -0.57342012296052226390, -0.13339969394389205970},
    {4.60000000000000000000, 0.99287510353848683614, -0.13244556105279963884, 0.00172990000000000000},
    {0.21169311829980944294, 0.15822438471572672537, 0.16563516943672741501, 0.01078627793157924250},
    {0.0, -0.13181061013830184015, -0.02027855540589259079, -0.00675951846863086359}};
  v8 Q[S * S], *A6 = Q, V[N * S];
  combine(q[3], c, below, U, 0.0, NULL, d, P); /* A6 = q3^2 + q2 */
  complete(P, W, d);
  combine(q[2], c, below, U, 0.0, NULL, d, A6);
  add_product(P, P, A6);
  complete(A6, W, d);
  combine(q[1], c, below, U, 0.0, NULL, d, V); /* exp A = (q1 + A6) A6 + q0 */
  combine(q[0], c, below, U, 0.0, NULL, d, P);
  const double left = q[1][0] + q[2][0], right = q[2][0];
  for (int i = 0; i < N * S; i++) {
    P[i] += (left + right) * A6[i] + right * V[i];
    V[i] += A6[i];
  }
  add_product(V, A6, P);
}

/* U: of B^3, above a place for B^4's. */
static void taylor_18(const v8 *W, const v8 *below, v8 *U, double c, const Dominant *d, v8 *P) {
  static const double b[5][5] = {
    {0.0, -1.00365581030144618291e-01, -8.02924648241156932449e-03, -8.92138498045729985177e-04, 0.0},
    {0.0, 3.97849749499645077844e-01, 1.36783778460411720168e+00, 4.98289622525382669416e-01, -6.37898194594723280150e-04},
    {-1.09676396052962061844e+01, 1.68015813878906206114e+00, 5.71779846478865511061e-02, -6.98210122488052056106e-03,
     3.34975017086070470649e-05},
    {-9.04316832390810593223e-02, -6.76404519071381882256e-02, 6.75961301770459654925e-02, 2.95552570429315521194e-02,
     -1.39180257516060693404e-05},
    {0.0, 0.0, -9.23364619367118555360e-02, -1.69364939002081722752e-02, -1.40086798182036094347e-05}};
  const double c6 = c * c * c * c * c * c, left = b[2][0] + b[3][0], right = b[3][0];
  v8 A6[N * S], V[N * S], Q[S * S], *A9 = Q;
  complete(U, W, d); /* B^3 */
  for (int i = 0; i < N * S; i++) A6[i] = splat(0.0);
  add_product(U, U, A6); /* B^6 */
  combine(b[4], c, below, U, c6 * b[4][4], A6, d, P);
  complete(P, W, d);
  combine(b[3], c, below, U, c6 * b[3][4], A6, d, A9); /* A9 = b0 b4 + b3 */
  combine(b[0], c, below, U, 0.0, NULL, d, V);
  add_product(V, P, A9);
  complete(A9, W, d);
  combine(b[2], c, below, U, c6 * b[2][4], A6, d, V); /* exp A = (b2 + A9) A9 + b1 */
  combine(b[1], c, below, U, c6 * b[1][4], A6, d, P);
  for (int i = 0; i < N * S; i++) {
    P[i] += (left + right) * A9[i] + right * V[i];
    V[i] += A9[i];
  }
  add_product(V, A9, P);
}

/* The largest 1-norm of B^2 = [W; U] over the lanes that are within reason; a lane that is not is judged by its result. */
static double norm_of_square(const v8 *W, const v8 *U) {
  v8 worst = splat(0.0);
  for (int j = 0; j < S; j++) {
    v8 sum = splat(0.0);
    for (int i = 0; i < N; i++) sum += v_abs(W[i * S + j]) + v_abs(U[i * S + j]);
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
static void square(v8 *P, v8 *other, const v8 *W, const Dominant *d, int times) {
#if S <= UNROLLED
  v8 p[S * S], w[N * S], z[N * S];
  UNROLL for (int i = 0; i < S * S; i++) p[i] = P[i];
  UNROLL for (int i = 0; i < N * S; i++) w[i] = W[i];
#pragma GCC unroll 1
  for (; times > 0; times--) {
    UNROLL for (int i = 0; i < N * S; i++) z[i] = 2.0 * p[i];
    add_product(p, p, z);
    UNROLL for (int i = 0; i < N * S; i++) p[i] = z[i];
    complete(p, w, d);
  }
  UNROLL for (int i = 0; i < S * S; i++) P[i] = p[i];
#else
  for (; times > 0; times--) {
    v8 *squared = other;
    for (int i = 0; i < N * S; i++) squared[i] = 2.0 * P[i];
    add_product(P, P, squared);
    complete(squared, W, d);
    other = P;
    P = squared;
  }
#endif
}

#if S > UNROLLED
/* The lower halves of B^2 and B^3 without the largest eigenvalue, c |B^2|^(1/2) of what is left, and whether taking it out pays. */
static int deflate(const v8 *W, const v8 *U, double c, double *size, const Dominant *d, v8 *below, v8 *cube) {
  for (int i = 0; i < N; i++)
    for (int j = 0; j < S; j++) {
      v8 part = d->value * d->right[N + i] * d->left[j];
      below[i * S + j] = W[i * S + j] - part;
      cube[i * S + j] = U[i * S + j] - d->value * part;
    }
  double less = c * sqrt(norm_of_square(below, cube));
  if (SPARED * less >= *size) return 0;
  *size = less;
  return 1;
}
#endif

/* P = exp(c B) - I, of the polynomials by the one that costs least, then squared.
 *
 * reach: the largest |A^2|^(1/2) that each polynomial takes as it is: the first term left out is A times a power of A^2. Where one real
 * eigenvalue is far larger than all others, it is taken out first: B = value v u + B', B' v = 0, u B' = 0, and V of B'^k is that of B^k less
 * value^(k-1) v u, its lower half. */
static void exponentiate(const v8 *W, double c, const double *reach, Dominant *dominant, v8 *P) {
  static const double cost[2] = {16.0 + 22.0 / N, 22.0 + 38.0 / N}, squaring = 6.0 + 2.0 / N;
  v8 cube[S * S], other[S * S], *U = cube;
  const v8 *below = W;
  const Dominant *d = NULL;
  raise(W, W, U);
  double size = c * sqrt(norm_of_square(W, U)), scale = c;
#if S > UNROLLED
  v8 rest[N * S], less[S * S];
  if (dominant->wanted && size > WORTH * reach[0]) {
    dominant->wanted = follow(W, dominant) && deflate(W, U, c, &size, dominant, rest, less);
    if (dominant->wanted) { below = rest; U = less; d = dominant; }
  }
#endif
  int few = count_squarings(size, reach[0]), fewer = count_squarings(size, reach[1]);
  int high = cost[1] + squaring * fewer < cost[0] + squaring * few, squarings = high ? fewer : few;
  for (int k = 0; k < squarings; k++) scale *= 0.5;
  v8 *start = S > UNROLLED && squarings % 2 ? other : P; /* so that the last square stands in P */
  if (high) taylor_18(W, below, U, scale, d, start);
  else taylor_12(W, below, U, scale, d, start);
  complete(start, W, d);
  square(start, start == P ? other : P, W, d, squarings);
#if S > UNROLLED
  if (d) {
    v8 lost;
    for (int l = 0; l < L; l++) lost[l] = expm1(c * d->value[l]);
    for (int i = 0; i < S; i++)
      for (int j = 0; j < S; j++) P[i * S + j] += lost * d->right[i] * d->left[j];
  }
#endif
}
