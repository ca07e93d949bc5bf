/* Floquet exponents of y'' = X(phase, p) y + Y(phase, p) y' for many p, eight at a time: Magnus' exponential of order 4 on finer and finer
 * resolutions, eigenvalues of the product of its factors by QR sweeps, Richardson's extrapolation of the last three with its own error,
 * until that is as small as asked.
 *
 * The same computation as romberg.py, spectrum.py and extrapolation.py, which say where it comes from. In front of this file stands what `Model` makes:
 * COORDINATES, PARAMETERS, PHASE_INPUTS, PHASE_VALUES, POINT_VALUES, ROWS, COLUMNS (the block of a product that stays in registers),
 *     of_phase(u, f): what depends on the phase alone       of_point(p, w): what depends on the parameters alone; returns the period
 *     at_node(f, w, X, Y): the coefficients at one phase; returns where the mass matrix is positive definite
 */

enum { N = COORDINATES, MAX_SWEEPS = 8, MAX_SHIFTS = 60 };
static const double WIDEST = 9.2, SMALL = 2.2250738585072014e-308, TURN = 6.283185307179586476925;
static const double STEADY = 0.2, RATE = 8.0, LEAST = 0.02, SHARED = 0.3, FASTEST = 4.0;

/* ---- small matrices, eight of each ---- */

static void multiply(const v8 *restrict A, const v8 *restrict B, v8 *restrict C) {
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
      for (int c = 0; c < PANEL; c++) C[i * S + j + c] = sum[c];
    }
  }
#else
  for (int i = 0; i < S; i += ROWS)
    for (int j = 0; j < S; j += COLUMNS) {
      v8 sum[ROWS][COLUMNS];
      for (int r = 0; r < ROWS; r++)
        for (int c = 0; c < COLUMNS; c++) sum[r][c] = splat(0.0);
#pragma GCC unroll 1
      for (int k = 0; k < S; k++) {
        v8 row[COLUMNS];
        for (int c = 0; c < COLUMNS; c++) { row[c] = B[k * S + j + c]; HOLD(row[c]); }
        for (int r = 0; r < ROWS; r++) {
          v8 a = A[(i + r) * S + k];
          HOLD(a);
          for (int c = 0; c < COLUMNS; c++) sum[r][c] += a * row[c];
        }
      }
      for (int r = 0; r < ROWS; r++)
        for (int c = 0; c < COLUMNS; c++) C[(i + r) * S + j + c] = sum[r][c];
    }
#endif
}

static void add_identity(v8 *A, double factor) {
  for (int i = 0; i < S; i++) A[i * S + i] += factor;
}

/* The largest 1-norm of those that are within reason; a lane that is not is judged by its result. */
static double norm(const v8 *A) {
  v8 worst = splat(0.0);
  for (int j = 0; j < S; j++) {
    v8 sum = splat(0.0);
    for (int i = 0; i < S; i++) sum += v_abs(A[i * S + j]);
    worst = v_max(worst, sum);
  }
  double largest = 0.0;
  for (int l = 0; l < L; l++) largest = worst[l] > largest && worst[l] < 1e12 ? worst[l] : largest;
  return largest;
}

/* Taylor's polynomials of order 8, 12, 18 in 3, 4, 5 products, A^2 counted. Source: Bader, Blanes, Casas, Mathematics 7 (2019) 1174, Eqs (12)-(14). */

static void taylor_8(const v8 *A, const v8 *A2, double f, v8 *E) {
  const double root = 13.304134695650071, x3 = 2.0 / 3.0, f2 = f * f;
  const double x1 = x3 * (1 + root) / 88 * f * f2, x2 = x3 * (1 + root) / 352 * f2 * f2, x4 = (-271 + 29 * root) / (315 * x3);
  const double x5 = 11 * (root - 1) / (1260 * x3) * f, x6 = 11 * (root - 9) / (5040 * x3) * f2, x7 = (89 - root) / (5040 * x3 * x3);
  const double y2 = (857 - 58 * root) / 630 * f2;
  v8 A4[S * S], left[S * S], right[S * S];
  for (int i = 0; i < S * S; i++) left[i] = x1 * A[i] + x2 * A2[i];
  multiply(A2, left, A4);
  for (int i = 0; i < S * S; i++) {
    left[i] = x3 * f2 * A2[i] + A4[i];
    right[i] = x5 * A[i] + x6 * A2[i] + x7 * A4[i];
  }
  add_identity(right, x4);
  multiply(left, right, E);
  for (int i = 0; i < S * S; i++) E[i] += f * A[i] + y2 * A2[i];
  add_identity(E, 1.0);
}

static void taylor_12(const v8 *A, const v8 *A2, double f, v8 *E) {
  static const double q[4][4] = {
    {-0.01860232051462055322, 4.60000000000000000000, 0.21169311829980944294, 0.0},
    {-0.00500702322573317730, 0.99287510353848683614, 0.15822438471572672537, -0.13181061013830184015},
    {-0.57342012296052226390, -0.13244556105279963884, 0.16563516943672741501, -0.02027855540589259079},
    {-0.13339969394389205970, 0.00172990000000000000, 0.01078627793157924250, -0.00675951846863086359}};
  v8 A3[S * S], B[4][S * S], A6[S * S];
  multiply(A2, A, A3);
  for (int i = 0; i < S * S; i++) {
    v8 a = f * A[i], a2 = f * f * A2[i], a3 = f * f * f * A3[i];
#pragma GCC unroll 4
    for (int b = 0; b < 4; b++) B[b][i] = q[1][b] * a + q[2][b] * a2 + q[3][b] * a3;
  }
  for (int b = 0; b < 4; b++) add_identity(B[b], q[0][b]);
  multiply(B[3], B[3], A6);
  for (int i = 0; i < S * S; i++) {
    A6[i] += B[2][i];
    B[1][i] += A6[i];
  }
  multiply(B[1], A6, E);
  for (int i = 0; i < S * S; i++) E[i] += B[0][i];
}

static void taylor_18(const v8 *A, const v8 *A2, double f, v8 *E) {
  static const double b[5][5] = {
    {0.0, -1.00365581030144618291e-01, -8.02924648241156932449e-03, -8.92138498045729985177e-04, 0.0},
    {0.0, 3.97849749499645077844e-01, 1.36783778460411720168e+00, 4.98289622525382669416e-01, -6.37898194594723280150e-04},
    {-1.09676396052962061844e+01, 1.68015813878906206114e+00, 5.71779846478865511061e-02, -6.98210122488052056106e-03,
     3.34975017086070470649e-05},
    {-9.04316832390810593223e-02, -6.76404519071381882256e-02, 6.75961301770459654925e-02, 2.95552570429315521194e-02,
     -1.39180257516060693404e-05},
    {0.0, 0.0, -9.23364619367118555360e-02, -1.69364939002081722752e-02, -1.40086798182036094347e-05}};
  v8 A3[S * S], A6[S * S], B[5][S * S], A9[S * S];
  multiply(A2, A, A3);
  multiply(A3, A3, A6);
  const double f6 = f * f * f * f * f * f;
  for (int i = 0; i < S * S; i++) {
    v8 a = f * A[i], a2 = f * f * A2[i], a3 = f * f * f * A3[i], a6 = f6 * A6[i];
#pragma GCC unroll 5
    for (int k = 0; k < 5; k++) B[k][i] = b[k][1] * a + b[k][2] * a2 + b[k][3] * a3 + b[k][4] * a6;
  }
  add_identity(B[2], b[2][0]);
  add_identity(B[3], b[3][0]);
  multiply(B[0], B[4], A9);
  for (int i = 0; i < S * S; i++) {
    A9[i] += B[3][i];
    B[2][i] += A9[i];
  }
  multiply(B[2], A9, E);
  for (int i = 0; i < S * S; i++) E[i] += B[1][i];
}

/* The least s for which size / 2^s <= reach. */
static int count_squarings(double size, double reach) {
  int s = 0;
  for (; size > reach && s < 200; s++) size *= 0.5;
  return s;
}

/* exp(A), of the polynomials by the one that costs least, then squared; the result stands in one of the two places given.
 *
 * reach: the largest |A^2|^(1/2) that each polynomial takes as it is: the first term left out is A times a power of A^2. Sums of matrices
 * count beside products: they cost S times less each. */
static v8 *exponentiate(const v8 *A, const double *reach, v8 *E, v8 *other) {
  static const double products[3] = {3.0 + 9.0 / S, 4.0 + 16.0 / S, 5.0 + 25.0 / S};
  v8 A2[S * S];
  multiply(A, A, A2);
  double size = sqrt(norm(A2)), least = INFINITY, factor = 1.0;
  int best = 0, squarings = 0;
  for (int k = 0; k < 3; k++) {
    int more = count_squarings(size, reach[k]);
    if (products[k] + more < least) { least = products[k] + more; best = k; squarings = more; }
  }
  for (int k = 0; k < squarings; k++) factor *= 0.5;
  if (best == 0) taylor_8(A, A2, factor, E);
  else if (best == 1) taylor_12(A, A2, factor, E);
  else taylor_18(A, A2, factor, E);
  for (; squarings > 0; squarings--) {
    v8 *squared = other;
    multiply(E, E, squared);
    other = E;
    E = squared;
  }
  return E;
}

/* Omega = h (A1 + A2) / 2 - sqrt(3) h^2 [A1, A2] / 12 for A = [[0, I], [X, Y]], of the scaled states. */
static void form_omega(const v8 *X1, const v8 *Y1, const v8 *X2, const v8 *Y2, double h, const double *scale, v8 *O) {
  const double c = 0.14433756729740644 * h * h, half = 0.5 * h;
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) {
      v8 below = splat(0.0), right = splat(0.0), dX = X2[i * N + j] - X1[i * N + j];
      for (int k = 0; k < N; k++) {
        below += Y1[i * N + k] * X2[k * N + j] - Y2[i * N + k] * X1[k * N + j];
        right += Y1[i * N + k] * Y2[k * N + j] - Y2[i * N + k] * Y1[k * N + j];
      }
      O[i * S + j] = -c * dX;
      O[i * S + N + j] = c * (Y1[i * N + j] - Y2[i * N + j]) + (i == j ? h : 0.0);
      O[(N + i) * S + j] = half * (X1[i * N + j] + X2[i * N + j]) - c * below;
      O[(N + i) * S + N + j] = half * (Y1[i * N + j] + Y2[i * N + j]) - c * (right - dX);
    }
  for (int i = 0; i < S * S; i++) O[i] *= scale[i];
}

/* A = Q R by Householder's reflections H = I - beta v v'; A becomes R. */
static void factor_qr(v8 *R, v8 *Q) {
  v8 v[S][S], beta[S];
  for (int j = 0; j < S - 1; j++) {
    v8 size = splat(SMALL);
    for (int i = j; i < S; i++) size += R[i * S + j] * R[i * S + j];
    size = v_sqrt(size);
    v8 signed_size = v_copysign(size, R[j * S + j]);
    for (int i = j; i < S; i++) v[j][i] = R[i * S + j];
    v[j][j] += signed_size;
    beta[j] = 1.0 / (size * v_abs(v[j][j]));
    R[j * S + j] = -signed_size;
    for (int i = j + 1; i < S; i++) R[i * S + j] = splat(0.0);
    for (int c = j + 1; c < S; c++) {
      v8 dot = splat(0.0);
      for (int i = j; i < S; i++) dot += v[j][i] * R[i * S + c];
      dot *= beta[j];
      for (int i = j; i < S; i++) R[i * S + c] -= v[j][i] * dot;
    }
  }
  for (int i = 0; i < S * S; i++) Q[i] = splat(i % (S + 1) ? 0.0 : 1.0);
  for (int j = S - 2; j >= 0; j--)
    for (int c = j; c < S; c++) {
      v8 dot = splat(0.0);
      for (int i = j; i < S; i++) dot += v[j][i] * Q[i * S + c];
      dot *= beta[j];
      for (int i = j; i < S; i++) Q[i * S + c] -= v[j][i] * dot;
    }
}

/* ---- eigenvalues of one small matrix: Hessenberg form by elimination, then Francis' double shifts (EISPACK's elmhes and hqr) ---- */

static void reduce_hessenberg(int n, double a[S][S]) {
  for (int m = 1; m < n - 1; m++) {
    int pivot = m;
    for (int i = m + 1; i < n; i++)
      if (fabs(a[i][m - 1]) > fabs(a[pivot][m - 1])) pivot = i;
    if (pivot != m) {
      for (int j = m - 1; j < n; j++) { double t = a[pivot][j]; a[pivot][j] = a[m][j]; a[m][j] = t; }
      for (int i = 0; i < n; i++) { double t = a[i][pivot]; a[i][pivot] = a[i][m]; a[i][m] = t; }
    }
    if (a[m][m - 1] == 0.0) continue;
    for (int i = m + 1; i < n; i++) {
      double y = a[i][m - 1] / a[m][m - 1];
      if (y == 0.0) continue;
      a[i][m - 1] = 0.0;
      for (int j = m; j < n; j++) a[i][j] -= y * a[m][j];
      for (int k = 0; k < n; k++) a[k][m] += y * a[k][i];
    }
  }
}

static int find_eigenvalues(int n, double a[S][S], double *re, double *im) {
  double size = 0.0, t = 0.0, p = 0, q = 0, r = 0, s, w, x, y, z;
  reduce_hessenberg(n, a);
  for (int i = 0; i < n; i++)
    for (int j = i ? i - 1 : 0; j < n; j++) size += fabs(a[i][j]);
  if (!(size < INFINITY)) return 0;
  for (int last = n - 1, tries = 0; last >= 0;) {
    int l = last;
    for (; l >= 1; l--) {
      s = fabs(a[l - 1][l - 1]) + fabs(a[l][l]);
      if (s == 0.0) s = size;
      if (fabs(a[l][l - 1]) <= 1.1102230246251565e-16 * s) { a[l][l - 1] = 0.0; break; }
    }
    x = a[last][last];
    if (l == last) { re[last] = x + t; im[last] = 0.0; last--; tries = 0; continue; }
    y = a[last - 1][last - 1];
    w = a[last][last - 1] * a[last - 1][last];
    if (l == last - 1) {
      p = 0.5 * (y - x);
      q = p * p + w;
      z = sqrt(fabs(q));
      x += t;
      if (q >= 0.0) {
        z = p + copysign(z, p);
        re[last - 1] = re[last] = x + z;
        if (z != 0.0) re[last] = x - w / z;
        im[last - 1] = im[last] = 0.0;
      } else {
        re[last - 1] = re[last] = x + p;
        im[last - 1] = z;
        im[last] = -z;
      }
      last -= 2;
      tries = 0;
      continue;
    }
    if (tries == MAX_SHIFTS) return 0;
    if (tries && tries % 10 == 0) {
      t += x;
      for (int i = 0; i <= last; i++) a[i][i] -= x;
      s = fabs(a[last][last - 1]) + fabs(a[last - 1][last - 2]);
      y = x = 0.75 * s;
      w = -0.4375 * s * s;
    }
    tries++;
    int m = last - 2;
    for (; m >= l; m--) {
      z = a[m][m];
      r = x - z;
      s = y - z;
      p = (r * s - w) / a[m + 1][m] + a[m][m + 1];
      q = a[m + 1][m + 1] - z - r - s;
      r = a[m + 2][m + 1];
      s = 1.0 / (fabs(p) + fabs(q) + fabs(r));
      p *= s; q *= s; r *= s;
      if (m == l) break;
      double u = fabs(a[m][m - 1]) * (fabs(q) + fabs(r));
      double v = fabs(p) * (fabs(a[m - 1][m - 1]) + fabs(z) + fabs(a[m + 1][m + 1]));
      if (u <= 1.1102230246251565e-16 * v) break;
    }
    for (int i = m + 2; i <= last; i++) {
      a[i][i - 2] = 0.0;
      if (i != m + 2) a[i][i - 3] = 0.0;
    }
    for (int k = m; k < last; k++) {
      if (k != m) {
        p = a[k][k - 1];
        q = a[k + 1][k - 1];
        r = k != last - 1 ? a[k + 2][k - 1] : 0.0;
        x = fabs(p) + fabs(q) + fabs(r);
        if (x == 0.0) continue;
        s = 1.0 / x;
        p *= s; q *= s; r *= s;
      }
      s = copysign(sqrt(p * p + q * q + r * r), p);
      if (s == 0.0) continue;
      if (k != m) a[k][k - 1] = -s * x;
      else if (l != m) a[k][k - 1] = -a[k][k - 1];
      p += s;
      double is = 1.0 / s, ip = 1.0 / p;
      x = p * is; y = q * is; z = r * is;
      q *= ip; r *= ip;
      for (int j = k; j <= last; j++) {
        p = a[k][j] + q * a[k + 1][j];
        if (k != last - 1) { p += r * a[k + 2][j]; a[k + 2][j] -= p * z; }
        a[k + 1][j] -= p * y;
        a[k][j] -= p * x;
      }
      int end = last < k + 3 ? last : k + 3;
      for (int i = l; i <= end; i++) {
        p = x * a[i][k] + y * a[i][k + 1];
        if (k != last - 1) { p += z * a[i][k + 2]; a[i][k + 2] -= p * r; }
        a[i][k + 1] -= p * q;
        a[i][k] -= p;
      }
    }
  }
  return 1;
}

/* ---- eigenvalues of a product of factors ---- */

typedef struct { /* log of a growing product of positive numbers: log(mantissa) + exponent log 2 */
  v8 mantissa;
  m8 exponent;
} Log;

static void times(Log *log, v8 factor) {
  log->mantissa *= v_max(factor, splat(SMALL));
  m8 bits = (m8)log->mantissa;
  log->exponent += (bits >> 52) - 1023;
  log->mantissa = (v8)((bits & 0xfffffffffffffLL) | 0x3ff0000000000000LL);
}

/* The diagonal block [start, stop) of W R_(G-1) ... R_0 as P 2^exponent, in all lanes. */
static void multiply_block(const v8 *W, const v8 *R, int G, int start, int stop, v8 P[S][S], m8 *exponent) {
  v8 T[S][S];
  int n = stop - start;
  *exponent = (m8)splat(0.0);
  for (int g = 0; g < G; g++) {
    const v8 *F = R + (long)g * S * S + start * S + start;
    v8 largest = splat(SMALL);
    for (int i = 0; i < n; i++) { /* row i of R_g T needs the rows from i on, which are still the old ones */
      for (int j = i; j < n; j++) {
        v8 sum = g ? F[i * S + i] * T[i][j] : F[i * S + j];
        if (g) for (int k = i + 1; k <= j; k++) sum += F[i * S + k] * T[k][j];
        T[i][j] = sum;
      }
      largest = v_max(largest, v_abs(T[i][i]));
    }
    m8 e = (((m8)largest >> 52) & 0x7ff) - 1023; /* far from over- and underflow, by a power of two */
    v8 scale = (v8)((1023 - e) << 52);
    *exponent += e;
    for (int i = 0; i < n; i++)
      for (int j = i; j < n; j++) T[i][j] *= scale;
  }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      P[i][j] = W[(start + i) * S + start] * T[0][j];
      for (int k = 1; k <= j; k++) P[i][j] += W[(start + i) * S + start + k] * T[k][j];
    }
}

/* Logs of the eigenvalues of P 2^exponent in lane l. */
static int solve_block(v8 P[S][S], m8 exponent, int start, int stop, int l, double *re, double *im) {
  double a[S][S];
  int n = stop - start;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) a[i][j] = P[i][j][l];
  if (!find_eigenvalues(n, a, re + start, im + start)) return 0;
  for (int i = start; i < stop; i++) {
    double x = re[i], y = im[i];
    re[i] = 0.5 * log(fmax(x * x + y * y, SMALL)) + exponent[l] * 0.693147180559945309417;
    im[i] = y != 0.0 ? atan2(y, x) : x < 0.0 ? 0.5 * TURN : 0.0;
  }
  return 1;
}

/* Logs (re, im) of the eigenvalues of F_(G-1) ... F_0 by cyclic QR sweeps from Q; returns in which lanes they were found soundly. */
static m8 find_logs(const v8 *F, v8 *R, int G, v8 log_det, double accuracy, v8 *Q, v8 *re, v8 *im) {
  v8 end[S * S], W[S * S], sizes[S];
  m8 cut[S + 1], sign[S], sound;
  cut[0] = cut[S] = (m8)(splat(0.0) == splat(0.0));
  for (int sweep = 0;; sweep++) {
    Log log[S];
    memcpy(end, Q, sizeof end);
    for (int i = 0; i < S; i++) { log[i].mantissa = splat(1.0); log[i].exponent = (m8)splat(0.0); sign[i] = (m8)splat(0.0); }
    for (int g = 0; g < G; g++) {
      v8 *T = R + (long)g * S * S;
      multiply(F + (long)g * S * S, end, T);
      factor_qr(T, end);
      for (int i = 0; i < S; i++) {
        times(&log[i], v_abs(T[i * S + i]));
        sign[i] ^= (m8)T[i * S + i];
      }
    }
    for (int i = 0; i < S; i++)
      for (int j = 0; j < S; j++) {
        v8 sum = splat(0.0);
        for (int k = 0; k < S; k++) sum += Q[k * S + i] * end[k * S + j];
        W[i * S + j] = sum;
      }
    v8 rest = log_det, low, high, wide = splat(0.0);
    for (int i = 0; i < S - 1; i++) {
      sizes[i] = v_log(log[i].mantissa) + 0.693147180559945309417 * v_double(log[i].exponent);
      rest -= sizes[i];
    }
    sizes[S - 1] = rest;
    low = high = sizes[0];
    for (int i = 1; i < S; i++) {
      v8 corner = splat(0.0);
      for (int r = i; r < S; r++)
        for (int c = 0; c < i; c++) corner = v_max(corner, v_abs(W[r * S + c]));
      cut[i] = (m8)(corner <= accuracy);
      high = v_choose(cut[i], sizes[i], v_max(high, sizes[i]));
      low = v_choose(cut[i], sizes[i], v_min(low, sizes[i]));
      wide = v_max(wide, high - low);
    }
    sound = (m8)(wide <= WIDEST);
    if (sweep + 1 == MAX_SWEEPS || all_lanes(sound)) break;
    memcpy(Q, end, sizeof end);
  }
  for (int start = 0; start < S; start++) {
    m8 here = cut[start] & sound;
    for (int stop = start + 1; stop <= S; stop++) {
      m8 block = here & cut[stop];
      here &= ~cut[stop];
      if (!any_lane(block)) continue;
      if (stop == start + 1) {
        m8 negative = (sign[start] ^ (m8)W[start * S + start]) < 0;
        re[start] = v_choose(block, sizes[start], re[start]);
        im[start] = v_choose(block, v_choose(negative, splat(0.5 * TURN), splat(0.0)), im[start]);
        continue;
      }
      v8 P[S][S];
      m8 exponent;
      multiply_block(W, R, G, start, stop, P, &exponent);
      for (int l = 0; l < L; l++) {
        double lre[S], lim[S];
        if (!block[l]) continue;
        if (!solve_block(P, exponent, start, stop, l, lre, lim)) { sound[l] = 0; continue; }
        for (int i = start; i < stop; i++) { re[i][l] = lre[i]; im[i][l] = lim[i]; }
      }
    }
  }
  v8 last_re = log_det, last_im = splat(0.0);
  for (int i = 0; i < S - 1; i++) { last_re -= re[i]; last_im -= im[i]; }
  re[S - 1] = v_choose(cut[S - 1], last_re, re[S - 1]);
  im[S - 1] = v_choose(cut[S - 1], last_im, im[S - 1]);
  for (int i = 0; i < S; i++) {
    re[i] = v_choose(sound, re[i], splat(NAN));
    im[i] = v_choose(sound, im[i], splat(NAN));
  }
  return sound;
}

/* The widest spread of the logs of the moduli, the smallest of each lane left out, over the lanes that are sound. */
static double measure_spread(const v8 *re, m8 sound) {
  double widest = -1.0;
  for (int l = 0; l < L; l++) {
    if (!sound[l]) continue;
    double low = INFINITY, second = INFINITY, high = -INFINITY;
    for (int i = 0; i < S; i++) {
      double x = re[i][l];
      high = fmax(high, x);
      if (x < low) { second = low; low = x; } else second = fmin(second, x);
    }
    widest = fmax(widest, high - second);
  }
  return widest < 0.0 ? INFINITY : widest;
}

/* ---- Richardson's extrapolation ---- */

typedef struct { v8 re[S], im[S]; m8 sound; } Logs;

static v8 wrap(v8 x) { return x - TURN * v_round(x * (1.0 / TURN)); }

static v8 v_size(v8 x, v8 y) { return v_sqrt(x * x + y * y); }

/* (dr, di) = x less the one of c that lies nearest to it modulo 2 pi i, and with it the (sr, si) that belongs to that one. */
static void subtract_nearest(v8 xr, v8 xi, const Logs *c, const v8 *steps_re, const v8 *steps_im, v8 *dr, v8 *di, v8 *sr, v8 *si) {
  v8 best = splat(INFINITY);
  *dr = *di = *sr = *si = splat(NAN);
  for (int j = 0; j < S; j++) {
    v8 r = xr - c->re[j], i = wrap(xi - c->im[j]), d = r * r + i * i;
    m8 nearer = (m8)(d < best);
    best = v_choose(nearer, d, best);
    *dr = v_choose(nearer, r, *dr);
    *di = v_choose(nearer, i, *di);
    *sr = v_choose(nearer, steps_re[j], *sr);
    *si = v_choose(nearer, steps_im[j], *si);
  }
}

/* Logs x of order 8 from three resolutions, and their errors; gains: see extrapolation.py. */
static void extrapolate(const Logs *coarse, const Logs *middle, const Logs *fine, const double *gains, double accuracy, Logs *x, v8 *error) {
  const double noise = 40.0 * 2.220446049250313e-16;
  v8 ar[S], ai[S], none[S], change[S], step[S], rate[S], floor[S], most = splat(0.0), br, bi, sr, si;
  for (int i = 0; i < S; i++) none[i] = splat(0.0);
  for (int i = 0; i < S; i++) subtract_nearest(middle->re[i], middle->im[i], coarse, none, none, &ar[i], &ai[i], &sr, &si);
  for (int i = 0; i < S; i++) {
    subtract_nearest(fine->re[i], fine->im[i], middle, ar, ai, &br, &bi, &sr, &si);
    x->re[i] = fine->re[i] + gains[2] * br + gains[3] * sr;
    v8 im = wrap(fine->im[i] + gains[2] * bi + gains[3] * si);
    x->im[i] = v_choose((m8)(im <= -0.5 * TURN), im + TURN, im);
    floor[i] = (noise + accuracy) * v_size(x->re[i], x->im[i]) + noise;
    change[i] = v_size((1.0 + gains[0]) * br - gains[1] * sr, (1.0 + gains[0]) * bi - gains[1] * si);
    step[i] = gains[0] * v_size(br, bi);
    rate[i] = change[i] / (step[i] + floor[i]);
    most = v_max(most, rate[i]);
  }
  for (int i = 0; i < S; i++) {
    v8 counted = v_min(v_max(rate[i], SHARED * most), splat(FASTEST));
    error[i] = change[i] * (STEADY + RATE * counted) + LEAST * step[i] + floor[i];
  }
}

/* ---- what is called from outside ---- */

static int count_groups(int segments, double spread, double accuracy) {
  double largest = log(accuracy / (10 * 2.220446049250313e-16));
  while (segments % 2 == 0 && 2 * spread <= largest * segments) segments /= 2;
  return segments;
}

/* Factors F of one resolution: neighbours are multiplied until G are left; f, h: where the tables of this resolution begin. Returns where
 * the mass matrix is positive definite; adds to the log of the determinant. */
static m8 multiply_out(const double *f, const v8 *w, const double *h, int K, int G, const double *scale, const double *reach, v8 *F, v8 *log_det) {
  m8 positive = (m8)(splat(0.0) == splat(0.0));
  for (int g = 0; g < G; g++, F += S * S) {
    v8 one[S * S], two[S * S], *product = NULL;
    for (int k = 0; k < K / G; k++, f += 2 * PHASE_VALUES, h++) {
      v8 X1[N * N], Y1[N * N], X2[N * N], Y2[N * N], O[S * S], E[S * S], other[S * S], *found;
      positive &= at_node(f, w, X1, Y1) & at_node(f + PHASE_VALUES, w, X2, Y2);
      for (int i = 0; i < N; i++) *log_det += 0.5 * *h * (Y1[i * N + i] + Y2[i * N + i]);
      form_omega(X1, Y1, X2, Y2, *h, scale, O);
      found = exponentiate(O, reach, E, other);
      v8 *next = k + 1 == K / G ? F : product == one ? two : one;
      if (product) multiply(found, product, next);
      else memcpy(next, found, sizeof E);
      product = next;
    }
  }
  return positive;
}

/* Whether every error is as small as asked, in each lane. */
static m8 meets(const Logs *x, const v8 *error, v8 period, double tol) {
  m8 met = (m8)(splat(0.0) == splat(0.0));
  for (int i = 0; i < S; i++) met &= (m8)(error[i] <= tol * v_max(period, v_size(x->re[i], x->im[i])));
  return met;
}

/* Logs (V, S, 2) of the multipliers at points (V, PARAMETERS), their errors (V, S), whether they are sound (V), the periods (V), and how
 * many segments were computed (V).
 *
 * segments (levels): ever more of them; lengths: h of all segments, level after level; inputs: what depends on the phase at both nodes of
 * each segment, (nodes, PHASE_INPUTS); gains (levels, 4): see `extrapolate`; scale (S, S): of the states; reach (3): see `exponentiate`.
 * Eight values stop at the resolution at which all of them that are sound meet tol. Returns 0, or 1 where memory gives out. */
int find_exponents(long values, const double *points, int levels, const int *segments, const double *lengths, const double *inputs,
                   const double *gains, const double *scale, const double *reach, double accuracy, double spread_given, double tol,
                   double *logs, double *errors, unsigned char *sounds, double *periods, int *work) {
  long nodes = 0;
  for (int k = 0; k < levels; k++) nodes += 2 * segments[k];
  size_t most = (size_t)segments[levels - 1] * S * S * sizeof(v8);
  double *table = malloc((size_t)nodes * (PHASE_VALUES + 1) * sizeof(double));
  v8 *F = aligned_alloc(64, most), *R = aligned_alloc(64, most);
  if (!table || !F || !R) { free(table); free(F); free(R); return 1; }
  for (long k = 0; k < nodes; k++) of_phase(inputs + k * PHASE_INPUTS, table + k * PHASE_VALUES);
  for (long first = 0; first < values; first += L) {
    int lanes = values - first < L ? (int)(values - first) : L, level = 0, computed = 0;
    v8 p[PARAMETERS + 1], w[POINT_VALUES + 1], Q[S * S], error[S];
    Logs found[3], x;
    for (int i = 0; i < PARAMETERS; i++)
      for (int l = 0; l < L; l++) p[i][l] = points[(first + (l < lanes ? l : lanes - 1)) * PARAMETERS + i];
    v8 period = of_point(p, w);
    m8 sound = (m8)(splat(0.0) == splat(0.0)), positive = sound;
    double spread = spread_given;
    for (int i = 0; i < S * S; i++) Q[i] = splat(i % (S + 1) ? 0.0 : 1.0);
    const double *f = table, *h = lengths;
    for (;;) {
      int K = segments[level], G = count_groups(K, spread, accuracy);
      v8 log_det = splat(0.0);
      Logs *now = &found[level % 3];
      positive &= multiply_out(f, w, h, K, G, scale, reach, F, &log_det);
      now->sound = find_logs(F, R, G, log_det, accuracy, Q, now->re, now->im);
      spread = measure_spread(now->re, now->sound);
      f += 2 * PHASE_VALUES * K;
      h += K;
      computed += K;
      if (++level < 3) continue;
      extrapolate(&found[level % 3], &found[(level + 1) % 3], now, gains + 4 * (level - 1), accuracy, &x, error);
      sound = found[0].sound & found[1].sound & found[2].sound & positive;
      if (level == levels || all_lanes((sound & meets(&x, error, period, tol)) | ~positive)) break;
    }
    for (int l = 0; l < lanes; l++) {
      long v = first + l;
      sounds[v] = sound[l] != 0;
      periods[v] = period[l];
      work[v] = computed;
      for (int i = 0; i < S; i++) {
        logs[(v * S + i) * 2] = x.re[i][l];
        logs[(v * S + i) * 2 + 1] = x.im[i][l];
        errors[v * S + i] = error[i][l];
      }
    }
  }
  free(table);
  free(F);
  free(R);
  return 0;
}

/* Exponents (V, S, 2) by falling real part, in place of the logs; the largest error and the verdict of each value (0 undecided, 1 stable,
 * 2 unstable), and whether every exponent meets tol. */
void judge(long values, double tol, const double *periods, const unsigned char *sounds, double *logs, const double *errors,
           double *error, signed char *verdict, unsigned char *reached) {
  for (long v = 0; v < values; v++) {
    double *x = logs + v * S * 2, T = periods[v], worst = 0.0;
    int stable = 1, unstable = 0, met = sounds[v];
    for (int i = 0; i < S; i++) {
      double e = errors[v * S + i], size = sqrt(x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1]);
      met &= e <= tol * fmax(T, size);
      unstable |= x[2 * i] > e;
      stable &= x[2 * i] < -e;
      worst = fmax(worst, e);
    }
    for (int i = 1; i < S; i++) {
      double a = x[2 * i], b = x[2 * i + 1];
      int j = i;
      for (; j > 0 && x[2 * j - 2] < a; j--) { x[2 * j] = x[2 * j - 2]; x[2 * j + 1] = x[2 * j - 1]; }
      x[2 * j] = a;
      x[2 * j + 1] = b;
    }
    for (int i = 0; i < 2 * S; i++) x[i] /= T;
    error[v] = worst / T;
    verdict[v] = unstable ? 2 : stable ? 1 : 0;
    reached[v] = met != 0;
  }
}
