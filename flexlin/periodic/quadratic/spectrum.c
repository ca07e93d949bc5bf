/* Symmetric matrices at equally spaced times of the four parts of a period to their Fourier series, and back: between sweeps.c and
 * running_cost.c.
 *
 * A series is (2 H + 1, E) numbers: the mean, cosines, sines. What the four parts make of wave k depends on k modulo 4 alone, so that each
 * wave takes sums over one part, not over four.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MANY 8      /* entries at a time */
#define FLOOR 2e-16 /* harmonics below this part of the largest are rounding */
#define FEWEST 96   /* times of a period that are looked at, at the least */

typedef double v8 __attribute__((vector_size(64), aligned(8)));

static inline v8 splat_eight(double x) { return (v8){x, x, x, x, x, x, x, x}; }

/* cos(pi i / K), i < 2 K, K even. */
static void tabulate(long K, double *cosines) {
  for (long i = 0; i <= K; i++) cosines[i] = 2 * i > K ? -cosines[K - i] : 2 * i == K ? 0.0 : cos(M_PI * i / K);
  for (long i = 1; i < K; i++) cosines[K + i] = cosines[K - i];
}

/* The series of X (nodes, E) at every so many nodes of each part, `count` in all, a multiple of four; with waves up to H < count / 2. */
static void transform(int E, long count, long every, int H, const double *cosines, const v4 *X, v8 *work, double *series) {
  long q = count / 4;
  v8 *even = work, *minus = even + q, *real = minus + q, *imaginary = real + q;
  for (int first = 0; first < E; first += MANY) {
    int some = E - first < MANY ? E - first : MANY;
    v8 mean = splat_eight(0.0);
    for (long j = 0; j < q; j++)
      for (int e = 0; e < MANY; e++) {
        v4 x = e < some ? X[j * every * E + first + e] - X[first + e][0] : splat(0.0);
        even[j][e] = (x[0] + x[2]) + (x[1] + x[3]);
        minus[j][e] = (x[0] + x[2]) - (x[1] + x[3]);
        real[j][e] = x[0] - x[2];
        imaginary[j][e] = x[1] - x[3];
      }
    for (long j = 0; j < q; j++) mean += even[j];
    for (int e = 0; e < some; e++) series[first + e] = X[first + e][0] + mean[e] / count;
    for (int k = 1; k <= H; k++) {
      const v8 *x = k % 2 ? real : k % 4 ? minus : even;
      double sign = k % 4 == 1 ? 1.0 : -1.0;
      v8 c = splat_eight(0.0), s = c;
      for (long j = 0, cosine = 0, sine = 3 * count / 2; j < q; j++) {
        double u = cosines[cosine], v = cosines[sine];
        c += u * x[j], s += v * x[j];
        if (k % 2) c -= sign * v * imaginary[j], s += sign * u * imaginary[j];
        cosine += 2 * k, cosine -= cosine >= 2 * count ? 2 * count : 0;
        sine += 2 * k, sine -= sine >= 2 * count ? 2 * count : 0;
      }
      for (int e = 0; e < some; e++) {
        series[k * E + first + e] = c[e] * 2 / count;
        series[(H + k) * E + first + e] = s[e] * 2 / count;
      }
    }
  }
}

/* X (many, E) and, where asked for, its slopes at the first `many` of `count` times, or half-way behind them, in each part. */
static void evaluate(int E, long count, long many, int half, double T, int H, const double *cosines, const double *series, v8 *work, v4 *X,
                     v4 *slopes) {
  for (int first = 0; first < E; first += MANY) {
    int some = E - first < MANY ? E - first : MANY;
    v8 *c = work, *s = work + H + 1;
    for (int k = 0; k <= H; k++)
      for (int e = 0; e < MANY; e++) {
        c[k][e] = e < some ? series[k * E + first + e] : 0.0;
        s[k][e] = e < some && k ? series[(H + k) * E + first + e] : 0.0;
      }
    for (long j = 0; j < many; j++) {
      v8 x[4], slope[4]; /* of waves that are the same in all parts, change sign from one to the next, and take quarters of a turn */
      for (int i = 0; i < 4; i++) x[i] = slope[i] = splat_eight(0.0);
      long step = 2 * j + half, cosine = 0, sine = 3 * count / 2;
      for (int k = 1; k <= H; k++) {
        cosine += step, cosine -= cosine >= 2 * count ? 2 * count : 0;
        sine += step, sine -= sine >= 2 * count ? 2 * count : 0;
        double u = cosines[cosine], v = cosines[sine], rate = 2 * M_PI / T * k, sign = k % 4 == 1 ? 1.0 : -1.0;
        v8 wave = u * c[k] + v * s[k], turned = u * s[k] - v * c[k];
        if (k % 2) {
          x[2] += wave, x[3] += sign * turned;
          slope[2] += rate * turned, slope[3] -= sign * rate * wave;
        } else x[k % 4 / 2] += wave, slope[k % 4 / 2] += rate * turned;
      }
      x[0] += c[0];
      for (int e = 0; e < some; e++) {
        long to = j * E + first + e;
        X[to] = (v4){x[0][e] + x[1][e] + x[2][e], x[0][e] - x[1][e] + x[3][e], x[0][e] + x[1][e] - x[2][e], x[0][e] - x[1][e] - x[3][e]};
        if (slopes)
          slopes[to] = (v4){slope[0][e] + slope[1][e] + slope[2][e], slope[0][e] - slope[1][e] + slope[3][e],
                            slope[0][e] + slope[1][e] - slope[2][e], slope[0][e] - slope[1][e] - slope[3][e]};
      }
    }
  }
}

/* Room for `count` times: first cosines (2 count), then work; none where there is no memory. */
static double *find_room(long count, v8 **work) {
  double *cosines = malloc(2 * count * sizeof(double) + (count + MANY) * sizeof(v8));
  if (!cosines) return 0;
  *work = (v8 *)(cosines + 2 * count);
  tabulate(count, cosines);
  return cosines;
}

/* The largest amplitude of wave k. */
static double find_amplitude(int E, int H, int k, const double *series) {
  double square = 0.0;
  for (int e = 0; e < E; e++) {
    double c = series[k * E + e], s = k ? series[(H + k) * E + e] : 0.0;
    square = fmax(square, c * c + s * s);
  }
  return sqrt(square);
}

/* The series of X (nodes, E) by as few of its nodes as show all waves above tol, every so many; without waves that are rounding. Returns the
 * highest wave, -1 where there is no memory. */
static int fold(int E, long nodes, double tol, const v4 *X, double *series, long *every) {
  *every = 1;
  while (nodes % (2 * *every) == 0 && 4 * nodes / (2 * *every) >= FEWEST) *every *= 2;
  for (;; *every /= 2) {
    long count = 4 * nodes / *every;
    int H = count / 3 - 1, keep = 0;
    double size[H + 1], largest = 0.0, last = 0.0, left = 0.0, *cosines;
    v8 *work;
    if (!(cosines = find_room(count, &work))) return -1;
    transform(E, count, *every, H, cosines, X, work, series);
    free(cosines);
    for (int k = 0; k <= H; k++) {
      size[k] = find_amplitude(E, H, k, series) * (k ? 0.5 : 1.0);
      largest = fmax(largest, size[k]);
    }
    for (int k = H; k > keep; k--) {
      left += size[k] * size[k];
      if (sqrt(left) > FLOOR * largest) keep = k;
    }
    for (int k = count / 4; k <= keep; k++) last = fmax(last, 2 * size[k]);
    if (*every > 1 && last > tol * size[0]) continue;
    memmove(series + (keep + 1) * E, series + (H + 1) * E, (size_t)keep * E * sizeof(double));
    return keep;
  }
}
