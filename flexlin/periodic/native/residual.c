/* What the coupling that is left may do to each block: the computation of `bound_residual` in steady.py. */
enum { WIDE = 18, LONGEST = 128 }; /* v8 of cosines and sines up to half of 128 times, which are nodes and times half-way between them */

typedef struct { int width; const double *table; } Wide; /* (2 nodes, 8 width): cosines, then sines, of the harmonics 0 ... nodes */

/* |F_k| and |F_-k| for k = 0 ... nodes, of a number at the nodes and then at the times between them. */
static void find_spectrum(int blocks, const Wide *w, const double *re, const double *im, double *up, double *down) {
  int nodes = 8 * blocks, row = 8 * w->width, half = 4 * w->width;
  v8 even_re[WIDE], even_im[WIDE], odd_re[WIDE], odd_im[WIDE];
  transform(nodes, w->width, 2 * row, w->table, re, im, even_re, even_im);
  transform(nodes, w->width, 2 * row, w->table + row, re + nodes, im + nodes, odd_re, odd_im);
  for (int k = 0; k < w->width; k++) { even_re[k] += odd_re[k]; even_im[k] += odd_im[k]; }
  const double *c = (double *)even_re, *d = (double *)even_im, *sc = c + half, *sd = d + half;
  for (int k = 0; k <= nodes; k++) {
    double a = c[k] + sd[k], b = d[k] - sc[k], e = c[k] - sd[k], f = d[k] + sc[k];
    up[k] = sqrt(a * a + b * b) / (2 * nodes);
    down[k] = sqrt(e * e + f * f) / (2 * nodes);
  }
}

/* What harmonics beyond the times may add: four times the largest of the top quarter, as `aliasing` in waves.py. */
static double find_aliasing(int nodes, const double *up, const double *down) {
  double most = 0.0;
  for (int k = 0; k <= nodes; k++)
    if (8 * k > 6 * nodes) most = fmax(most, fmax(up[k], down[k]));
  return 4.0 * most;
}

/* The lesser of the two bounds of `combined` in coupling.py. */
static double combine(double second, double first, double oblique, double swing, double slow) {
  double damped = second == 0.0 ? 0.0 : second * oblique, smooth = second / (1.0 - slow) + first * swing;
  return damped < smooth ? damped : smooth;
}

typedef struct { double mean_re, mean_im, away, damped, run; } Mode;

/* Mean, largest deviation from it, and how far its real part carries within the period; x, y at the nodes and then between them. */
static Mode measure_mode(int nodes, double period, const double *x, const double *y) {
  Mode m = {0, 0, 0, 0, 0};
  for (int t = 0; t < 2 * nodes; t++) { m.mean_re += x[t] / (2 * nodes); m.mean_im += y[t] / (2 * nodes); }
  double sum = 0.0, low = INFINITY, high = -INFINITY;
  for (int t = 0; t < 2 * nodes; t++) {
    int at = t / 2 + (t % 2 ? nodes : 0);
    double moved = x[at] - m.mean_re;
    m.away = fmax(m.away, hypot(moved, y[at] - m.mean_im));
    m.damped = fmax(m.damped, fabs(moved));
    sum += moved;
    low = fmin(low, sum);
    high = fmax(high, sum);
  }
  m.run = (high - low) * period / (2 * nodes);
  return m;
}

typedef struct { double size, high, gap, oblique, swing; } Pair;

static const double NARROWED = 0.7, CLOSED = 1e-3; /* as in steady.py */

/* The sizes of all entries of the generator B and what is known of its diagonal. */
static void measure_generator(const Shape *s, int blocks, double period, const v8 *B[2], Pair *pairs, Mode *modes) {
  int n = s->n, nodes = 8 * blocks;
  double x[LONGEST], y[LONGEST];
  for (int q = 0; q < s->leaders; q++)
    for (int i = s->leader[q], k = s->mate[i], j = 0; j < n; j++) {
      v8 most = splat(0.0);
      for (int side = 0; side < 2; side++) {
        take_entry(n * n, blocks, B[side], i * n + j, x + side * nodes, y + side * nodes);
        for (int b = 0; b < blocks; b++) {
          v8 re = B[side][2 * n * n * b + i * n + j], im = B[side][2 * n * n * b + n * n + i * n + j], square = re * re + im * im;
          for (int l = 0; l < 8; l++) most[l] = square[l] <= most[l] ? most[l] : square[l];
        }
      }
      double largest = 0.0;
      for (int l = 0; l < 8; l++) largest = most[l] <= largest ? largest : most[l];
      pairs[i * n + j].size = pairs[k * n + s->mate[j]].size = sqrt(largest);
      if (i != j) continue;
      modes[k] = modes[i] = measure_mode(nodes, period, x, y);
      if (k != i) modes[k].mean_im = -modes[i].mean_im;
    }
}

/* The least distance of two entries of the diagonal on straight lines between neighbouring times, as `nearest_on_chords` in coupling.py. */
static double find_least_gap(int n, int blocks, const v8 *B[2], int i, int j) {
  int nodes = 8 * blocks;
  double x[LONGEST], y[LONGEST], other_x[LONGEST], other_y[LONGEST], least = INFINITY;
  for (int side = 0; side < 2; side++) {
    take_entry(n * n, blocks, B[side], i * (n + 1), x + side * nodes, y + side * nodes);
    take_entry(n * n, blocks, B[side], j * (n + 1), other_x + side * nodes, other_y + side * nodes);
  }
  for (int t = 0; t < 2 * nodes; t++) { x[t] -= other_x[t]; y[t] -= other_y[t]; }
  for (int t = 0; t < 2 * nodes; t++) {
    int at = t % 2 ? nodes + t / 2 : t / 2, next = t % 2 ? (t / 2 + 1) % nodes : nodes + t / 2;
    double dx = x[next] - x[at], dy = y[next] - y[at], length = fmax(dx * dx + dy * dy, 2.2e-308);
    double part = fmin(fmax(-(x[at] * dx + y[at] * dy) / length, 0.0), 1.0);
    least = fmin(least, hypot(x[at] + part * dx, y[at] + part * dy));
  }
  return least;
}

/* Gaps of the modes that are not in one group, from below; 0 where one may close. */
static int separate_modes(int n, int blocks, const int *group, const v8 *B[2], Mode *modes, Pair *pairs) {
  double inner[n];
  for (int i = 0; i < n; i++) {
    inner[i] = 0.0;
    for (int j = 0; j < n; j++)
      if (j != i && group[i] == group[j]) inner[i] += pairs[i * n + j].size;
  }
  for (int i = 0; i < n; i++) { modes[i].away += inner[i]; modes[i].damped += inner[i]; }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      Pair *p = pairs + i * n + j;
      Mode a = modes[i], b = modes[j];
      p->high = 0.0;
      p->oblique = INFINITY;
      p->swing = exp(fmin(a.run + b.run, 600.0));
      if (group[i] == group[j]) { p->size = 0.0; p->gap = INFINITY; continue; }
      double mean = hypot(a.mean_re - b.mean_re, a.mean_im - b.mean_im);
      p->gap = mean - a.away - b.away;
      if (p->gap < NARROWED * mean) p->gap = fmax(p->gap, find_least_gap(n, blocks, B, i, j) - inner[i] - inner[j]);
      if (!(p->gap > CLOSED * mean)) return 0;
      double parted = fabs(a.mean_re - b.mean_re) - a.damped - b.damped;
      if (parted > 0.0) p->oblique = p->gap / parted;
    }
  return 1;
}

/* Bound what elimination of the coupling adds to each block, (n, n), and the mode that adds most to each (n,); 0: no bound. */
static int bound_residual(const Shape *s, int blocks, double w, double slow, const Wide *wide, const int *group, const v8 *B[2], Pair *pairs,
                          double *total, int *partner) {
  int n = s->n, nodes = 8 * blocks;
  Mode modes[n];
  measure_generator(s, blocks, 2.0 * M_PI / w, B, pairs, modes);
  if (!separate_modes(n, blocks, group, B, modes, pairs)) return 0;
  for (int q = 0; q < s->leaders; q++)
    for (int i = s->leader[q], j = 0; j < n; j++) {
      double x[LONGEST], y[LONGEST], up[LONGEST], down[LONGEST], sum = 0.0, least = slow * pairs[i * n + j].gap;
      if (group[i] == group[j] || nodes * w < least) continue;
      for (int side = 0; side < 2; side++) take_entry(n * n, blocks, B[side], i * n + j, x + side * nodes, y + side * nodes);
      find_spectrum(blocks, wide, x, y, up, down);
      for (int k = 0; k <= nodes; k++)
        if (k * w >= least) sum += up[k] + (k > 0 && k < nodes ? down[k] : 0.0);
      pairs[i * n + j].high = pairs[s->mate[i] * n + s->mate[j]].high = sum;
    }
  for (int k = 0; k < n; k++)
    for (int l = 0; l < n; l++) {
      double sum = 0.0, most = 0.0;
      if (group[k] == group[l])
        for (int j = 0; j < n; j++) {
          Pair a = pairs[k * n + j], b = pairs[j * n + l];
          double part = combine(a.size * b.size / b.gap, sqrt(a.high * b.high), a.oblique, a.swing, slow);
          sum += part;
          if (l == k && part > most) { most = part; partner[k] = j; }
        }
      total[k * n + l] = sum;
    }
  return 1;
}
