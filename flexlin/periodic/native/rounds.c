/* Rounds of decoupling for modes whose shapes hardly change, eight nodes of the period at a time: the computation of coordinates.py. */
enum { WIDEST = 8 }; /* v8 of cosines and sines of 64 nodes, up to a third of them */

/* One step S of an entry: S_k = R_k / (i k w - gap) for the harmonics k <= most whose divisor is large enough, and its slope.
 *
 * returns the root mean square of what is left of R; largest: of |S|; stuck: the root mean square of what is left for its divisor. */
static double take_step(int blocks, int most, int width, const double *forth, const double *back, double w, double gap_re, double gap_im,
                        double least, const double *x, const double *y, v8 *re, v8 *im, v8 *slope_re, v8 *slope_im, double *largest, double *stuck) {
  int nodes = 8 * blocks;
  double left = 0.0, near = 0.0;
  v8 fr[WIDEST], fi[WIDEST];
  transform(nodes, width, 8 * width, forth, x, y, fr, fi);
  for (int t = 0; t < nodes; t++) left += (x[t] * x[t] + y[t] * y[t]) / nodes;
  double *c = (double *)fr, *d = (double *)fi, *sr = c + 4 * width, *si = d + 4 * width;
  for (int b = 0; b < blocks; b++) re[b] = im[b] = slope_re[b] = slope_im[b] = splat(0.0);
  for (int k = 0; k <= most; k++) {
    double pr[2], pi[2];
    for (int side = 0; side < (k ? 2 : 1); side++) { /* exp(i k w t), then exp(-i k w t) */
      double sign = side ? -1.0 : 1.0;
      double hr = (c[k] + sign * si[k]) / nodes, hi = (d[k] - sign * sr[k]) / nodes;
      double er = -gap_re, ei = sign * k * w - gap_im, size = er * er + ei * ei;
      if (size > least * least) {
        left -= hr * hr + hi * hi;
        pr[side] = (hr * er + hi * ei) / size;
        pi[side] = (hi * er - hr * ei) / size;
      } else {
        near += hr * hr + hi * hi;
        pr[side] = pi[side] = 0.0;
      }
    }
    if (k == 0) pr[1] = pi[1] = 0.0;
    /* p exp(i phi) + q exp(-i phi) = (p + q) cos phi + i (p - q) sin phi */
    double ur = pr[0] + pr[1], ui = pi[0] + pi[1], vr = -(pi[0] - pi[1]), vi = pr[0] - pr[1], kw = k * w;
    for (int b = 0; b < blocks; b++) {
      v8 cosine = *(const u8 *)(back + 8 * ((2 * k) * blocks + b)), sine = *(const u8 *)(back + 8 * ((2 * k + 1) * blocks + b));
      re[b] += ur * cosine + vr * sine;
      im[b] += ui * cosine + vi * sine;
      slope_re[b] += kw * (vr * cosine - ur * sine);
      slope_im[b] += kw * (vi * cosine - ui * sine);
    }
  }
  double most_square = 0.0;
  for (int b = 0; b < blocks; b++) {
    v8 square = re[b] * re[b] + im[b] * im[b];
    for (int l = 0; l < 8; l++) most_square = square[l] > most_square ? square[l] : most_square;
  }
  *largest = sqrt(most_square);
  *stuck = sqrt(near);
  return sqrt(left > 0.0 ? left : 0.0);
}

typedef struct { int blocks, most, width; const double *forth, *back, *between; double w; const double *near; } Waves;

/* How close a harmonic may come to the gap of two modes whose deviations from their means are `away` in sum. */
static double find_nearest(const Waves *f, double gap, double away) {
  return fmin(f->near[0] * gap, fmax(f->near[1] * away, f->near[2] * f->w));
}

/* How far each entry of the diagonal goes from its mean, and what its group adds to it. */
static void measure_deviations(int n, int blocks, const int *group, const v8 *B, const double *mean_re, const double *mean_im, double *away) {
  for (int i = 0; i < n; i++) {
    away[i] = 0.0;
    for (int j = 0; j < n; j++) {
      if (group[i] != group[j]) continue;
      v8 most = splat(0.0);
      for (int b = 0; b < blocks; b++) {
        long at = 2L * n * n * b + i * n + j;
        v8 x = B[at] - (i == j ? mean_re[i] : 0.0), y = B[at + n * n] - (i == j ? mean_im[i] : 0.0), square = x * x + y * y;
        for (int l = 0; l < 8; l++) most[l] = square[l] <= most[l] ? most[l] : square[l];
      }
      double largest = 0.0;
      for (int l = 0; l < 8; l++) largest = most[l] <= largest ? largest : most[l];
      away[i] += sqrt(largest);
    }
  }
}

/* Whether two modes are parted by the gap of each time: as `keeps_apart` in coordinates.py. */
static int keeps_apart(const Waves *f, double least, double mean) {
  return least > f->near[3] * mean || (least > f->near[5] * mean && least > f->near[4] * f->w);
}

/* R gap / g(t), g the difference of the modes' entries on the diagonal and gap its mean: then S = -R / g for what is slow. */
static void follow_gap(const Waves *f, int n, const v8 *B, int i, int j, double gr, double gi, double *x, double *y) {
  int size = n * n, blocks = f->blocks;
  double least = INFINITY;
  v8 dr[8], di[8], over[8];
  for (int b = 0; b < blocks; b++) {
    const v8 *D = B + 2L * size * b;
    dr[b] = D[i * (n + 1)] - D[j * (n + 1)];
    di[b] = D[size + i * (n + 1)] - D[size + j * (n + 1)];
    over[b] = dr[b] * dr[b] + di[b] * di[b];
    for (int l = 0; l < 8; l++) least = over[b][l] >= least ? least : over[b][l];
  }
  if (!keeps_apart(f, sqrt(least), hypot(gr, gi))) return;
  for (int b = 0; b < blocks; b++) {
    v8 re = (gr * dr[b] + gi * di[b]) / over[b], im = (gi * dr[b] - gr * di[b]) / over[b];
    v8 a = *(u8 *)(x + 8 * b), c = *(u8 *)(y + 8 * b);
    *(u8 *)(x + 8 * b) = a * re - c * im;
    *(u8 *)(y + 8 * b) = a * im + c * re;
  }
}

/* Step and slope for all pairs outside of the groups, from B; returns the largest effect of what is coupled against what is allowed.
 *
 * stuck (n, n): how much of each pair is in resonance. */
static double take_steps(const Shape *s, const Waves *f, const int *group, const double *allowed, const v8 *B, v8 *step, v8 *slope,
                         double *left, double *largest, double *stuck) {
  int n = s->n, size = n * n, blocks = f->blocks;
  double mean_re[n], mean_im[n], away[n], worst = 0.0;
  for (int i = 0; i < n; i++) {
    mean_re[i] = mean_im[i] = 0.0;
    for (int b = 0; b < blocks; b++)
      for (int l = 0; l < 8; l++) {
        mean_re[i] += B[2 * size * b + i * (n + 1)][l] / (8 * blocks);
        mean_im[i] += B[2 * size * b + size + i * (n + 1)][l] / (8 * blocks);
      }
  }
  measure_deviations(n, blocks, group, B, mean_re, mean_im, away);
  for (int q = 0; q < s->leaders; q++) {
    int i = s->leader[q];
    for (int j = 0; j < n; j++) {
      v8 re[8], im[8], dre[8], dim[8];
      double rest = 0.0, most = 0.0, near = 0.0, gr = mean_re[i] - mean_re[j], gi = mean_im[i] - mean_im[j];
      if (group[i] != group[j]) {
        double x[64], y[64];
        take_entry(size, blocks, B, i * n + j, x, y);
        follow_gap(f, n, B, i, j, gr, gi, x, y);
        rest = take_step(blocks, f->most, f->width, f->forth, f->back, f->w, gr, gi, find_nearest(f, hypot(gr, gi), away[i] + away[j]), x, y, re, im, dre, dim, &most,
                         &near);
      } else
        for (int b = 0; b < blocks; b++) re[b] = im[b] = dre[b] = dim[b] = splat(0.0);
      for (int b = 0; b < blocks; b++) {
        step[2 * size * b + i * n + j] = re[b] + (i == j ? 1.0 : 0.0);
        step[2 * size * b + size + i * n + j] = im[b];
        slope[2 * size * b + i * n + j] = dre[b];
        slope[2 * size * b + size + i * n + j] = dim[b];
      }
      int other = s->mate[i] * n + s->mate[j];
      left[i * n + j] = left[other] = rest;
      largest[i * n + j] = largest[other] = most;
      stuck[i * n + j] = stuck[other] = near;
    }
  }
  for (int b = 0; b < blocks; b++) { mirror(s, step + 2 * size * b); mirror(s, slope + 2 * size * b); }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double gap = hypot(mean_re[i] - mean_re[j], mean_im[i] - mean_im[j]), a = largest[i * n + j] * largest[j * n + i];
      double effect = (gap * a + sqrt(left[i * n + j] * left[j * n + i])) / allowed[i];
      if (!(effect <= worst)) worst = effect;
    }
  return worst;
}

/* Values between the nodes and slopes: out[e] = factor matrix x[e] for the leaders' entries; matrix (nodes of x, blocks of out). */
static void apply(const Shape *s, int blocks, const double *matrix, double factor, const v8 *x, v8 *out) {
  int n = s->n, size = n * n;
  for (int q = 0; q < s->leaders; q++)
    for (int e = s->leader[q] * n; e < (s->leader[q] + 1) * n; e++) {
      double re[64], im[64];
      v8 out_re[8], out_im[8];
      take_entry(size, blocks, x, e, re, im);
      transform(8 * blocks, blocks, 8 * blocks, matrix, re, im, out_re, out_im);
      for (int b = 0; b < blocks; b++) { out[2 * size * b + e] = factor * out_re[b]; out[2 * size * b + size + e] = factor * out_im[b]; }
    }
  for (int b = 0; b < blocks; b++) mirror(s, out + 2 * size * b);
}

/* X = P^-1, once improved, and B = X (E P - slope), one block; two blocks of work. */
static void transform_generator(const Shape *s, const v8 *E, const v8 *P, const v8 *slope, v8 *X, v8 *B, v8 *work) {
  int n = s->n, size = 2 * n * n;
  v8 *more = work + size;
  memcpy(work, P, size * sizeof(v8));
  make_identity(n, X);
  solve(n, work, X);
  multiply(s, P, X, work);
  mirror(s, work);
  for (int e = 0; e < size; e++) work[e] = (e < n * n && e % (n + 1) == 0 ? 1.0 : 0.0) - work[e];
  multiply(s, X, work, more);
  mirror(s, more);
  for (int e = 0; e < size; e++) X[e] += more[e];
  mirror(s, X);
  multiply(s, E, P, work);
  mirror(s, work);
  for (int e = 0; e < size; e++) work[e] -= slope[e];
  multiply(s, X, work, B);
  mirror(s, B);
}

static const double WORST = 0.3; /* as in decouple.py */
static const double HOPELESS = 3.0, EVIDENT = 10.0; /* as in steady.py and coordinates.py */
enum { RESONANT = -5 };

/* Whether pairs are in resonance by `most` times more than is allowed: then the partner of each mode that is so most, -1 for the others. */
static int find_resonance(int n, const double *allowed, const double *stuck, double most, int *partner) {
  double excess[n], largest = 0.0;
  for (int i = 0; i < n; i++) {
    excess[i] = 0.0;
    for (int j = 0; j < n; j++) {
      double effect = sqrt(stuck[i * n + j] * stuck[j * n + i]) / allowed[i];
      if (effect > excess[i]) { excess[i] = effect; partner[i] = j; }
    }
    largest = fmax(largest, excess[i]);
  }
  for (int i = 0; i < n && largest > most; i++)
    if (!(excess[i] > 0.0 && excess[i] >= WORST * largest)) partner[i] = -1;
  return largest > most;
}

typedef struct { v8 *own, *P, *slope, *inverse, *B; } Side; /* of the nodes, or of the times half-way between them */
typedef struct { double enough, shrink; int most_rounds; } Ends;

/* The coordinates P, their slope, their inverse and the generator at the nodes and between them, from `own` there; work: 3 arrays.
 *
 * returns the number of rounds, -1 where the first step is no number, RESONANT where modes resonate, `partner` (n,) of those that do so most. */
static int find_coordinates(const Shape *s, const Waves *f, const Ends *ends, const int *group, const double *allowed, Side *node, Side *between,
                            v8 *work, double *numbers, int *partner) {
  int n = s->n, size = 2 * n * n, blocks = f->blocks, made = 0;
  long whole = (long)size * blocks;
  v8 *B = node->B, *P = between->P, *best = node->P, *step = work, *slope = node->slope, *next = work + whole;
  double least = INFINITY;
  memcpy(B, node->own, whole * sizeof(v8));
  for (int b = 0; b < blocks; b++) make_identity(n, P + (long)size * b);
  memcpy(best, P, whole * sizeof(v8));
  for (;; made++) {
    double worst = take_steps(s, f, group, allowed, B, step, slope, numbers, numbers + n * n, numbers + 2 * n * n);
    if (find_resonance(n, allowed, numbers + 2 * n * n, EVIDENT, partner)) return RESONANT;
    if (!(worst < ends->shrink * least)) { made--; break; }
    least = worst;
    memcpy(best, P, whole * sizeof(v8));
    if (worst < ends->enough || made == ends->most_rounds) break;
    for (int b = 0; b < blocks; b++) {
      long at = (long)size * b;
      multiply(s, P + at, step + at, next + at);
      mirror(s, next + at);
      memcpy(P + at, next + at, size * sizeof(v8));
      multiply(s, B + at, step + at, next + at);
      mirror(s, next + at);
      for (int e = 0; e < size; e++) B[at + e] = next[at + e] - slope[at + e];
      solve(n, step + at, B + at);
    }
  }
  if (find_resonance(n, allowed, numbers + 2 * n * n, HOPELESS, partner)) return RESONANT;
  long table = 64L * blocks * blocks;
  apply(s, blocks, f->between, 1.0, best, P);
  apply(s, blocks, f->between + table, f->w, best, node->slope);
  apply(s, blocks, f->between + 2 * table, f->w, best, between->slope);
  for (int b = 0; b < blocks; b++) {
    long at = (long)size * b;
    transform_generator(s, node->own + at, best + at, node->slope + at, node->inverse + at, node->B + at, work);
    transform_generator(s, between->own + at, P + at, between->slope + at, between->inverse + at, between->B + at, work);
  }
  return made;
}
