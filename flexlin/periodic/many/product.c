/* Logs of the eigenvalues of a product of factors, eight products at a time, by cyclic QR sweeps. The same as spectrum.py. */

enum { MAX_SWEEPS = 8 };
static const double WIDEST = 9.2, SMALL = 2.2250738585072014e-308, TURN = 6.283185307179586476925;

typedef struct { v8 v[STATES][STATES], beta[STATES]; } Reflections; /* Q = H_0 H_1 ..., H_j = I - beta_j v_j v_j' */

/* A = Q R; A becomes R. */
static void factor_qr(v8 *R, Reflections *Q) {
  for (int j = 0; j < STATES - 1; j++) {
    v8 size = splat(SMALL), *v = Q->v[j];
    for (int i = j; i < STATES; i++) size += R[i * STATES + j] * R[i * STATES + j];
    size = v_sqrt(size);
    v8 signed_size = v_copysign(size, R[j * STATES + j]);
    for (int i = j; i < STATES; i++) v[i] = R[i * STATES + j];
    v[j] += signed_size;
    v8 beta = Q->beta[j] = 1.0 / (size * v_abs(v[j]));
    R[j * STATES + j] = -signed_size;
    for (int i = j + 1; i < STATES; i++) R[i * STATES + j] = splat(0.0);
    for (int c = j + 1; c < STATES; c++) {
      v8 dot = splat(0.0);
      for (int i = j; i < STATES; i++) dot += v[i] * R[i * STATES + c];
      dot *= beta;
      for (int i = j; i < STATES; i++) R[i * STATES + c] -= v[i] * dot;
    }
  }
}

/* Z = A B. */
static void multiply_states(const v8 *restrict A, const v8 *restrict B, v8 *restrict Z) {
#if STATES == S
  multiply(A, B, Z);
#else
  for (int i = 0; i < STATES; i++)
    for (int j = 0; j < STATES; j++) {
      v8 sum = A[i * STATES] * B[j];
      for (int k = 1; k < STATES; k++) sum += A[i * STATES + k] * B[k * STATES + j];
      Z[i * STATES + j] = sum;
    }
#endif
}

/* A Q in place of A. */
static void multiply_right(v8 *A, const Reflections *Q) {
  for (int j = 0; j < STATES - 1; j++)
    for (int r = 0; r < STATES; r++) {
      v8 dot = splat(0.0), *row = A + r * STATES;
      for (int i = j; i < STATES; i++) dot += row[i] * Q->v[j][i];
      dot *= Q->beta[j];
      for (int i = j; i < STATES; i++) row[i] -= dot * Q->v[j][i];
    }
}


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
static void multiply_block(const v8 *W, const v8 *R, int G, int start, int stop, v8 P[STATES][STATES], m8 *exponent) {
  v8 T[STATES][STATES];
  int n = stop - start;
  *exponent = (m8)splat(0.0);
  for (int g = 0; g < G; g++) {
    const v8 *F = R + (long)g * STATES * STATES + start * STATES + start;
    v8 largest = splat(SMALL);
    for (int i = 0; i < n; i++) { /* row i of R_g T needs the rows from i on, which are still the old ones */
      for (int j = i; j < n; j++) {
        v8 sum = g ? F[i * STATES + i] * T[i][j] : F[i * STATES + j];
        if (g) for (int k = i + 1; k <= j; k++) sum += F[i * STATES + k] * T[k][j];
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
      P[i][j] = W[(start + i) * STATES + start] * T[0][j];
      for (int k = 1; k <= j; k++) P[i][j] += W[(start + i) * STATES + start + k] * T[k][j];
    }
}

/* Logs of the eigenvalues of P 2^exponent in lane l. */
static int solve_block(v8 P[STATES][STATES], m8 exponent, int start, int stop, int l, double *re, double *im) {
  double a[STATES][STATES];
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
  v8 end[STATES * STATES], W[STATES * STATES], sizes[STATES];
  m8 cut[STATES + 1], sign[STATES], sound;
  cut[0] = cut[STATES] = (m8)(splat(0.0) == splat(0.0));
  for (int sweep = 0;; sweep++) {
    Log log[STATES];
    Reflections last;
    for (int i = 0; i < STATES; i++) { log[i].mantissa = splat(1.0); log[i].exponent = (m8)splat(0.0); sign[i] = (m8)splat(0.0); }
    for (int g = 0; g < G; g++) {
      v8 *T = R + (long)g * STATES * STATES;
      if (g) {
        memcpy(T, F + (long)g * STATES * STATES, sizeof end);
        multiply_right(T, &last);
      } else multiply_states(F, Q, T);
      factor_qr(T, &last);
      for (int i = 0; i < STATES; i++) {
        times(&log[i], v_abs(T[i * STATES + i]));
        sign[i] ^= (m8)T[i * STATES + i];
      }
    }
    for (int i = 0; i < STATES * STATES; i++) {
      W[i] = Q[i % STATES * STATES + i / STATES];
      end[i] = splat(i % (STATES + 1) ? 0.0 : 1.0);
    }
    multiply_right(W, &last);
    multiply_right(end, &last);
    v8 rest = log_det, low, high, wide = splat(0.0);
    for (int i = 0; i < STATES - 1; i++) {
      sizes[i] = v_log(log[i].mantissa) + 0.693147180559945309417 * v_double(log[i].exponent);
      rest -= sizes[i];
    }
    sizes[STATES - 1] = rest;
    low = high = sizes[0];
    for (int i = 1; i < STATES; i++) {
      v8 corner = splat(0.0);
      for (int r = i; r < STATES; r++)
        for (int c = 0; c < i; c++) corner = v_max(corner, v_abs(W[r * STATES + c]));
      cut[i] = (m8)(corner <= accuracy);
      high = v_choose(cut[i], sizes[i], v_max(high, sizes[i]));
      low = v_choose(cut[i], sizes[i], v_min(low, sizes[i]));
      wide = v_max(wide, high - low);
    }
    sound = (m8)(wide <= WIDEST);
    if (sweep + 1 == MAX_SWEEPS || all_lanes(sound)) break;
    memcpy(Q, end, sizeof end);
  }
  for (int start = 0; start < STATES; start++) {
    m8 here = cut[start] & sound;
    for (int stop = start + 1; stop <= STATES; stop++) {
      m8 block = here & cut[stop];
      here &= ~cut[stop];
      if (!any_lane(block)) continue;
      if (stop == start + 1) {
        m8 negative = (sign[start] ^ (m8)W[start * STATES + start]) < 0;
        re[start] = v_choose(block, sizes[start], re[start]);
        im[start] = v_choose(block, v_choose(negative, splat(0.5 * TURN), splat(0.0)), im[start]);
        continue;
      }
      v8 P[STATES][STATES];
      m8 exponent;
      multiply_block(W, R, G, start, stop, P, &exponent);
      for (int l = 0; l < L; l++) {
        double lre[STATES], lim[STATES];
        if (!block[l]) continue;
        if (!solve_block(P, exponent, start, stop, l, lre, lim)) { sound[l] = 0; continue; }
        for (int i = start; i < stop; i++) { re[i][l] = lre[i]; im[i][l] = lim[i]; }
      }
    }
  }
  v8 last_re = log_det, last_im = splat(0.0);
  for (int i = 0; i < STATES - 1; i++) { last_re -= re[i]; last_im -= im[i]; }
  re[STATES - 1] = v_choose(cut[STATES - 1], last_re, re[STATES - 1]);
  im[STATES - 1] = v_choose(cut[STATES - 1], last_im, im[STATES - 1]);
  for (int i = 0; i < STATES; i++) {
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
    for (int i = 0; i < STATES; i++) {
      double x = re[i][l];
      high = fmax(high, x);
      if (x < low) { second = low; low = x; } else second = fmin(second, x);
    }
    widest = fmax(widest, high - second);
  }
  return widest < 0.0 ? INFINITY : widest;
}

