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

/* The highest harmonic that is more than rounding. */
static int find_highest(int size, int highest, const double *series) {
  double largest = 0.0;
  for (int e = 0; e < (2 * highest + 2) * size; e++) largest = fmax(largest, fabs(series[e]));
  for (; highest > 0; highest--)
    for (int e = 2 * highest * size; e < (2 * highest + 2) * size; e++)
      if (!(fabs(series[e]) <= 1e-17 * largest)) return highest;
  return 0;
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

/* Factors of a group over at most `most` equal segments and better ones, each (most + 1, p, p) in `out`; their product after them, and what
 * is not known of the generator (p, p).
 *
 * rules: c, a, b of the stages, then of `more` stages beyond; limits: step and fastest.
 * Returns the number of segments, 0 where the group is too fast for so many, -1 where there is no memory. */
static int follow_group(int n, int start, int p, int blocks, int wide, const double *table, const double *generator, double period, int least, int most,
                        int stages, int more, const double *rules, const double *limits, double *out, double *alias) {
  int nodes = 8 * blocks, size = p * p, segments = least, done = 0;
  double *memory = malloc((2L * (nodes + 1) * size + size) * sizeof(double));
  if (!memory) return -1;
  double *series = memory, *work = series + 2L * (nodes + 1) * size;
  Wide all = {wide, table};
  double rate = take_series(n, start, p, blocks, &all, generator, series, alias) * period;
  if (rate < limits[1]) {
    double wanted = ceil(rate / limits[0]);
    segments = wanted > least ? (int)wanted : least;
    done = segments <= most;
  }
  long whole = (most + 1L) * size;
  double *product = out + 2 * whole;
  int highest = find_highest(size, nodes, series);
  for (int pass = 0, s = stages; pass < 2 && done == 1; rules += 2 * s + s * s, pass++, s += more)
    done = factor_group(p, highest, series, segments, s, period / segments, rules, out + pass * whole);
  if (done == 1) memcpy(product, out, size * sizeof(double));
  for (int k = 1; k < segments && done == 1; k++) {
    multiply_real(p, out + k * size, product, work);
    memcpy(product, work, size * sizeof(double));
  }
  free(memory);
  return done < 0 ? -1 : done ? segments : 0;
}
