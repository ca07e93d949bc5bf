/* Modes decoupled on one set of nodes, in the coordinates of the states, with what is left and what is not known: the computation of
 * `decouple_on_nodes` in steady.py. */

/* [M D K] (times, m, 3 m) -> A = [[0, 1], [-M^-1 K, -M^-1 D]] (times, 2 m, 2 m), and M^-1 at every `sparse`th time; 0 where M is singular. */
static int sample_companion(int m, int times, int sparse, const double *blocks, double *A, double *inverse) {
  double M[m * m], right[3 * m * m];
  memset(A, 0, 4L * times * m * m * sizeof(double));
  for (int t = 0; t < times; t++, blocks += 3 * m * m, A += 4 * m * m) {
    int columns = t % sparse ? 2 * m : 3 * m;
    for (int i = 0; i < m; i++) {
      A[i * 2 * m + m + i] = 1.0;
      for (int j = 0; j < m; j++) {
        const double *row = blocks + i * 3 * m;
        M[i * m + j] = row[j];
        right[i * columns + j] = -row[2 * m + j];
        right[i * columns + m + j] = -row[m + j];
        if (columns == 3 * m) right[i * columns + 2 * m + j] = i == j;
      }
    }
    if (!eliminate(m, columns, M, right)) return 0;
    for (int i = 0; i < m; i++) {
      memcpy(A + (m + i) * 2 * m, right + i * columns, 2 * m * sizeof(double));
      if (columns == 3 * m) memcpy(inverse + i * m, right + i * columns + 2 * m, m * sizeof(double));
    }
    if (columns == 3 * m) inverse += m * m;
  }
  return 1;
}

/* The largest harmonic of the upper half against the largest of all, as `tail` in waves.py, for A (blocks, n n) at the nodes. */
static double find_tail(int size, int blocks, const Wide *wide, const v8 *A) {
  int nodes = 8 * blocks, half = 4 * wide->width;
  double worst = 0.0, x[LONGEST], zero[LONGEST] = {0};
  for (int e = 0; e < size; e++) {
    v8 re[WIDE], im[WIDE];
    for (int b = 0; b < blocks; b++) *(u8 *)(x + 8 * b) = A[(long)size * b + e];
    int changes = 0;
    for (int t = 1; t < nodes; t++) changes |= x[t] != x[0];
    if (!changes) continue;
    transform(nodes, wide->width, 16 * wide->width, wide->table, x, zero, re, im);
    const double *c = (double *)re, *d = c + half;
    double whole = hypot(c[0], d[0]), moving = 0.0, upper = 0.0;
    for (int k = 1; 2 * k <= nodes; k++) {
      double it = hypot(c[k], d[k]);
      moving = fmax(moving, it);
      if (4 * k >= nodes) upper = fmax(upper, it);
    }
    whole = fmax(whole, moving);
    if (moving > 1e-8 * whole) worst = fmax(worst, upper / whole);
  }
  return worst;
}

typedef struct { double *frame, *inverse, *generator, *residual, *rounding, *mean, *apart; int *partner; } Found;

static const double LASTING = 100.0; /* as in steady.py */

/* Means (n,) of the generator's diagonal, by how much the nodes and the times between them differ in it, and whether that and what is left
 * of the coupling are small beside tol. Where only the latter is not, `partner` keeps the mode that a mode is coupled with if its excess is
 * the part WORST of the largest, else -1.
 *
 * Returns 1 where both are small, 0 where not, -1 where a coupling is so large that more nodes would not part its modes. */
static int judge_means(int n, int blocks, double tol, const Wide *wide, const Side *sides, const Found *f) {
  int nodes = 8 * blocks, settled = 1;
  double excess[n], largest = 0.0;
  for (int i = 0; i < n; i++) {
    double x[LONGEST], y[LONGEST], up[LONGEST], down[LONGEST], re[2] = {0, 0}, im[2] = {0, 0}, *mean = f->mean + 2 * i;
    for (int side = 0; side < 2; side++) {
      take_entry(n * n, blocks, sides[side].B, i * (n + 1), x + side * nodes, y + side * nodes);
      for (int t = side * nodes; t < (side + 1) * nodes; t++) { re[side] += x[t] / nodes; im[side] += y[t] / nodes; }
    }
    find_spectrum(blocks, wide, x, y, up, down);
    mean[0] = (re[0] + re[1]) / 2;
    mean[1] = (im[0] + im[1]) / 2;
    f->apart[i] = fmax(hypot(re[0] - re[1], im[0] - im[1]), find_aliasing(nodes, up, down));
    double allowed = tol * fmax(1.0, fabs(mean[0])), noise = 4 * f->rounding[i * (n + 1)];
    int agree = f->apart[i] < 0.1 * allowed + noise, parted = f->residual[i * (n + 1)] < 0.3 * allowed + noise;
    excess[i] = agree && !parted ? f->residual[i * (n + 1)] / allowed : 0.0;
    largest = fmax(largest, excess[i]);
    settled &= agree && parted;
  }
  for (int i = 0; i < n; i++)
    if (!(excess[i] > 0.0 && excess[i] >= WORST * largest)) f->partner[i] = -1;
  return settled ? 1 : largest > LASTING ? -1 : 0;
}

enum { ROUGH = -1, CLOSE = -2, UNSETTLED = -3, NO_MEMORY = -4 };

typedef struct { v8 *memory, *real, *work; double *numbers, *effects, *allowed; Pair *pairs; Side sides[2]; } Room;

/* Where everything stands: A, five arrays of either side, work; and the numbers of pairs and modes. */
static int take_room(int n, int m, int blocks, Room *r) {
  long size = (long)n * n, whole = 2 * size * blocks, least = 12 * size + 3L * m * m;
  r->memory = aligned_alloc(64, (11 * whole + 2 * (whole > least ? whole : least) + 64) * sizeof(v8));
  r->numbers = malloc(size * (sizeof(Pair) + 3 * sizeof(double)) + n * sizeof(double));
  if (!r->memory || !r->numbers) return 0;
  v8 *at = r->real = r->memory;
  at += whole;
  for (int side = 0; side < 2; side++, at += 5 * whole) r->sides[side] = (Side){at, at + whole, at + 2 * whole, at + 3 * whole, at + 4 * whole};
  r->work = at;
  r->pairs = (Pair *)r->numbers;
  r->effects = (double *)(r->pairs + size);
  r->allowed = r->effects + 3 * size;
  return 1;
}

static Shape take_shape(int n, const int *mate) {
  Shape s = {.n = n};
  for (int i = 0; i < n; i++) {
    s.mate[i] = mate[i];
    if (i <= mate[i]) s.leader[s.leaders++] = i;
  }
  return s;
}

static Found divide_output(int n, int nodes, double *out, int *partner) {
  long size = (long)n * n, whole = 4 * size * nodes;
  double *rest = out + 3 * whole;
  return (Found){out, out + whole, out + 2 * whole, rest, rest + size, rest + 2 * size, rest + 2 * size + 2 * n, partner};
}

/* A at the nodes and between them, in the modes of the mean. */
static void take_samples(const Shape *s, int blocks, const double *A, const double *right, const double *left, Room *r) {
  int size = s->n * s->n;
  for (int side = 1; side >= 0; side--) {
    gather(1, size, 8 * blocks, 2, side, A, r->real);
    for (int b = 0; b < blocks; b++)
      take_to_modes(s, left, r->real + (long)size * b, right, r->sides[side].own + 2L * size * b, r->work);
  }
}

static void give_back(int size, int nodes, const Side *sides, const Found *f) {
  for (int side = 0; side < 2; side++) {
    scatter(size, nodes, 2, side, sides[side].P, f->frame);
    scatter(size, nodes, 2, side, sides[side].inverse, f->inverse);
    scatter(size, nodes, 2, side, sides[side].B, f->generator);
  }
}

/* Decouple A (2 nodes, n, n), every other time of which is a node, from the modes of its mean: values (n,), right and left vectors.
 *
 * limits: enough, shrink, slow, rough, tol, a rounding, what is not known of an entry, the part of it that adds up, how near, and how even; tables: cosines
 * and sines (nodes, 8 width), (most + 1, 2, nodes), the three matrices of `tabulate_waves`, and (2 nodes, 8 wide) of all harmonics.
 * out: frame, inverse and generator (2 nodes, n, n), complex; residual, rounding (n, n); means (n,), complex; apart (n,).
 * partner (n,): where the result is UNSETTLED, or RESONANT (on more nodes too), the mode that each stays coupled with by too much, or -1.
 * Returns the number of rounds, or what is in the way. */
static int decouple_on_nodes(int n, int blocks, int m, int most_rounds, int most, int width, int wide, double w, const double *limits, const double *A,
                      const double *samples, const double *error, const double *mass_inverse, const int *mate, const int *group,
                      const double *values, const double *right, const double *left, const double *tables, double *out, int *partner) {
  int nodes = 8 * blocks, result = ROUGH;
  const double *back = tables + 8L * nodes * width, *between = back + 2L * (most + 1) * nodes, *all = between + 3L * nodes * nodes, tol = limits[4];
  Room r;
  if (!take_room(n, m, blocks, &r)) { free(r.memory); free(r.numbers); return NO_MEMORY; }
  Shape s = take_shape(n, mate);
  Found found = divide_output(n, nodes, out, partner);
  Waves f = {blocks, most, width, tables, back, between, w, limits + 8};
  Wide full = {wide, all};
  Ends ends = {limits[0], limits[1], most_rounds};
  Unknown u = {m, samples, error, mass_inverse, limits[5], limits[6], limits[7]};
  const v8 *B[2] = {r.sides[0].B, r.sides[1].B};
  for (int i = 0; i < n; i++) { partner[i] = -1; r.allowed[i] = tol * fmax(1.0, fabs(values[2 * i])); }
  take_samples(&s, blocks, A, right, left, &r);
  if (!(find_tail(n * n, blocks, &full, r.real) > limits[3])) {
    result = find_coordinates(&s, &f, &ends, group, r.allowed, r.sides, r.sides + 1, r.work, r.effects, partner);
    if (result != RESONANT && (result < 0 || !bound_residual(&s, blocks, w, limits[2], &full, group, B, r.pairs, found.residual, partner))) result = CLOSE;
  }
  if (result >= 0) {
    take_to_states(&s, blocks, group, right, left, r.sides, r.work, found.residual);
    find_rounding(n, blocks, &u, r.real, r.sides, r.work, found.rounding);
    int settled = judge_means(n, blocks, tol, &full, r.sides, &found);
    if (settled < 1) result = settled ? RESONANT : UNSETTLED;
  }
  if (result >= 0) give_back(n * n, nodes, r.sides, &found);
  free(r.memory);
  free(r.numbers);
  return result;
}
