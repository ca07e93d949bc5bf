/* A real group of modes that grow and decay by little against each other: the computation of tame.py. */

/* Real p x p blocks from `start` on of the generator (times, n, n), complex, without the mean of their diagonal: their Fourier series, sums of
 * cosines and sines (times / 2 + 1, 2, p p), and the largest norm; alias (p, p): what missing harmonics may add to the entries. */
static double take_series(int n, int start, int p, int blocks, const Wide *wide, const double *generator, double *series, double *alias) {
  int nodes = 8 * blocks, half = 4 * wide->width, size = p * p;
  double norm[LONGEST] = {0}, trace[LONGEST] = {0}, zero[LONGEST] = {0}, x[LONGEST], up[LONGEST], down[LONGEST], largest = 0.0;
  for (int t = 0; t < 2 * nodes; t++)
    for (int i = start; i < start + p; i++) trace[t] += generator[2 * (((long)t * n + i) * n + i)] / p;
  for (int e = 0; e < size; e++) {
    int row = start + e / p, column = start + e % p;
    v8 even[WIDE], odd[WIDE], none[WIDE];
    for (int pass = 0; pass < 2; pass++) { /* with the trace, for the aliasing; then without it */
      for (int t = 0; t < 2 * nodes; t++)
        x[t / 2 + (t % 2 ? nodes : 0)] = generator[2 * (((long)t * n + row) * n + column)] - (pass && row == column ? trace[t] : 0.0);
      if (!pass) {
        find_spectrum(blocks, wide, x, zero, up, down);
        alias[e] = find_aliasing(nodes, up, down);
      }
    }
    for (int t = 0; t < 2 * nodes; t++) norm[t] += x[t] * x[t];
    transform(nodes, wide->width, 16 * wide->width, wide->table, x, zero, even, none);
    transform(nodes, wide->width, 16 * wide->width, wide->table + 8 * wide->width, x + nodes, zero, odd, none);
    for (int k = 0; k < wide->width; k++) even[k] += odd[k];
    for (int k = 0; k <= nodes; k++) {
      double factor = (k > 0 && k < nodes ? 2.0 : 1.0) / (2 * nodes);
      series[(2 * k) * size + e] = factor * ((double *)even)[k];
      series[(2 * k + 1) * size + e] = k ? factor * ((double *)even)[half + k] : 0.0;
    }
  }
  for (int t = 0; t < 2 * nodes; t++) largest = norm[t] <= largest ? largest : norm[t];
  return sqrt(largest);
}

/* The highest harmonic that is kept: those above it add up to less than the part `hidden` of what is not known of every entry, unknown (p, p), to
 * which they are added. As `fit_group` in group_factors.py. */
static int find_highest(int size, int highest, const double *series, double hidden, double *unknown) {
  double beyond[size], next[size];
  for (int e = 0; e < size; e++) beyond[e] = 0.0;
  for (; highest > 0; highest--) {
    int hide = 1;
    for (int e = 0; e < size; e++) {
      next[e] = beyond[e] + hypot(series[2 * highest * size + e], series[(2 * highest + 1) * size + e]);
      hide &= next[e] <= hidden * unknown[e];
    }
    if (!hide) break;
    memcpy(beyond, next, size * sizeof(double));
  }
  for (int e = 0; e < size; e++) unknown[e] += beyond[e];
  return highest;
}

static double measure_size(int size, const double *A) {
  double sum = 0.0;
  for (int e = 0; e < size; e++) sum += A[e] * A[e];
  return sqrt(sum);
}

static void multiply_real(int p, const double *A, const double *B, double *C) {
  for (int i = 0; i < p; i++)
    for (int j = 0; j < p; j++) {
      double sum = 0.0;
      for (int k = 0; k < p; k++) sum += A[i * p + k] * B[k * p + j];
      C[i * p + j] = sum;
    }
}

/* Segments (a multiple of 8) in which a group turns by less than `step`, 0 where it is faster than `fastest`; norm: of its generator. */
static int count_group_segments(double norm, double period, const double *limits) {
  return norm * period < limits[1] ? 8 * (int)fmax(1.0, ceil(norm * period / limits[0] / 8)) : 0;
}

/* Factors (p, p) of a group over equal segments, of `fine` times so many parts each, and the same of `coarse` times as many. 0 where there is no
 * memory. */
static int follow_group(int p, int highest, const double *series, double period, int segments, int parts, const double *limits, double *out) {
  for (int pass = 0; pass < 2; pass++)
    if (!factor_magnus(p, highest, series, segments, (int)limits[7 + pass] * parts, period, out + (long)pass * segments * p * p)) return 0;
  return 1;
}

/* Whether modes stand in two bands of their growth (n,), each narrower than `width`. */
static int are_in_bands(int n, const double *growth, double width) {
  double low = INFINITY, high = -INFINITY;
  for (int i = 0; i < n; i++) { low = fmin(low, growth[i]); high = fmax(high, growth[i]); }
  for (int i = 0; i < n; i++)
    if (!(growth[i] - low < width || high - growth[i] < width)) return 0;
  return 1;
}
