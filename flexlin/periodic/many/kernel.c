/* Floquet exponents of y'' = X(phase, p) y + Y(phase, p) y' for many p, eight at a time: exponentials of order 4 on finer and finer
 * resolutions, eigenvalues of the product of its factors by QR sweeps, Richardson's extrapolation of the last three with its own error,
 * until that is as small as asked.
 *
 * The same computation as romberg.py, spectrum.py and extrapolation.py, which say where it comes from. In front of these files stands what `Model` makes:
 * COORDINATES, PARAMETERS, PHASE_INPUTS, PHASE_VALUES, POINT_VALUES, ROWS, COLUMNS (the block of a product that stays in registers),
 * MEMORY (ignorable coordinates, the last ones: nothing depends on them, and the STATES leave them out; S counts them),
 *     of_phase(u, f): what depends on the phase alone       of_point(p, w): what depends on the parameters alone; returns the period
 *     at_node(f, w, X, Y): the coefficients at one phase; returns where the mass matrix is positive definite
 */

static const double CHANGE = 1.75, STEP = 0.05, SHARED = 0.03, REMEMBERED = MEMORY ? 3.0 : 1.0;

/* ---- Richardson's extrapolation ---- */

typedef struct { v8 re[STATES], im[STATES]; m8 sound; } Logs;

static v8 wrap(v8 x) { return x - TURN * v_round(x * (1.0 / TURN)); }

static v8 v_size(v8 x, v8 y) { return v_sqrt(x * x + y * y); }

/* (dr, di) = x less the one of c that lies nearest to it modulo 2 pi i, and with it the (sr, si) that belongs to that one. */
static void subtract_nearest(v8 xr, v8 xi, const Logs *c, const v8 *steps_re, const v8 *steps_im, v8 *dr, v8 *di, v8 *sr, v8 *si) {
  v8 best = splat(INFINITY);
  *dr = *di = *sr = *si = splat(NAN);
  for (int j = 0; j < STATES; j++) {
    v8 r = xr - c->re[j], i = wrap(xi - c->im[j]), d = r * r + i * i;
    m8 nearer = (m8)(d < best);
    best = v_choose(nearer, d, best);
    *dr = v_choose(nearer, r, *dr);
    *di = v_choose(nearer, i, *di);
    *sr = v_choose(nearer, steps_re[j], *sr);
    *si = v_choose(nearer, steps_im[j], *si);
  }
}

/* Logs x of order 8 from three resolutions, and their errors; gains: see extrapolation.py. */
static void extrapolate(const Logs *coarse, const Logs *middle, const Logs *fine, const double *gains, double accuracy, Logs *x, v8 *error) {
  const double noise = 40.0 * 2.220446049250313e-16;
  v8 ar[STATES], ai[STATES], none[STATES], change[STATES], rest[STATES], most = splat(0.0), br, bi, sr, si;
  for (int i = 0; i < STATES; i++) none[i] = splat(0.0);
  for (int i = 0; i < STATES; i++) subtract_nearest(middle->re[i], middle->im[i], coarse, none, none, &ar[i], &ai[i], &sr, &si);
  for (int i = 0; i < STATES; i++) {
    subtract_nearest(fine->re[i], fine->im[i], middle, ar, ai, &br, &bi, &sr, &si);
    x->re[i] = fine->re[i] + gains[2] * br + gains[3] * sr;
    v8 im = wrap(fine->im[i] + gains[2] * bi + gains[3] * si);
    x->im[i] = v_choose((m8)(im <= -0.5 * TURN), im + TURN, im);
    change[i] = v_size((1.0 + gains[0]) * br - gains[1] * sr, (1.0 + gains[0]) * bi - gains[1] * si);
    rest[i] = REMEMBERED * STEP * gains[0] * v_size(br, bi) + (noise + accuracy) * v_size(x->re[i], x->im[i]) + noise;
    most = v_max(most, change[i]);
  }
  for (int i = 0; i < STATES; i++) error[i] = REMEMBERED * CHANGE * v_max(change[i], SHARED * most) + rest[i];
}

/* ---- what is called from outside ---- */

/* Groups of segments whose product separates modes by less than hides accuracy behind rounding; the weakest mode does not count. */
static int count_groups(int segments, double spread, double accuracy) {
  double needed = ceil(2 * spread / log(accuracy / (10 * 2.220446049250313e-16)));
  return needed < 1 ? 1 : needed < segments ? (int)needed : segments;
}

typedef struct { v8 W[N * S], D[N * S]; double c; } Segment; /* h (A1 + A2) / 2 = c [0 I; W], sqrt(3) h (A2 - A1) / 12 = [0 0; D] */

/* Read a segment at its two nodes; adds to the log of the determinant; returns where the mass matrix is positive definite. */
static m8 read_segment(const double *f, const v8 *w, double h, const double *scale, Segment *s, v8 *log_det) {
  v8 X1[N * N], Y1[N * N], X2[N * N], Y2[N * N];
  m8 positive = at_node(f, w, X1, Y1) & at_node(f + PHASE_VALUES, w, X2, Y2);
  s->c = h * scale[N];
  for (int i = 0; i < N; i++) *log_det += 0.5 * h * (Y1[i * N + i] + Y2[i * N + i]);
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) {
      const double *factor = scale + (N + i) * S + j, x = 0.5 * h / s->c * factor[0], y = 0.5 * h / s->c * factor[N];
      s->W[i * S + j] = x * (X1[i * N + j] + X2[i * N + j]);
      s->W[i * S + N + j] = y * (Y1[i * N + j] + Y2[i * N + j]);
      s->D[i * S + j] = (0.14433756729740644 * h * factor[0]) * (X2[i * N + j] - X1[i * N + j]);
      s->D[i * S + N + j] = (0.14433756729740644 * h * factor[N]) * (Y2[i * N + j] - Y1[i * N + j]);
    }
  return positive;
}

enum { PART = N <= 3 ? S : N == 5 ? 5 : N <= 6 ? 4 : 2 }; /* columns of a solution that stay in registers */

/* Z = (I + D_next)^-1 (D_now - D_next), its lower half, for D = [0 0; d1 d2], which is small: elimination without pivoting. */
SHORT void divide(const v8 *now, const v8 *next, v8 *Z) {
  v8 B[N][N], inverse[N];
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) B[i][j] = i == j ? next[i * S + N + j] + 1.0 : next[i * S + N + j];
  for (int k = 0; k < N; k++) {
    inverse[k] = 1.0 / B[k][k];
    for (int i = k + 1; i < N; i++) {
      B[i][k] *= inverse[k];
      for (int j = k + 1; j < N; j++) B[i][j] -= B[i][k] * B[k][j];
    }
  }
  for (int start = 0; start < S; start += PART) {
    v8 z[N][PART];
    UNROLL for (int i = 0; i < N; i++)
      UNROLL for (int c = 0; c < PART; c++) {
        z[i][c] = now[i * S + start + c] - next[i * S + start + c];
        UNROLL for (int k = 0; k < i; k++) z[i][c] -= B[i][k] * z[k][c];
      }
    UNROLL for (int i = N - 1; i >= 0; i--)
      UNROLL for (int c = 0; c < PART; c++) {
        UNROLL for (int k = i + 1; k < N; k++) z[i][c] -= B[i][k] * z[k][c];
        z[i][c] *= inverse[i];
      }
    UNROLL for (int i = 0; i < N; i++)
      UNROLL for (int c = 0; c < PART; c++) Z[i * S + start + c] = z[i][c];
  }
}

/* E = (I + D_next)^-1 (I + D_now) exp(A) from P = exp(A) - I. */
static void make_factor(const Segment *now, const Segment *next, const double *reach, Dominant *dominant, v8 *E) {
  v8 Z[N * S], below[N * S];
  exponentiate(now->W, now->c, reach, dominant, E);
  divide(now->D, next->D, Z);
  for (int i = 0; i < N * S; i++) below[i] = E[N * S + i] + Z[i];
  add_product(Z, E, below);
  memcpy(E + N * S, below, sizeof below);
  for (int i = 0; i < S; i++) E[i * S + i] += 1.0;
}

/* What of a product (S, S) belongs to the states without ignorable coordinates. It stands by itself, as nothing depends on these. */
static void leave_out(const v8 *P, v8 *F) {
  for (int i = 0; i < STATES; i++)
    for (int j = 0; j < STATES; j++) F[i * STATES + j] = P[(i < N - MEMORY ? i : i + MEMORY) * S + (j < N - MEMORY ? j : j + MEMORY)];
}

/* Factors F of one resolution: neighbours are multiplied until G are left; f, h: where the tables of this resolution begin. Returns where
 * the mass matrix is positive definite; adds to the log of the determinant.
 *
 * Each segment has the factor (I + D) exp(h (A1 + A2) / 2) (I + D)^-1 of order 4, symmetric in time; neighbours share (I + D_next)^-1 (I + D). */
static m8 multiply_out(const double *f, const v8 *w, const double *h, int K, int G, const double *scale, const double *reach, Dominant *dominant, v8 *F,
                       v8 *log_det) {
  Segment first, two[2];
  m8 positive = read_segment(f, w, *h, scale, &first, log_det);
  two[0] = first;
  for (int g = 0, k = 0; g < G; g++, F += STATES * STATES) {
    v8 E[S * S], pair[2][S * S], *product = NULL;
    for (int stop = (int)((long)(g + 1) * K / G); k < stop; k++) {
      Segment *now = &two[k % 2], *next = &two[(k + 1) % 2];
      if (k + 1 < K) positive &= read_segment(f + 2 * (k + 1) * PHASE_VALUES, w, h[k + 1], scale, next, log_det);
      else *next = first;
      v8 *whole = MEMORY ? pair[0] : F, *found = product ? E : k + 1 == stop ? whole : pair[0];
      make_factor(now, next, reach, dominant, found);
      if (product) {
        v8 *target = k + 1 == stop && !MEMORY ? F : product == pair[0] ? pair[1] : pair[0];
        multiply(found, product, target);
        product = target;
      } else product = found;
    }
    if (MEMORY) leave_out(product, F);
  }
  return positive;
}

/* Whether every error is as small as asked, in each lane. */
static m8 meets(const Logs *x, const v8 *error, v8 period, double tol) {
  m8 met = (m8)(splat(0.0) == splat(0.0));
  for (int i = 0; i < STATES; i++) met &= (m8)(error[i] <= tol * v_max(period, v_size(x->re[i], x->im[i])));
  return met;
}

/* Logs (V, STATES, 2) of the multipliers at points (V, PARAMETERS), their errors (V, STATES), whether they are sound (V), the periods (V), and how
 * many segments were computed (V).
 *
 * segments (levels): ever more of them; lengths: h of all segments, level after level; inputs: what depends on the phase at both nodes of
 * each segment, (nodes, PHASE_INPUTS); gains (levels, 4): see `extrapolate`; scale (S, S): of the coordinates and their rates; reach (2): see `exponentiate`.
 * Eight values stop at the resolution at which all of them that are sound meet tol. Returns 0, or 1 where memory gives out. */
int find_exponents(long values, const double *points, int levels, const int *segments, const double *lengths, const double *inputs,
                   const double *gains, const double *scale, const double *reach, double accuracy, double spread_given, double tol,
                   double *logs, double *errors, unsigned char *sounds, double *periods, int *work) {
  long nodes = 0;
  for (int k = 0; k < levels; k++) nodes += 2 * segments[k];
  size_t most = (size_t)segments[levels - 1] * STATES * STATES * sizeof(v8);
  double *table = malloc((size_t)nodes * (PHASE_VALUES + 1) * sizeof(double));
  v8 *F = aligned_alloc(64, most), *R = aligned_alloc(64, most);
  if (!table || !F || !R) { free(table); free(F); free(R); return 1; }
  for (long k = 0; k < nodes; k++) of_phase(inputs + k * PHASE_INPUTS, table + k * PHASE_VALUES);
  for (long first = 0; first < values; first += L) {
    int lanes = values - first < L ? (int)(values - first) : L, level = 0, computed = 0;
    v8 p[PARAMETERS + 1], w[POINT_VALUES + 1], Q[STATES * STATES], error[STATES];
    Logs found[3], x;
    Dominant dominant = {.wanted = 1};
    for (int i = 0; i < S; i++) {
      dominant.left[i] = dominant.right[i] = splat(i < N ? 0.0 : 1.0);
      for (int k = 0; k < 4; k++) dominant.before[k / 2][k % 2][i] = dominant.left[i];
    }
    for (int i = 0; i < PARAMETERS; i++)
      for (int l = 0; l < L; l++) p[i][l] = points[(first + (l < lanes ? l : lanes - 1)) * PARAMETERS + i];
    v8 period = of_point(p, w);
    m8 sound = (m8)(splat(0.0) == splat(0.0)), positive = sound;
    double spread = spread_given;
    for (int i = 0; i < STATES * STATES; i++) Q[i] = splat(i % (STATES + 1) ? 0.0 : 1.0);
    const double *f = table, *h = lengths;
    for (;;) {
      int K = segments[level], G = count_groups(K, spread, accuracy);
      v8 log_det = splat(0.0);
      Logs *now = &found[level % 3];
      positive &= multiply_out(f, w, h, K, G, scale, reach, &dominant, F, &log_det);
      now->sound = find_logs(F, R, G, log_det, accuracy, Q, now->re, now->im);
      spread = measure_spread(now->re, now->sound);
      f += 2 * PHASE_VALUES * K;
      h += K;
      computed += K;
      if (++level < 3) continue;
      extrapolate(&found[level % 3], &found[(level + 1) % 3], now, gains + 4 * (level - 1), accuracy, &x, error);
      sound = found[0].sound & found[1].sound & found[2].sound & positive;
      if (level == levels || all_lanes((sound & meets(&x, error, period, tol)) | ~positive)) break;
    }
    for (int l = 0; l < lanes; l++) {
      long v = first + l;
      sounds[v] = sound[l] != 0;
      periods[v] = period[l];
      work[v] = computed;
      for (int i = 0; i < STATES; i++) {
        logs[(v * STATES + i) * 2] = x.re[i][l];
        logs[(v * STATES + i) * 2 + 1] = x.im[i][l];
        errors[v * STATES + i] = error[i][l];
      }
    }
  }
  free(table);
  free(F);
  free(R);
  return 0;
}

/* Exponents (V, STATES, 2) by falling real part, in place of the logs; the largest error and the verdict of each value (0 undecided, 1 stable,
 * 2 unstable), and the largest error of an exponent in units of what tol allows. */
void judge(long values, double tol, const double *periods, const unsigned char *sounds, double *logs, const double *errors,
           double *error, signed char *verdict, double *misses) {
  for (long v = 0; v < values; v++) {
    double *x = logs + v * STATES * 2, T = periods[v], worst = 0.0, missed = sounds[v] ? 0.0 : INFINITY;
    int stable = 1, unstable = 0;
    for (int i = 0; i < STATES; i++) {
      double e = errors[v * STATES + i], size = sqrt(x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1]);
      missed = fmax(missed, isfinite(e) ? e / (tol * fmax(T, size)) : INFINITY);
      unstable |= x[2 * i] > e;
      stable &= x[2 * i] < -e;
      worst = fmax(worst, e);
    }
    for (int i = 1; i < STATES; i++) {
      double a = x[2 * i], b = x[2 * i + 1];
      int j = i;
      for (; j > 0 && x[2 * j - 2] < a; j--) { x[2 * j] = x[2 * j - 2]; x[2 * j + 1] = x[2 * j - 1]; }
      x[2 * j] = a;
      x[2 * j + 1] = b;
    }
    for (int i = 0; i < 2 * STATES; i++) x[i] /= T;
    error[v] = worst / T;
    verdict[v] = unstable ? 2 : stable ? 1 : 0;
    misses[v] = missed;
  }
}
