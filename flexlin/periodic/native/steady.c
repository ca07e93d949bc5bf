/* Exponents of a system of which A(t) mixes the modes of its mean by little: the computation of steady.py, tame.py and exponents.py. */

typedef struct { double *A, *blocks, *inverse; } Samples;

static int count_wide(int nodes) { return 2 * ((nodes + 8) / 8); }
static int count_width(int nodes) { return (nodes / 3 + 4) / 4; }

/* A at N nodes and half-way between them, from the series; of second order by way of [M D K]. */
static int take_period(const Problem *p, int which, Samples *s) {
  int times = 2 * p->nodes[which], n = p->n, m = p->m, entries = m ? 3 * m * m : n * n, waves = 2 * p->H;
  s->A = malloc((long)times * n * n * sizeof(double));
  s->blocks = m ? malloc((long)times * entries * sizeof(double)) : 0;
  s->inverse = m ? malloc((long)times / SPARSE * m * m * sizeof(double)) : 0;
  if (!s->A || (m && (!s->blocks || !s->inverse))) return LACKING;
  double *values = m ? s->blocks : s->A;
  for (int t = 0; t < times; t++) {
    const double *wave = p->bases[which] + (long)t * (waves + 1) + 1;
    double *row = values + (long)t * entries;
    for (int e = 0; e < entries; e++) row[e] = 0.0;
    for (int k = 0; k < waves; k++)
      for (int e = 0; e < entries; e++) row[e] += wave[k] * p->series[(k + 1L) * entries + e];
    for (int e = 0; e < entries; e++) row[e] += p->series[e];
  }
  return !m || sample_companion(m, times, SPARSE, s->blocks, s->A, s->inverse) ? OK : SINGULAR;
}

/* Put modes together that stay coupled by too much, or resonate: as `try_joining` in steady.py; the modes are left as they were where that does
 * not serve. spare: room for them. */
static int try_joining(const Problem *p, Modes *m, Modes *spare, const int *partner, z *work) {
  copy_modes(m, spare);
  if (join_modes(m, partner, work) && may_be_tame(m, p->period, p->numbers->spread)) return 1;
  copy_modes(spare, m);
  return 0;
}

enum { FEW_STATES = 16 }; /* as in steady.py */

/* Decouple, with modes put together that resonate or stay coupled by too much; where that does not serve, on more nodes: as in steady.py.
 *
 * rooms: for two sets of modes; out, partner: as of `decouple_on_nodes`; which: the nodes it ended on. Returns the rounds, or minus what is in
 * the way. */
static int part_modes(const Problem *p, Samples *samples, Modes *m, Modes *rooms, double *out, int *partner, z *work, int *which) {
  const Numbers *number = p->numbers;
  Modes *begun = rooms, *spare = rooms + 1;
  copy_modes(m, begun);
  for (int at = 0, joins = 0;;) {
    int nodes = p->nodes[at], coupled = 0;
    *which = at;
    if (!samples[at].A) {
      int taken = take_period(p, at, samples + at);
      if (taken != OK) return -taken;
    }
    int rounds = decouple_on_nodes(p->n, nodes / 8, p->m, p->most_rounds, nodes / 3, count_width(nodes), count_wide(nodes), 2 * M_PI / p->period,
                                   number->decoupling, samples[at].A, samples[at].blocks, p->error, samples[at].inverse, m->mate, m->label,
                                   (double *)m->values, (double *)m->right, (double *)m->left, p->tables[at], out, partner);
    if (rounds >= 0) return rounds;
    if (rounds == NO_MEMORY) return -LACKING;
    for (int i = 0; i < p->n && (rounds == UNSETTLED || rounds == RESONANT); i++) coupled |= partner[i] >= 0;
    if (coupled && joins < p->joins && try_joining(p, m, spare, partner, work)) {
      if (rounds == RESONANT) copy_modes(m, begun);
      joins++;
      continue;
    }
    int untame = coupled && joins < p->joins;
    if (at == p->counts - 1 || (untame && rounds == RESONANT && p->n > FEW_STATES)) return untame ? -NOT_TAME : -COUPLED;
    copy_modes(begun, m);
    at++;
    joins = 0;
  }
}

/* Eigenvalues and right vectors of the mean of A at a few nodes. */
static int look_at_mean(const Problem *p, Samples *samples, Modes *m) {
  int n = p->n, step = 2 * p->nodes[0] / LOOK, taken = take_period(p, 0, samples);
  double mean[n * n];
  for (int e = 0; e < n * n && taken == OK; e++) {
    mean[e] = 0.0;
    for (int t = 0; t < LOOK; t++) mean[e] += samples[0].A[(long)t * step * n * n + e] / LOOK;
  }
  return taken != OK ? taken : find_eigenvectors(p->geev, n, mean, m->values, m->right) ? OK : NOT_APART;
}

/* Group the modes of the mean, first in few groups, and decouple them; as `part_modes`. rooms: for three sets of modes. */
static int decouple_steady(const Problem *p, Samples *samples, Modes *m, Modes *rooms, double *out, int *partner, z *work, int *which) {
  int n = p->n, before[n], answer = MIXES, step = 2 * p->nodes[0] / LOOK;
  double w = 2 * M_PI / p->period;
  const Numbers *number = p->numbers;
  copy_modes(m, rooms + 2);
  for (int i = 0; i < n; i++) before[i] = -1;
  for (int k = 0; k < 2; k++) {
    copy_modes(rooms + 2, m);
    if (!group_modes(w / number->closeness[k], number->parted * w, number->largest, m, work)) return -NOT_APART;
    if (!may_be_tame(m, p->period, number->spread)) return -NOT_TAME;
    if (!memcmp(before, m->label, n * sizeof(int)) || find_mixing(m, 2 * p->nodes[0], step, samples[0].A, work) > number->mixed) continue;
    memcpy(before, m->label, n * sizeof(int));
    int rounds = part_modes(p, samples, m, rooms, out, partner, work, which);
    if (rounds != -COUPLED) return rounds;
    answer = COUPLED;
  }
  return -answer;
}

/* Logs (p,) of the multipliers of a group and their errors (p,), by Magnus series as finely as `allowed` asks: as `tame_exponents`. norm: of the
 * generator; unknown (p, p): what is not known of it. OK, WILD or LACKING. */
static int follow_tame(const Problem *p, int size, int highest, const double *series, double norm, const double *unknown, double allowed, z *values,
                       double *errors) {
  const double *limits = p->numbers->following; /* step, fastest, growth, waves, aim, largest, tries, fine, coarse, share */
  int segments = count_group_segments(norm, p->period, limits), square = size * size, strong, done = -1;
  if (!segments || 16L * segments * square > MEMORY) return WILD;
  double method, part[square], turns = p->period * norm + 2 * M_PI * limits[3];
  double wanted = turns * pow(limits[2] * turns / (limits[4] * allowed), 1.0 / 6.0);
  double *factors = malloc(2L * segments * square * sizeof(double));
  z *vectors = malloc(((segments + 1L) * square + size) * sizeof(z)), *back = vectors + square, *own = back + (long)segments * square;
  for (int e = 0; e < square; e++) part[e] = p->period / segments * unknown[e];
  for (int again = 0; again < limits[6] && factors && vectors; again++) {
    int parts = (int)fmax(1.0, ceil(wanted / (limits[7] * segments)));
    done = follow_group(size, highest, series, p->period, segments, parts, limits, factors) ? 1 : -1;
    if (done == 1) done = find_bands(p->geev, size, segments, factors, exp(p->numbers->spread), own, vectors, back, &strong);
    if (done == 1)
      done = bound_group(size, segments, factors, limits[9], (int)limits[7] * parts, part, 0, p->numbers->bounding, vectors, back, strong,
                         values, errors, &method);
    if (done != 1 || method < limits[5] * allowed) break;
    wanted = limits[7] * parts * segments * pow(method / (limits[4] * allowed), 1.0 / 6.0);
  }
  if (done == 1) settle_conjugates(size, own, values, errors);
  free(factors);
  free(vectors);
  return done < 0 ? LACKING : done ? OK : WILD;
}

/* Logs of the multipliers of a real group and their errors, from first on; unknown (n, n): what is not known of the generator; middle: the mean of its
 * real parts. */
static int find_group(const Problem *p, int nodes, const double *generator, int first, int size, const double *unknown, double middle, z *values,
                      double *errors) {
  int wide = count_wide(nodes), square = size * size;
  const double *all = p->tables[nodes == p->nodes[0] ? 0 : 1] + 8L * nodes * count_width(nodes) + 2L * (nodes / 3 + 1) * nodes + 3L * nodes * nodes;
  double *series = malloc((2L * (nodes + 1) + 1) * square * sizeof(double)), *own = series + 2L * (nodes + 1) * square;
  if (!series) return LACKING;
  Wide full = {wide, all};
  double norm = take_series(p->n, first, size, nodes / 8, &full, generator, series, own);
  for (int e = 0; e < square; e++) own[e] += p->numbers->safety * unknown[(first + e / size) * p->n + first + e % size];
  int highest = find_highest(square, nodes, series, p->numbers->hidden, own);
  double allowed = p->numbers->decoupling[4] * p->period * fmax(1.0, fabs(middle));
  int done = follow_tame(p, size, highest, series, norm, own, allowed, values + first, errors + first);
  free(series);
  return done;
}

/* Exponents (n,) by falling real part and their errors (n,) of what was decoupled. */
static int find_exponents(const Problem *p, int nodes, const Modes *m, const Found *f, z *exponents, double *errors) {
  int n = p->n;
  double off[n], unknown[n * n];
  z values[n], *mean = (z *)f->mean;
  for (int e = 0; e < n * n; e++) unknown[e] = f->residual[e] + f->rounding[e];
  for (int i = 0; i < n; i++) { values[i] = mean[i]; off[i] = f->apart[i] + p->numbers->safety * unknown[i * (n + 1)]; }
  for (int i = 0, size; i < n; i += size) {
    for (size = 1; i + size < n && m->label[i + size] == m->label[i]; size++) {}
    if (size == 1) {
      if (m->mate[i] > i) off[i] = off[m->mate[i]] = fmax(off[i], off[m->mate[i]]);
      if (m->mate[i] == i) values[i] = creal(values[i]);
      continue;
    }
    double middle = 0.0;
    for (int k = i; k < i + size; k++) middle += creal(mean[k]) / size;
    int done = find_group(p, nodes, f->generator, i, size, unknown, middle, values, off);
    if (done != OK) return done;
    for (int k = i; k < i + size; k++) { values[k] = middle + values[k] / p->period; off[k] /= p->period; }
  }
  sort_exponents(n, p->period, values, off, exponents, errors);
  return OK;
}

/* The largest entry of the diagonal of a generator (times, n, n), and how far two of its real parts carry within the period at most. */
static void look_at_diagonal(int n, int times, const z *generator, double period, double *out) {
  double largest = 0.0, first = 0.0, second = 0.0;
  for (int i = 0; i < n; i++) {
    double mean = 0.0, sum = 0.0, low = INFINITY, high = -INFINITY;
    for (int t = 0; t < times; t++) {
      z entry = generator[((long)t * n + i) * n + i];
      mean += creal(entry) / times;
      largest = fmax(largest, creal(entry) * creal(entry) + cimag(entry) * cimag(entry));
    }
    for (int t = 0; t < times; t++) {
      sum += creal(generator[((long)t * n + i) * n + i]) - mean;
      low = fmin(low, sum);
      high = fmax(high, sum);
    }
    double run = (high - low) * period / times;
    second = fmax(second, fmin(run, first));
    first = fmax(first, run);
  }
  out[0] = sqrt(largest);
  out[1] = first + second;
}

/* Exponents (n,) and errors by decoupling; nodes: the nodes taken; about: as of `solve_at_once`. */
static int solve_decoupled(const Problem *p, Samples *samples, Modes *m, Modes *rooms, z *work, int *nodes, double *out, z *exponents, double *errors,
                           double *about) {
  int n = p->n, partner[n], which = 0, rounds = decouple_steady(p, samples, m, rooms, out, partner, work, &which);
  about[0] = rounds;
  nodes[0] = p->nodes[which];
  if (rounds < 0) return -rounds;
  Found found = divide_output(n, nodes[0], out, partner);
  look_at_diagonal(n, 2 * nodes[0], (z *)found.generator, p->period, about + 1);
  return find_exponents(p, nodes[0], m, &found, exponents, errors);
}

/* Exponents (n,), complex, and errors (n,) of a Fourier series: of the whole where few segments do, else by decoupling.
 *
 * sizes: n, m, H, most rounds, joins, how many `nodes` there are; of the whole: least segments, stages, how many more check them, most segments
 * before decoupling and after it; nodes: and which were taken; out: as of `decouple_on_nodes`, for the most nodes; places
 * (3 n,): mates, groups, partners of groups; about: the rounds, or minus the segments of the whole; the fastest rate; and by how much two modes
 * may grow against each other within the period. Returns what is in the way, or 0. */
int solve_at_once(const int *sizes, int *nodes, double period, void *geev, const double *numbers, const double *series, const double *error,
                 const double *first_basis, const double *second_basis, const double *first_tables, const double *second_tables, const double *tableaus,
                 double *out, int *places, double *exponents, double *errors, double *about) {
  Problem p = {sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5], {nodes[0], nodes[1]}, sizes[6], sizes[7], sizes[8], sizes[9],
               sizes[10], {first_basis, second_basis}, {first_tables, second_tables}, series, error, tableaus, period, (Geev *)geev,
               (const Numbers *)numbers};
  int n = p.n, more[9 * n], segments = 0, result = LACKING;
  long each = 2L * n * n + n;
  Samples samples[COUNTS] = {{0, 0, 0}, {0, 0, 0}};
  z *memory = malloc((4 * each + 3L * n * n + 2 * n) * sizeof(z)), *work = memory + 4 * each, *mean = work + 3 * n * n + n;
  char *together = malloc((long)n * n);
  if (memory && together) {
    Modes m = take_modes(n, places, memory, together), rooms[3];
    for (int k = 0; k < 3; k++) rooms[k] = take_modes(n, more + 3 * k * n, memory + (k + 1) * each, together);
    result = look_at_mean(&p, samples, &m);
    if (result == OK) {
      memcpy(mean, m.values, n * sizeof(z));
      int whole = find_whole(&p, mean, p.first_whole, (z *)exponents, errors, &segments);
      if (whole == WILD) result = solve_decoupled(&p, samples, &m, rooms, work, nodes, out, (z *)exponents, errors, about);
      if (result >= NOT_APART && result <= WILD) whole = find_whole(&p, mean, p.most_whole, (z *)exponents, errors, &segments);
      if (whole != WILD) {
        result = whole;
        about[0] = -segments;
        about[1] = about[2] = 0.0;
        for (int i = 0; i < n; i++) about[1] = fmax(about[1], cabs(mean[i]));
      }
    }
  }
  for (int k = 0; k < COUNTS; k++) { free(samples[k].A); free(samples[k].blocks); free(samples[k].inverse); }
  free(memory);
  free(together);
  return result;
}
