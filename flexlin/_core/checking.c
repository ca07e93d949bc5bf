/* The largest sizes of many samples, and the largest deviation of a Fourier series from them: what a check of a resolution looks at. */
#include "lanes.h"

/* out (entries,): the largest sizes of rows (count, entries), no numbers where a sample is none. Returns 0 where there is no memory. */
CALLED int find_sizes(long count, int entries, const double *rows, double *out) {
  v8 *sizes = aligned_alloc(64, entries * sizeof(v8)), none = splat(0.0);
  if (!sizes) return 0;
  for (int e = 0; e < entries; e++) sizes[e] = splat(0.0);
  long whole = count / 8 * entries; /* eights of numbers, eight rows at a time */
  for (long at = 0; at < whole; at += entries)
    for (int e = 0; e < entries; e++) {
      v8 x = *(const u8 *)(rows + 8 * (at + e));
      sizes[e] = larger(sizes[e], x);
      none += 0.0 * x; /* no number where x is none, or infinite */
    }
  for (int e = 0; e < entries; e++) out[e] = 0.0;
  const double *seen = (const double *)sizes;
  for (int i = 0; i < 8 * entries; i++) out[i % entries] = fmax(out[i % entries], seen[i]);
  double bad = 0.0;
  for (int l = 0; l < 8; l++) bad += none[l];
  for (long i = 8 * whole; i < count * entries; i++) {
    double *size = out + i % entries;
    *size = fmax(*size, fabs(rows[i]));
    bad += 0.0 * rows[i];
  }
  for (int e = 0; e < entries && bad != 0.0; e++) out[e] = NAN;
  free(sizes);
  return 1;
}

/* exp(i k x) for k = 1 ... H at eight times, cosines and then sines, from cos x and sin x. */
static void make_waves(int H, v8 cosine, v8 sine, v8 *waves) {
  v8 x = cosine, y = sine;
  for (int k = 0; k < H; k++) {
    waves[k] = x;
    waves[H + k] = y;
    v8 turned = x * cosine - y * sine;
    y = x * sine + y * cosine;
    x = turned;
  }
}

/* The largest deviations of eight entries at eight times: values `row` numbers apart, coefficients (2 H, `wide` apart) and waves there. */
static v8 compare_eight(int H, int wide, int row, v8 mean, const v8 *coefficients, const v8 *waves, const double *values, v8 most) {
  v8 fit[8];
  for (int l = 0; l < 8; l++) fit[l] = splat(0.0);
  for (int k = 0; k < 2 * H; k++, coefficients += wide) {
    const double *wave = (const double *)(waves + k);
    for (int l = 0; l < 8; l++) fit[l] += wave[l] * coefficients[0];
  }
  for (int l = 0; l < 8; l++) most = larger(most, fit[l] + (mean - *(const u8 *)(values + l * row)));
  return most;
}

/* Coefficients (count, entries) by eights of columns, the last of which end with the entries; whether an eight has any that are not zero. */
static void take_eights(int count, int entries, int wide, const double *from, v8 *to, int *any) {
  for (int w = 0; w < wide; w++) {
    int first = 8 * w < entries - 8 ? 8 * w : entries > 8 ? entries - 8 : 0, some = entries < 8 ? entries : 8;
    any[w] = 0;
    for (int k = 0; k < count; k++) {
      to[k * wide + w] = splat(0.0);
      for (int l = 0; l < some; l++) {
        to[k * wide + w][l] = from[(long)k * entries + first + l];
        any[w] |= from[(long)k * entries + first + l] != 0.0;
      }
    }
  }
}

/* worst (entries,): made the largest deviation of a series, coefficients (2 H + 1, entries), from values (count, entries) at times where
 * the first waves are cosines, sines (count,). Returns 0 where there is no memory. */
CALLED int compare_series(long count, int entries, int H, const double *cosines, const double *sines, const double *coefficients, const double *values,
                   double *worst) {
  int wide = (entries + 7) / 8, moving[wide];
  v8 *memory = aligned_alloc(64, ((2L * H + 2) * wide + 2 * H + entries + 1) * sizeof(v8));
  if (!memory) return 0;
  v8 *mean = memory, *most = mean + wide, *waves = most + wide, *ordered = waves + 2 * H;
  double *spare = (double *)(ordered + 2L * H * wide);
  take_eights(1, entries, wide, coefficients, mean, moving);
  take_eights(2 * H, entries, wide, coefficients + entries, ordered, moving);
  for (int w = 0; w < wide; w++) most[w] = splat(0.0);
  for (long t = 0; t < count; t += 8) {
    const double *from = values + t * entries;
    v8 c, s;
    for (int l = 0; l < 8; l++) {
      long at = t + l < count ? t + l : count - 1; /* the last time again where there are fewer */
      c[l] = cosines[at];
      s[l] = sines[at];
      if (t + 16 > count) memcpy(spare + l * entries, values + at * entries, entries * sizeof(double)); /* eights may reach beyond the end */
    }
    if (t + 16 > count) from = spare;
    make_waves(H, c, s, waves);
    for (int w = 0; w < wide; w++) {
      int first = 8 * w < entries - 8 ? 8 * w : entries > 8 ? entries - 8 : 0;
      most[w] = compare_eight(moving[w] ? H : 0, wide, entries, mean[w], ordered + w, waves, from + first, most[w]);
    }
  }
  for (int e = 0; e < entries; e++) {
    int w = e / 8, first = 8 * w < entries - 8 ? 8 * w : entries > 8 ? entries - 8 : 0;
    worst[e] = fmax(worst[e], most[w][e - first]);
  }
  free(memory);
  return 1;
}
