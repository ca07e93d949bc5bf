/* Exponents of a whole system of second order from few factors of its period: the computation of whole.py. */
enum { OK = 0, NOT_APART = 1, MIXES = 2, NOT_TAME = 3, COUPLED = 4, WILD = 5, SINGULAR = 6, LACKING = 7 };
enum { LOOK = 8, COUNTS = 2, SPARSE = 4, MEMORY = 1 << 26 }; /* nodes of a first look; M^-1 at every so many times; bytes of a group */

typedef struct {
  double closeness[2], parted, mixed, largest, spread, safety, hidden;
  double decoupling[14]; /* limits of `decouple_on_nodes` */
  double following[10], bounding[6]; /* of `follow_group`, `bound_group` */
  double series_in_the_mean, sure, step[4]; /* of `bound_unknown`, `bound_group`, `count_segments` */
} Numbers;

typedef struct {
  int n, m, H, most_rounds, joins, counts, nodes[COUNTS], least, stages, more, first_whole, most_whole;
  const double *bases[COUNTS], *tables[COUNTS], *series, *error, *tableaus;
  double period;
  Geev *geev;
  const Numbers *numbers;
} Problem; /* m: coordinates behind the states, or 0; bases (2 nodes, 2 H + 1): waves of the series (2 H + 1, entries); tableaus: c, a, a a, b
 * of the stages, then of `more` beyond */


/* Logs (size,) made conjugate or real exactly where the multipliers are, and errors that conjugates share. */
static void settle_conjugates(int size, const z *multipliers, z *logs, double *errors) {
  double off[size];
  memcpy(off, errors, size * sizeof(double));
  for (int i = 0; i < size; i++)
    if (cimag(multipliers[i]) < 0.0) logs[i] = conj(logs[i - 1]);
    else if (cimag(multipliers[i]) == 0.0) logs[i] = creal(logs[i]) + I * (creal(multipliers[i]) < 0.0 ? M_PI : 0.0);
  for (int i = 0; i < size; i++) {
    int mate = i;
    for (int j = 0; j < size; j++)
      if (cabs(conj(logs[i]) - logs[j]) < cabs(conj(logs[i]) - logs[mate])) mate = j;
    errors[i] = fmax(off[i], off[mate]);
  }
}

/* An imaginary part of a log in (-pi, pi]. */
static double wrap_angle(double angle) {
  double near = angle - 2 * M_PI * ceil(angle / (2 * M_PI) - 0.5);
  return near > M_PI ? near - 2 * M_PI : near <= -M_PI ? near + 2 * M_PI : near;
}

/* Exponents (n,) by falling real part, imaginary parts in (-pi / T, pi / T], and their errors, both in that order. */
static void sort_exponents(int n, double period, const z *values, const double *off, z *exponents, double *errors) {
  for (int i = 0; i < n; i++) {
    z value = creal(values[i]) + I * wrap_angle(cimag(values[i]) * period) / period;
    int k = i;
    for (; k > 0 && creal(exponents[k - 1]) < creal(value); k--) { exponents[k] = exponents[k - 1]; errors[k] = errors[k - 1]; }
    exponents[k] = value;
    errors[k] = off[i];
  }
}

/* The series (2 H + 1, entries), mean, cosines and sines, as cosine and sine of each harmonic (H + 1, 2, entries). */
static void pair_waves(int H, int entries, const double *series, double *pairs) {
  memcpy(pairs, series, entries * sizeof(double));
  memset(pairs + entries, 0, entries * sizeof(double));
  for (int k = 1; k <= H; k++) {
    memcpy(pairs + 2L * k * entries, series + (long)k * entries, entries * sizeof(double));
    memcpy(pairs + (2L * k + 1) * entries, series + ((long)H + k) * entries, entries * sizeof(double));
  }
}

static const double LOSS = 16.0 * ACCURATE; /* roundings that factors may miss by: what they did shows between two rules */

/* Transition matrices (segments, n, n) of M y'' + D y' + K y = 0 from the series of [M D K]; 0 where rounding grew by too much, -1 where there is
 * no memory. */
static int factor_period(int m, int H, const double *pairs, int segments, int stages, double length, const double *tableau, double *F) {
  Rule r = {m, stages, tableau, tableau + stages, tableau + stages + stages * stages, tableau + stages + 2 * stages * stages};
  Bench bench;
  int entries = 3 * m * m, done = 1;
  if (!take_bench(m, stages, &bench)) return -1;
  for (int k = 0; k < segments && done; k += 8) {
    int count = segments - k < 8 ? segments - k : 8;
    double d[m], M[m * m];
    evaluate_series(entries, H, pairs, k, segments, stages, r.c, bench.blocks);
    for (int i = 0; i < m; i++)
      for (int j = 0; j < m; j++) M[i * m + j] = bench.blocks[i * 3 * m + j][0];
    choose_units(m, m, M, d);
    for (int e = 0; e < stages * entries; e++) bench.blocks[e] *= d[e % entries / (3 * m)] * d[e % m];
    v8 off = factor_together(&r, count, splat(length), d, LOSS, &bench, F + 4L * m * m * k);
    for (int l = 0; l < count; l++) done &= off[l] <= LOSS;
  }
  free(bench.memory);
  return done;
}

/* Units (n,), powers of two, in which the rows and columns of a matrix (n, n) of sizes are even, as LAPACK's dgebal; the sizes are lost. */
static void even_units(int n, double *sizes, double *units) {
  for (int i = 0; i < n; i++) units[i] = 1.0;
  for (int pass = 0, moved = 1; pass < 32 && moved; pass++) {
    moved = 0;
    for (int i = 0; i < n; i++) {
      double row = 0.0, column = 0.0;
      for (int j = 0; j < n; j++)
        if (j != i) { row += sizes[i * n + j]; column += sizes[j * n + i]; }
      double factor = exp2(round(0.5 * log2(row / column)));
      if (!(row > 0.0 && column > 0.0) || !(column * factor + row / factor < 0.95 * (row + column))) continue;
      for (int j = 0; j < n; j++)
        if (j != i) { sizes[i * n + j] /= factor; sizes[j * n + i] *= factor; }
      units[i] *= factor;
      moved = 1;
    }
  }
}

/* What is not known of A in each segment, times its length h, in the units given, (segments, n, n); [M D K] at the middles of eight segments in
 * `values`. 0 where M is singular. */
static int bound_unknown(const Problem *p, const double *pairs, int segments, const double *units, v8 *values, double *unknown) {
  int n = p->n, m = p->m, entries = 3 * m * m;
  double middle = 0.5, h = p->period / segments, eps = p->numbers->bounding[3], known[entries], own[entries], M[m * m], right[3 * m * m];
  memset(unknown, 0, (long)segments * n * n * sizeof(double));
  for (int k = 0; k < segments; k++, unknown += n * n) {
    if (k % 8 == 0) evaluate_series(entries, p->H, pairs, k, segments, 1, &middle, values);
    for (int e = 0; e < entries; e++) {
      own[e] = values[e][k % 8];
      known[e] = eps * fabs(own[e]) + p->numbers->series_in_the_mean * p->error[e];
    }
    for (int i = 0; i < m; i++)
      for (int j = 0; j < m; j++) { /* M^-1 [K D 1] */
        M[i * m + j] = own[i * 3 * m + j];
        right[i * 3 * m + j] = own[i * 3 * m + 2 * m + j];
        right[i * 3 * m + m + j] = own[i * 3 * m + m + j];
        right[i * 3 * m + 2 * m + j] = i == j;
      }
    if (!eliminate(m, 3 * m, M, right)) return 0;
    for (int q = 0; q < m; q++)
      for (int c = 0; c < 2 * m; c++) { /* |dM| |M^-1 [K D]| + |[dK dD]| */
        double sum = known[q * 3 * m + (c < m ? 2 * m + c : c)];
        for (int j = 0; j < m; j++) sum += known[q * 3 * m + j] * fabs(right[j * 3 * m + c]);
        for (int i = 0; i < m; i++) unknown[(m + i) * n + c] += fabs(right[i * 3 * m + 2 * m + q]) * sum;
      }
    for (int e = 0; e < n * n; e++) unknown[e] *= h * units[e % n] / units[e / n];
  }
  return 1;
}

/* Factors (2, segments, n, n) of the period, the second better, in units in which they are even (n,); as `factor_period`. */
static int factor_evenly(const Problem *p, const double *pairs, int segments, double *factors, double *units) {
  int n = p->n, size = n * n, done = 1;
  double sizes[size];
  const double *tableau = p->tableaus;
  for (int pass = 0, s = p->stages; pass < 2 && done == 1; tableau += 2 * s + 2 * s * s, pass++, s += p->more)
    done = factor_period(p->m, p->H, pairs, segments, s, p->period / segments, tableau, factors + (long)pass * segments * size);
  for (int e = 0; e < size; e++) sizes[e] = 0.0;
  for (long e = 0; e < (long)segments * size && done == 1; e++) sizes[e % size] += fabs(factors[e]);
  even_units(n, sizes, units);
  for (long e = 0; e < 2L * segments * size && done == 1; e++) factors[e] *= units[e % n] / units[e % size / n];
  return done;
}

/* Exponents (n,) and errors by so many segments; OK, WILD where that does not serve, or LACKING. */
static int follow_whole(const Problem *p, const double *pairs, int segments, z *exponents, double *errors) {
  int n = p->n, size = n * n, strong;
  double method, *memory = malloc((3L * segments * size + 2L * n) * sizeof(double)), *unknown = memory + 2L * segments * size;
  double *units = unknown + (long)segments * size, *off = units + n;
  z *vectors = malloc(((segments + 1L) * size + 2L * n) * sizeof(z)), *back = vectors + size, *own = back + (long)segments * size, *logs = own + n;
  v8 *middles = aligned_alloc(64, 3L * p->m * p->m * sizeof(v8));
  int done = memory && vectors && middles ? factor_evenly(p, pairs, segments, memory, units) : -1;
  if (done == 1) done = bound_unknown(p, pairs, segments, units, middles, unknown);
  if (done == 1) done = find_bands(p->geev, n, segments, memory, exp(p->numbers->spread), own, vectors, back, &strong);
  if (done == 1)
    done = bound_group(n, segments, memory, p->numbers->sure, 1, unknown, size, p->numbers->bounding, vectors, back, strong, logs, off, &method);
  if (done == 1) {
    settle_conjugates(n, own, logs, off);
    for (int i = 0; i < n; i++) { logs[i] /= p->period; off[i] /= p->period; }
    sort_exponents(n, p->period, logs, off, exponents, errors);
  }
  free(memory);
  free(vectors);
  free(middles);
  return done < 0 ? LACKING : done ? OK : WILD;
}

/* Exponents (n,) of a system of second order by falling real part and their errors (n,) to tol, where at most so many segments do, given eigenvalues of the mean of A (n,);
 * segments: that were taken. OK, WILD where that does not serve, or LACKING. */
static int find_whole(const Problem *p, const z *mean, int most, z *exponents, double *errors, int *segments) {
  int n = p->n, entries = 3 * p->m * p->m, result = WILD;
  double rate = 2 * M_PI / p->period, growth[n], tol = p->numbers->decoupling[4];
  const double *step = p->numbers->step; /* error of a step, stages twice, waves for each stage, and how much finer the second try is */
  for (int i = 0; i < n; i++) {
    rate = fmax(rate, cabs(mean[i]));
    growth[i] = creal(mean[i]) * p->period;
  }
  double wanted = p->period * rate / pow(tol * fmax(1.0, rate) / (rate * step[0]), 1.0 / step[1]);
  wanted = fmax(fmax(p->least, ceil(wanted)), ceil(step[2] * p->H));
  if (!(p->m && wanted <= most && are_in_bands(n, growth, p->numbers->spread))) return WILD;
  double *pairs = malloc((2L * p->H + 2) * entries * sizeof(double));
  if (!pairs) return LACKING;
  pair_waves(p->H, entries, p->series, pairs);
  for (int again = 0; again < 2 && wanted <= most; again++, wanted = ceil(step[3] * wanted)) {
    *segments = (int)wanted;
    result = follow_whole(p, pairs, *segments, exponents, errors);
    int reached = result == OK;
    for (int i = 0; i < n && reached; i++) reached = errors[i] <= tol * fmax(1.0, cabs(exponents[i]));
    if (result != OK || reached) break;
    result = WILD;
  }
  free(pairs);
  return result;
}
