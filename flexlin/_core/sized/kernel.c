/* Floquet exponents of E x' = A x, both functions of the phase and of p, for many p, L at a time: exponentials of order 4 on finer and finer resolutions, eigenvalues
 * of the product of its factors by QR sweeps, Richardson's extrapolation of the last three with its own error, until that is as small as asked.
 *
 * E = [I 0; 0 M] and A = [0 I; Z] with M (H, H), Z (H, S), time in units of the period; H = S where A is full. Compiled once for each S, H (STATES, ROWS in CMakeLists.txt):
 * x = [y; y'] has S = 2 H.
 * A model is data: three programs, of the phase alone, of the parameters alone, and of both.
 */
#include "logs.h"
#include "program.h"
#include <complex.h>

#define JOINED(name, states, rows) name##_##states##_##rows
#define NAMED(name, states, rows) JOINED(name, states, rows)
#define SIZED(name) NAMED(name, STATES, ROWS)
enum { NODES = WIDE / L }; /* phases that go through a program together */

/* Programs find inputs in their first slots. What `both` needs of the others it finds in its own first slots: `points` rows that the parameters
 * decide, then `phases` rows; `from_point`, `from_phase`: where these stand in the memory of the others. */
typedef struct {
  const Step *of_phase, *of_point, *both;
  const int *from_phase, *from_point, *outputs; /* outputs: Z row by row, then M where there is one */
  long phase_steps, point_steps, both_steps;
  int phase_inputs, parameters, phases, points, mass, period, slots;
} Model;

/* ---- coefficients ---- */

/* What the phase alone decides: table (nodes, phases) from inputs (nodes, phase_inputs). */
static long tabulate(const Model *m, long nodes, const double *inputs, double *memory, double *table) {
  for (long first = 0; first < nodes; first += WIDE) {
    const int many = nodes - first < WIDE ? (int)(nodes - first) : WIDE;
    for (int i = 0; i < m->phase_inputs; i++)
      for (int j = 0; j < WIDE; j++) memory[i * WIDE + j] = inputs[(first + (j < many ? j : 0)) * m->phase_inputs + i];
    if (run_steps(WIDE, m->phase_steps, m->of_phase, memory)) return 1;
    for (int i = 0; i < m->phases; i++)
      for (int j = 0; j < many; j++) table[(first + j) * m->phases + i] = memory[(long)m->from_phase[i] * WIDE + j];
  }
  return 0;
}

/* What the parameters of L values decide, into the first slots of `memory`; returns the periods. */
static vec read_points(const Model *m, const double *points, int lanes, double *scratch, double *memory) {
  vec period = splat(0.0);
  for (int i = 0; i < m->parameters; i++)
    for (int j = 0; j < WIDE; j++) scratch[i * WIDE + j] = points[(j % L < lanes ? j % L : lanes - 1) * m->parameters + i];
  run_steps(WIDE, m->point_steps, m->of_point, scratch);
  for (int i = 0; i < m->points; i++) memcpy(memory + i * WIDE, scratch + (long)m->from_point[i] * WIDE, WIDE * sizeof(double));
  for (int l = 0; l < L; l++) period[l] = scratch[(long)m->period * WIDE + l];
  return period;
}

/* M^-1 Z in place of Z by elimination without pivoting; returns where M is positive definite. */
static mask solve_mass(vec *M, vec *Z) {
  mask positive = every_lane();
  vec inverse[H];
  for (int j = 0; j < H; j++) {
    positive &= (mask)(M[j * H + j] > 0.0);
    inverse[j] = 1.0 / M[j * H + j];
    for (int i = j + 1; i < H; i++) {
      const vec factor = M[i * H + j] * inverse[j];
      for (int c = j + 1; c < H; c++) M[i * H + c] -= factor * M[j * H + c];
      for (int c = 0; c < S; c++) Z[i * S + c] -= factor * Z[j * S + c];
    }
  }
  for (int j = H - 1; j >= 0; j--)
    for (int c = 0; c < S; c++) {
      vec sum = Z[j * S + c];
      for (int i = j + 1; i < H; i++) sum -= M[j * H + i] * Z[i * S + c];
      Z[j * S + c] = sum * inverse[j];
    }
  return positive;
}

/* M^-1 Z at some nodes, from their rows of the table; returns where M is positive definite. */
static mask read_nodes(const Model *m, int nodes, const double *table, double *memory, vec Z[NODES][H * S]) {
  mask positive = every_lane();
  vec M[H * H];
  for (int i = 0; i < m->phases; i++)
    for (int k = 0; k < NODES; k++) *(vec *)(memory + (m->points + i) * WIDE + k * L) = splat(table[(k < nodes ? k : 0) * m->phases + i]);
  run_steps(WIDE, m->both_steps, m->both, memory);
  for (int k = 0; k < nodes; k++) {
    const double *here = memory + k * L;
    for (int i = 0; i < H * S; i++) Z[k][i] = *(const vec *)(here + (long)m->outputs[i] * WIDE);
    if (!m->mass) continue;
    for (int i = 0; i < H * H; i++) M[i] = *(const vec *)(here + (long)m->outputs[H * S + i] * WIDE);
    positive &= solve_mass(M, Z[k]);
  }
  return positive;
}

typedef struct { vec W[H * S], D[H * S]; double c; } Segment; /* h (A1 + A2) / 2 = c [0 I; W], sqrt(3) h (A2 - A1) / 12 = [0; D] */

typedef struct { /* segments of one resolution, read one after the other */
  const Model *model;
  const double *table, *lengths, *scale;
  double *memory;
  int left, held;
  vec Z[NODES][H * S], log_det;
  mask positive;
} Reader;

static void read_segment(Reader *r, Segment *s) {
  if (!r->held) {
    const int nodes = 2 * r->left < NODES ? 2 * r->left : NODES;
    r->positive &= read_nodes(r->model, nodes, r->table, r->memory, r->Z);
    r->table += nodes * r->model->phases;
    r->left -= nodes / 2;
    r->held = nodes;
    if (nodes < NODES) memmove(r->Z[NODES - nodes], r->Z[0], nodes * sizeof r->Z[0]);
  }
  const vec *Z1 = r->Z[NODES - r->held], *Z2 = r->Z[NODES - r->held + 1];
  const double h = *r->lengths++, *scale = r->scale;
  r->held -= 2;
  s->c = IS_FULL ? h : h * scale[OFF];
  for (int i = 0; i < H; i++)
    for (int j = 0; j < S; j++) {
      const int k = i * S + j;
      const double factor = scale[(OFF + i) * S + j], x = 0.5 * h / s->c * factor;
      s->W[k] = x * (Z1[k] + Z2[k]);
      s->D[k] = (0.14433756729740644 * h * factor) * (Z2[k] - Z1[k]);
      if (j == OFF + i) r->log_det += 0.5 * h * (Z1[k] + Z2[k]);
    }
}

/* ---- factors ---- */

/* Z = (I + D_next)^-1 (D_now - D_next), its lower rows, for D = [0; d1 d2], which is small. */
static void divide(const vec *now, const vec *next, vec *Z) {
  vec B[H * H];
  for (int i = 0; i < H; i++)
    for (int j = 0; j < H; j++) B[i * H + j] = next[i * S + OFF + j] + (i == j);
  for (int i = 0; i < H * S; i++) Z[i] = now[i] - next[i];
  solve_mass(B, Z);
}

/* E = (I + D_next)^-1 (I + D_now) exp(A) from P = exp(A) - I. */
static void make_factor(const Segment *now, const Segment *next, double reach, vec *E) {
  vec Z[H * S], below[H * S];
  exponentiate(now->W, now->c, reach, E);
  divide(now->D, next->D, Z);
  for (int i = 0; i < H * S; i++) below[i] = E[OFF * S + i] + Z[i];
  add_product(Z, E, below);
  for (int i = 0; i < H * S; i++) E[OFF * S + i] = below[i];
  for (int i = 0; i < S; i++) E[i * S + i] += 1.0;
}

/* Groups of segments whose product separates modes by less than hides accuracy behind rounding; the weakest mode does not count. */
static int count_groups(int segments, double spread, double accuracy) {
  double needed = ceil(2 * spread / log(accuracy / (10 * EPS)));
  return needed < 1 ? 1 : needed < segments ? (int)needed : segments;
}

/* Factors F of one resolution of K segments: neighbours are multiplied until G are left.
 *
 * Each segment has the factor (I + D) exp(h (A1 + A2) / 2) (I + D)^-1, which is Magnus' exponential
 * exp(h (A1 + A2) / 2 - sqrt(3) h^2 [A1, A2] / 12) up to h^5 and as symmetric in time, but keeps the form of [0 I; Z]; neighbours share
 * (I + D_next)^-1 (I + D). Source: Blanes, Casas, Oteo, Ros, Physics Reports 470 (2009), Eq. (253). */
static void multiply_out(Reader *r, int K, int G, double reach, vec *F) {
  Segment first, two[2];
  read_segment(r, &first);
  two[0] = first;
  for (int g = 0, k = 0; g < G; g++, F += S * S) {
    vec E[S * S], product[S * S];
    for (int begin = k, stop = (int)((long)(g + 1) * K / G); k < stop; k++) {
      Segment *now = &two[k % 2], *next = &two[(k + 1) % 2];
      if (k + 1 < K) read_segment(r, next);
      else *next = first;
      make_factor(now, next, reach, k == begin ? F : E);
      if (k == begin) continue;
      multiply(E, F, product);
      memcpy(F, product, sizeof product);
    }
  }
}

/* ---- Richardson's extrapolation ---- */

/* Parts of the steps that count as error. Of 189,550 answers that met 1e-8, of random systems of 2 to 8 states, a quarter of them stiff, on 8 to 48
 * segments times 2, 3, 4, with CAUTION = 1 for second-order systems, 64 had an error above the one stated, 4 above three times that, at most 4.5
 * times. Full matrices: with 1, three of 37 answers of an arm with filters' poles up to 600 1/s had, up to 2.4 times. */
static const double CHANGE = 1.75, STEP = 0.05, SHARED = 0.03, CAUTION = IS_FULL ? 3.0 : 2.0;

typedef struct { vec re[S], im[S]; mask sound; } Logs;

static vec wrap(vec x) { return x - TURN * v_round(x * (1.0 / TURN)); }

static vec v_size(vec x, vec y) { return v_sqrt(x * x + y * y); }

/* (dr, di) = x less the one of c that lies nearest to it modulo 2 pi i, and with it the (sr, si) that belongs to that one. */
static void subtract_nearest(vec xr, vec xi, const Logs *c, const vec *steps_re, const vec *steps_im, vec *dr, vec *di, vec *sr, vec *si) {
  vec best = splat(INFINITY);
  *dr = *di = *sr = *si = splat(NAN);
  for (int j = 0; j < S; j++) {
    vec r = xr - c->re[j], i = wrap(xi - c->im[j]), d = r * r + i * i;
    mask nearer = (mask)(d < best);
    best = v_choose(nearer, d, best);
    *dr = v_choose(nearer, r, *dr);
    *di = v_choose(nearer, i, *di);
    *sr = v_choose(nearer, steps_re[j], *sr);
    *si = v_choose(nearer, steps_im[j], *si);
  }
}

/* Logs x of order 8 from those of order 4 on three resolutions, and their errors.
 *
 * gains: what the steps a = middle - coarse and b = fine - middle add: fine + g0 b and, one resolution before, middle + g1 a are of order 6,
 * fine + g2 b + g3 a of order 8. The change between the two of order 6 is the error: stiff systems converge more slowly than by these orders. A
 * change that is small by chance is not trusted: the step counts too, and the change of the other exponents. */
static void extrapolate(const Logs *coarse, const Logs *middle, const Logs *fine, const double *gains, double accuracy, Logs *x, vec *error) {
  const double noise = 40.0 * EPS;
  vec ar[S], ai[S], none[S], change[S], rest[S], most = splat(0.0), br, bi, sr, si;
  for (int i = 0; i < S; i++) none[i] = splat(0.0);
  for (int i = 0; i < S; i++) subtract_nearest(middle->re[i], middle->im[i], coarse, none, none, &ar[i], &ai[i], &sr, &si);
  for (int i = 0; i < S; i++) {
    subtract_nearest(fine->re[i], fine->im[i], middle, ar, ai, &br, &bi, &sr, &si);
    x->re[i] = fine->re[i] + gains[2] * br + gains[3] * sr;
    vec im = wrap(fine->im[i] + gains[2] * bi + gains[3] * si);
    x->im[i] = v_choose((mask)(im <= -0.5 * TURN), im + TURN, im);
    change[i] = v_size((1.0 + gains[0]) * br - gains[1] * sr, (1.0 + gains[0]) * bi - gains[1] * si);
    rest[i] = CAUTION * STEP * gains[0] * v_size(br, bi) + (noise + accuracy) * v_size(x->re[i], x->im[i]) + noise;
    most = v_max(most, change[i]);
  }
  for (int i = 0; i < S; i++) error[i] = CAUTION * CHANGE * v_max(change[i], SHARED * most) + rest[i];
}

/* Whether every error is as small as asked, in each lane. */
static mask meets(const Logs *x, const vec *error, vec period, double tol) {
  mask met = every_lane();
  for (int i = 0; i < S; i++) met &= (mask)(error[i] <= tol * v_max(period, v_size(x->re[i], x->im[i])));
  return met;
}

/* ---- what is called from outside ---- */

typedef struct { /* ever more segments; lengths: h of all of them, level after level; inputs: of the phase program at both nodes of each segment */
  int levels, total;
  const int *segments;
  const double *lengths, *inputs, *gains, *scale; /* gains (levels, 4): see `extrapolate`; scale (S, S): of the states */
  double reach;                             /* see `exponentiate` */
} Grids;

/* Logs (S) and errors of L values, until all that are sound meet tol; returns where M is positive definite. */
static mask solve_values(const Model *m, const Grids *g, const double *table, vec period, double accuracy, double spread, double tol, double *memory, vec *F,
                       vec *R, Logs *x, vec *error) {
  Logs found[3];
  vec Q[S * S];
  Reader r = {.model = m, .table = table, .lengths = g->lengths, .scale = g->scale, .memory = memory, .positive = every_lane()};
  for (int i = 0; i < S * S; i++) Q[i] = splat(i % (S + 1) ? 0.0 : 1.0);
  for (int level = 0;;) {
    const int K = r.left = g->segments[level], G = count_groups(K, spread, accuracy);
    Logs *now = &found[level % 3];
    r.log_det = splat(0.0);
    multiply_out(&r, K, G, g->reach, F);
    now->sound = find_logs(F, R, G, r.log_det, accuracy, Q, now->re, now->im);
    spread = measure_spread(now->re, now->sound);
    if (++level < 3) continue;
    extrapolate(&found[level % 3], &found[(level + 1) % 3], now, g->gains + 4 * (level - 1), accuracy, x, error);
    x->sound = found[0].sound & found[1].sound & found[2].sound & r.positive;
    if (level == g->levels || all_lanes((x->sound & meets(x, error, period, tol)) | ~r.positive)) return r.positive;
  }
}

/* Memory for a model: its slots as rows, twice. */
static double *find_memory(const Model *m) { return aligned_alloc(64, (size_t)(m->slots + 1) * 2 * WIDE * sizeof(double)); }

/* Logs (V, S, 2) of the multipliers at points (V, parameters), their errors (V, S), whether they are sound (V), the periods (V), and whether M is positive
 * definite (V). Returns 0, or 1 where memory gives out or a program holds an unknown operation. */
CALLED int SIZED(find_exponents)(const void *model, const void *grids, long values, const double *points, double accuracy, double spread, double tol,
                                 double complex *logs, double *errors, char *sounds, double *periods, char *definite) {
  const Model *m = model;
  const Grids *g = grids;
  const long nodes = 2L * g->total;
  const size_t most = (size_t)g->segments[g->levels - 1] * S * S * sizeof(vec);
  double *table = malloc((size_t)nodes * (m->phases + 1) * sizeof(double)), *memory = find_memory(m);
  vec *F = aligned_alloc(64, most), *R = aligned_alloc(64, most);
  int failed = !table || !memory || !F || !R || tabulate(m, nodes, g->inputs, memory, table);
  for (long first = 0; first < values && !failed; first += L) {
    const int lanes = values - first < L ? (int)(values - first) : L;
    vec error[S], period = read_points(m, points + first * m->parameters, lanes, memory + (long)m->slots * WIDE, memory);
    Logs x;
    const mask positive = solve_values(m, g, table, period, accuracy, spread, tol, memory, F, R, &x, error);
    for (int l = 0; l < lanes; l++) {
      const long v = first + l;
      sounds[v] = x.sound[l] != 0;
      periods[v] = period[l];
      definite[v] = positive[l] != 0;
      for (int i = 0; i < S; i++) {
        logs[v * S + i] = CMPLX(x.re[i][l], x.im[i][l]);
        errors[v * S + i] = error[i][l];
      }
    }
  }
  free(table);
  free(memory);
  free(F);
  free(R);
  return failed;
}

/* M^-1 Z (V, nodes, H, S) at points (V, parameters) and nodes given by inputs (nodes, phase_inputs), whether M is positive definite at all nodes (V), and the periods (V). Returns as find_exponents. */
CALLED int SIZED(sample_model)(const void *model, long values, const double *points, long nodes, const double *inputs, double *coefficients, char *sounds,
                               double *periods) {
  const Model *m = model;
  double *table = malloc((size_t)nodes * (m->phases + 1) * sizeof(double)), *memory = find_memory(m);
  vec Z[NODES][H * S];
  int failed = !table || !memory || tabulate(m, nodes, inputs, memory, table);
  for (long first = 0; first < values && !failed; first += L) {
    const int lanes = values - first < L ? (int)(values - first) : L;
    const vec period = read_points(m, points + first * m->parameters, lanes, memory + (long)m->slots * WIDE, memory);
    mask positive = every_lane();
    for (long k = 0; k < nodes; k += NODES) {
      const int many = nodes - k < NODES ? (int)(nodes - k) : NODES;
      positive &= read_nodes(m, many, table + k * m->phases, memory, Z);
      for (int l = 0; l < lanes; l++)
        for (int j = 0; j < many; j++)
          for (int i = 0; i < H * S; i++) coefficients[((first + l) * nodes + k + j) * H * S + i] = Z[j][i][l];
    }
    for (int l = 0; l < lanes; l++) { sounds[first + l] = positive[l] != 0; periods[first + l] = period[l]; }
  }
  free(table);
  free(memory);
  return failed;
}
