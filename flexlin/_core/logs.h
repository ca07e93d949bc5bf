/* Logs of the eigenvalues of a product of factors, L products at a time, by cyclic QR sweeps
 * F_k Q_k = Q_(k+1) R_k,   W = Q_0' Q_K,   product ~ W R_(K-1) ... R_0,
 * from Q_0 := Q_K again until clean cuts of W leave clusters of narrow spread. The weakest eigenvalue, which the rounding of the others hides, is
 * what they leave of the determinant. Source: Watkins, Product eigenvalue problems, SIAM Review 47 (2005). */
#ifndef FLEXLIN_LOGS_H
#define FLEXLIN_LOGS_H

#include "eigenvalues.h"
#include "exponential.h"

enum { MAX_SWEEPS = 8 };
static const double WIDEST = 9.2, TURN = 6.283185307179586476925;

typedef struct { vec v[S][S], beta[S]; } Reflections; /* Q = H_0 H_1 ..., H_j = I - beta_j v_j v_j' */

/* A = Q R; A becomes R. */
static void factor_qr(vec *R, Reflections *Q) {
  for (int j = 0; j < S - 1; j++) {
    vec size = splat(TINY), *v = Q->v[j];
    for (int i = j; i < S; i++) size += R[i * S + j] * R[i * S + j];
    size = v_sqrt(size);
    vec signed_size = v_copysign(size, R[j * S + j]);
    for (int i = j; i < S; i++) v[i] = R[i * S + j];
    v[j] += signed_size;
    vec beta = Q->beta[j] = 1.0 / (size * v_abs(v[j]));
    R[j * S + j] = -signed_size;
    for (int i = j + 1; i < S; i++) R[i * S + j] = splat(0.0);
    for (int c = j + 1; c < S; c++) {
      vec dot = splat(0.0);
      for (int i = j; i < S; i++) dot += v[i] * R[i * S + c];
      dot *= beta;
      for (int i = j; i < S; i++) R[i * S + c] -= v[i] * dot;
    }
  }
}

/* A Q in place of A. */
static void multiply_right(vec *A, const Reflections *Q) {
  for (int j = 0; j < S - 1; j++)
    for (int r = 0; r < S; r++) {
      vec dot = splat(0.0), *row = A + r * S;
      for (int i = j; i < S; i++) dot += row[i] * Q->v[j][i];
      dot *= Q->beta[j];
      for (int i = j; i < S; i++) row[i] -= dot * Q->v[j][i];
    }
}

typedef struct { /* log of a growing product of positive numbers: log(mantissa) + exponent log 2 */
  vec mantissa;
  mask exponent;
} Log;

static void times(Log *log, vec factor) {
  log->mantissa *= v_max(factor, splat(TINY));
  mask bits = (mask)log->mantissa;
  log->exponent += (bits >> 52) - 1023;
  log->mantissa = (vec)((bits & 0xfffffffffffffLL) | 0x3ff0000000000000LL);
}

/* The diagonal block [start, stop) of W R_(G-1) ... R_0 as P 2^exponent, in all lanes. */
static void multiply_block(const vec *W, const vec *R, int G, int start, int stop, vec P[S][S], mask *exponent) {
  vec T[S][S];
  int n = stop - start;
  *exponent = no_lanes();
  for (int g = 0; g < G; g++) {
    const vec *F = R + (long)g * S * S + start * S + start;
    vec largest = splat(TINY);
    for (int i = 0; i < n; i++) { /* row i of R_g T needs the rows from i on, which are still the old ones */
      for (int j = i; j < n; j++) {
        vec sum = g ? F[i * S + i] * T[i][j] : F[i * S + j];
        if (g) for (int k = i + 1; k <= j; k++) sum += F[i * S + k] * T[k][j];
        T[i][j] = sum;
      }
      largest = v_max(largest, v_abs(T[i][i]));
    }
    mask e = (((mask)largest >> 52) & 0x7ff) - 1023; /* far from over- and underflow, by a power of two */
    vec scale = (vec)((1023 - e) << 52);
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

/* Logs (re, im) of the eigenvalues of F_(G-1) ... F_0 by cyclic QR sweeps from Q; returns in which lanes they were found soundly. */
static mask find_logs(const vec *F, vec *R, int G, vec log_det, double accuracy, vec *Q, vec *re, vec *im) {
  vec end[S * S], W[S * S], sizes[S];
  mask cut[S + 1], sound;
  cut[0] = cut[S] = every_lane();
  for (int sweep = 0;; sweep++) {
    Log logs[S];
    Reflections last = {0};
    for (int i = 0; i < S; i++) { logs[i].mantissa = splat(1.0); logs[i].exponent = no_lanes(); }
    for (int g = 0; g < G; g++) {
      vec *T = R + (long)g * S * S;
      if (g) {
        memcpy(T, F + (long)g * S * S, sizeof end);
        multiply_right(T, &last);
      } else multiply(F, Q, T);
      factor_qr(T, &last);
      for (int i = 0; i < S; i++) times(&logs[i], v_abs(T[i * S + i]));
    }
    for (int i = 0; i < S * S; i++) {
      W[i] = Q[i % S * S + i / S];
      end[i] = splat(i % (S + 1) ? 0.0 : 1.0);
    }
    multiply_right(W, &last);
    multiply_right(end, &last);
    vec rest = log_det, low, high, wide = splat(0.0);
    for (int i = 0; i < S - 1; i++) {
      for (int l = 0; l < L; l++) sizes[i][l] = log(logs[i].mantissa[l]) + 0.693147180559945309417 * (double)logs[i].exponent[l];
      rest -= sizes[i];
    }
    sizes[S - 1] = rest;
    low = high = sizes[0];
    for (int i = 1; i < S; i++) {
      vec corner = splat(0.0);
      for (int r = i; r < S; r++)
        for (int c = 0; c < i; c++) corner = v_max(corner, v_abs(W[r * S + c]));
      cut[i] = (mask)(corner <= accuracy);
      high = v_choose(cut[i], sizes[i], v_max(high, sizes[i]));
      low = v_choose(cut[i], sizes[i], v_min(low, sizes[i]));
      wide = v_max(wide, high - low);
    }
    sound = (mask)(wide <= WIDEST);
    if (sweep + 1 == MAX_SWEEPS || all_lanes(sound)) break;
    memcpy(Q, end, sizeof end);
  }
  for (int start = 0; start < S; start++) {
    mask here = cut[start] & sound;
    for (int stop = start + 1; stop <= S; stop++) {
      mask block = here & cut[stop];
      here &= ~cut[stop];
      if (!any_lane(block)) continue;
      vec P[S][S], x[S], y[S];
      mask exponent;
      multiply_block(W, R, G, start, stop, P, &exponent);
      sound &= find_eigenvalues(stop - start, P, block, x, y) | ~block;
      for (int i = start; i < stop; i++)
        for (int l = 0; l < L; l++) {
          if (!block[l]) continue;
          const double p = x[i - start][l], q = y[i - start][l];
          re[i][l] = 0.5 * log(fmax(p * p + q * q, TINY)) + exponent[l] * 0.693147180559945309417;
          im[i][l] = q != 0.0 ? atan2(q, p) : p < 0.0 ? 0.5 * TURN : 0.0;
        }
    }
  }
  vec last_re = log_det, last_im = splat(0.0);
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
static double measure_spread(const vec *re, mask sound) {
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

#endif
