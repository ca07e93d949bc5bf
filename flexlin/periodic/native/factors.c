/* Series of small systems at the times of their segments. */

/* Values of `count` entries of a series, sums of cosines and sines (highest + 1, 2, size), where the waves are those given (highest + 1, 2). */
static inline __attribute__((always_inline)) void add_waves(const int count, int size, int highest, const double *series, const v8 *waves, v8 *values) {
  v8 sum[4];
  for (int e = 0; e < count; e++) sum[e] = splat(0.0);
  for (int k = 0; k <= highest; k++, series += 2 * size)
    for (int e = 0; e < count; e++) sum[e] += series[e] * waves[2 * k] + series[size + e] * waves[2 * k + 1];
  for (int e = 0; e < count; e++) values[e] = sum[e];
}

/* Values (stages, p p) of a series, sums of cosines and sines (highest + 1, 2, p p), at the stages c of eight equal segments from `first` on. */
static void evaluate_series(int size, int highest, const double *series, int first, int segments, int stages, const double *c, v8 *values) {
  v8 waves[2 * highest + 2];
  for (int j = 0; j < stages; j++, values += size) {
    v8 cosine, sine;
    for (int l = 0; l < 8; l++) {
      double angle = 2.0 * M_PI * (first + l + c[j]) / segments;
      cosine[l] = cos(angle);
      sine[l] = sin(angle);
    }
    waves[0] = splat(1.0);
    waves[1] = splat(0.0);
    for (int k = 2; k <= 2 * highest; k += 2) {
      waves[k] = waves[k - 2] * cosine - waves[k - 1] * sine;
      waves[k + 1] = waves[k - 2] * sine + waves[k - 1] * cosine;
    }
    int e = 0;
    for (; e + 4 <= size; e += 4) add_waves(4, size, highest, series + e, waves, values + e);
    for (; e < size; e++) add_waves(1, size, highest, series + e, waves, values + e);
  }
}
