/* A smooth periodic function by its Fourier series, from its values at equally spaced times, held against values between these and a period
 * later: what `resolve` in resolved/resolve.py finds at its first attempt. */
#include "core.h"

#define HEARD 4 /* roundings of the largest value below which all harmonics are those of the sums here */

/* Cosine and sine coefficients (H, entries) each of values (nodes, entries) without the first ones, H = (nodes - 1) / 2; waves (nodes, 2 H). */
static void transform_values(int nodes, int entries, const double *values, const double *waves, double *cosines, double *mean, double *sums) {
  int H = (nodes - 1) / 2;
  double *sines = cosines + (long)H * entries, *differences = sums + entries;
  for (long e = 0; e < 2L * H * entries; e++) cosines[e] = 0.0;
  for (int e = 0; e < entries; e++) mean[e] = 0.0;
  for (int t = 1; 2 * t <= nodes; t++) { /* with its mirror image about the middle of the period */
    const double *x = values + (long)t * entries, *y = values + (long)(nodes - t) * entries;
    int middle = 2 * t == nodes;
    for (int e = 0; e < entries; e++) {
      double a = x[e] - values[e], b = middle ? 0.0 : y[e] - values[e];
      sums[e] = a + b;
      differences[e] = a - b;
      mean[e] += sums[e];
    }
    for (int k = 0; k < H; k++) {
      double c = waves[2 * H * t + k] * 2 / nodes, s = middle ? 0.0 : waves[2 * H * t + H + k] * 2 / nodes;
      double *to = cosines + (long)k * entries, *and = sines + (long)k * entries;
      for (int e = 0; e < entries; e++) { to[e] += c * sums[e]; and[e] += s * differences[e]; }
    }
  }
  for (int e = 0; e < entries; e++) mean[e] = values[e] + mean[e] / nodes;
}

/* The largest deviation of the series of `kept` harmonics from values (checks, entries). */
static void find_deviation(int checks, int H, int kept, int entries, const double *waves, const double *there, const double *mean,
                           const double *cosines, double *fit, double *deviation) {
  for (int e = 0; e < entries; e++) deviation[e] = 0.0;
  for (int t = 0; t < checks; t++, there += entries) {
    for (int e = 0; e < entries; e++) fit[e] = 0.0;
    for (int k = 0; k < kept; k++) {
      double c = waves[2 * H * t + k], s = waves[2 * H * t + H + k];
      const double *a = cosines + (long)k * entries, *b = a + (long)H * entries;
      for (int e = 0; e < entries; e++) fit[e] += c * a[e] + s * b[e];
    }
    for (int e = 0; e < entries; e++) {
      double off = fabs(fit[e] + mean[e] - there[e]);
      deviation[e] = off <= deviation[e] ? deviation[e] : off;
    }
  }
}

/* How small an entry of [M D K] (n, 3 n) may be before rounding of its neighbours hides it: as `weigh_entries` in weights.py; size (n, 3 n): the
 * largest over some times. */
static void weigh_entries(int n, double hidden, const double *size, double *least) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double m = sqrt(size[i * 3 * n + i]) * sqrt(size[j * 3 * n + j]);
      double k = sqrt(size[i * 3 * n + 2 * n + i]) * sqrt(size[j * 3 * n + 2 * n + j]), all[3] = {m, sqrt(m * k), k};
      for (int c = 0; c < 3; c++) {
        double across = fmax(size[j * 3 * n + c * n + i], all[c]);
        least[i * 3 * n + c * n + j] = across > 0.0 ? hidden * all[c] * (all[c] / across) : 0.0;
      }
    }
}

/* The sizes below which no entry counts, from values (probes, entries) of [M D K] with m coordinates; 0 for others; size (entries,): room. */
static void find_least(int probes, int entries, int m, double hidden, const double *values, double *size, double *least) {
  for (int e = 0; e < entries; e++) least[e] = size[e] = 0.0;
  if (!m) return;
  for (int t = 0; t < probes; t++)
    for (int e = 0; e < entries; e++) size[e] = fmax(size[e], fabs(values[(long)t * entries + e]));
  weigh_entries(m, hidden, size, least);
}

/* values: at the nodes, at the times between them that check, at some times one period later, and at the probes; sizes: how many there are of
 * each, entries, and the coordinates behind [M D K] or 0; waves: at the nodes, at the checks and at the later times; numbers: tol, eps, the least
 * number, the factor on the largest deviation, what a period later may differ by of an entry's size, and HIDDEN of weights.py.
 *
 * coefficients: (2 kept + 1, entries), the mean first, in an array for all harmonics; bounds: allowed, error, sizes of the entries. Returns how
 * many harmonics are kept, -1 where the series does not agree, -2 where there is no memory. */
CALLED int fit_series(const int *sizes, const double *values, const double *waves, const double *between, const double *later, const double *numbers,
               double *coefficients, double *bounds) {
  int nodes = sizes[0], checks = sizes[1], repeats = sizes[2], probes = sizes[3], entries = sizes[4];
  const double *there = values + (long)nodes * entries, *beyond = there + (long)checks * entries;
  double factor = numbers[3], *scale = bounds + 2L * entries;
  int H = (nodes - 1) / 2, last = H / 4 > 4 ? H / 4 : 4, kept = 0;
  double *mean = coefficients, *cosines = mean + entries, *allowed = bounds, *error = bounds + entries, tol = numbers[0], eps = numbers[1];
  double *work = malloc(((long)H + 4) * entries * sizeof(double)), *size = work + 4L * entries, *rounding = work + 2L * entries, *tail = work + 3L * entries;
  if (!work) return -2;
  find_least(probes, entries, sizes[5], numbers[5], beyond + (long)repeats * entries, work, scale);
  for (int t = 0; t < nodes; t++)
    for (int e = 0; e < entries; e++) scale[e] = fmax(scale[e], fabs(values[(long)t * entries + e]));
  transform_values(nodes, entries, values, waves, cosines, mean, work);
  for (int e = 0; e < entries; e++) rounding[e] = tail[e] = 0.0;
  for (int k = 0; k < H; k++)
    for (int e = 0; e < entries; e++) {
      double a = cosines[(long)k * entries + e], b = cosines[((long)H + k) * entries + e];
      size[(long)k * entries + e] = sqrt(a * a + b * b);
      rounding[e] += 2 * M_PI * eps * (k + 1) * size[(long)k * entries + e];
    }
  int good = 1;
  for (int e = 0; e < entries; e++) {
    allowed[e] = fmax(tol * scale[e] + numbers[2], fmin(rounding[e], 1e-6 * scale[e]));
    for (int k = H - last; k < H; k++) {
      good &= size[(long)k * entries + e] <= allowed[e] / 4;
      tail[e] += 2 * size[(long)k * entries + e];
    }
    double floor = fmax(HEARD * eps * scale[e], rounding[e] / 8) + numbers[2], left = 0.0;
    for (int k = H; k > kept; k--) {
      double part = size[(long)(k - 1) * entries + e] / floor;
      left += part * part;
      if (left > 1.0) kept = k;
    }
  }
  if (good) find_deviation(checks, H, kept, entries, between, there, mean, cosines, work, error);
  for (int t = 0; t < checks && good; t++)
    for (int e = 0; e < entries; e++) scale[e] = fmax(scale[e], fabs(there[(long)t * entries + e]));
  for (int e = 0; e < entries && good; e++) {
    good &= error[e] <= 2 * allowed[e];
    error[e] = factor * error[e] + tail[e] + rounding[e] + 4 * eps * scale[e];
  }
  if (good) find_deviation(repeats, H, kept, entries, later, beyond, mean, cosines, work, tail);
  for (int e = 0; e < entries && good; e++) good &= tail[e] <= numbers[4] * scale[e] + 4 * allowed[e];
  for (long e = 0; e < (long)kept * entries && kept < H; e++) cosines[(long)kept * entries + e] = cosines[(long)H * entries + e];
  free(work);
  return good ? kept : -1;
}
