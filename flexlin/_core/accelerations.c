/* Collocation in the accelerations of M y'' + D y' + K y = 0, L segments or steps at a time, without exchanging rows:
 * M_i w_i + D_i v_i + K_i y_i = 0,   v_i = v_0 + h sum_j a_ij w_j,   y_i = y_0 + h c_i v_0 + h^2 sum_j (a a)_ij w_j.
 * There are half as many unknowns as states, and M is never inverted. Transition matrices follow, and, where the factors are kept, the motion under
 * one force after another. Source: Hairer, Norsett, Wanner, Solving ODEs I, II.14. */
#include "elimination.h"
#include "program.h"
#include <stdint.h>

enum { REFINED = 3 }; /* times that a solution is refined at the most */

typedef struct { int m, stages; const double *c, *a, *square, *b; } Rule; /* square: a a */

/* A rule from its tableau: c, a, a a, b. */
static Rule read_rule(int m, int stages, const double *tableau) {
  const double *a = tableau + stages, *square = a + stages * stages;
  return (Rule){m, stages, tableau, a, square, square + stages * stages};
}

/* Of L steps: the equations G of their stages and its factors (n, n), n = stages m; units (m,); refine: whether solutions are refined. */
typedef struct { vec *G, *factors, *units, *refine; } Group;

static Group find_group(double *kept, long n, int m, int which) {
  vec *G = (vec *)(((uintptr_t)kept + 63) & ~(uintptr_t)63) + which * (2 * n * n + m + 1);
  return (Group){G, G + n * n, G + 2 * n * n, G + 2 * n * n + m};
}

/* Blocks [M D K] of the stages (stages, m, 3 m) in units d: times d d'. */
static void gather_blocks(const Rule *r, int segments, const double *from, const double *d, vec *to) {
  int m = r->m, rows = r->stages * m;
  for (int l = 0; l < L; l++) { /* the last segment again where there are fewer */
    const double *x = from + (long)rows * 3 * m * (l < segments ? l : segments - 1);
    vec *y = to;
    for (int i = 0; i < r->stages; i++)
      for (int p = 0; p < m; p++)
        for (int block = 0; block < 3; block++)
          for (int q = 0; q < m; q++) (*y++)[l] = *x++ * (d[p] * d[q]);
  }
}

/* G w = right for the accelerations of all stages of L segments, the last again where there are fewer: G (n, n), right (n, 2 m) by the state at the
 * beginning, G_ij = M_i (i = j) + h a_ij D_i + h^2 (a a)_ij K_i. blocks: [M D K] of each (stages, m, 3 m), scaled in `own` by units d (m,) in which
 * the inertias are near 1: powers of two, which round nothing. Returns their lengths. */
static vec build_equations(const Rule *r, int segments, const double *blocks, const double *lengths, double *d, vec *own, vec *G, vec *right) {
  int m = r->m, s = r->stages, n = s * m;
  vec h;
  for (int p = 0; p < m; p++) d[p] = exp2(-round(0.5 * log2(fabs(blocks[p * 3 * m + p]))));
  for (int l = 0; l < L; l++) h[l] = lengths[l < segments ? l : segments - 1];
  gather_blocks(r, segments, blocks, d, own);
  for (int i = 0; i < s; i++)
    for (int p = 0; p < m; p++) {
      const vec *M = own + (i * m + p) * 3 * m, *D = M + m, *K = D + m;
      vec *row = G + (long)(i * m + p) * n, *y = right + (long)(i * m + p) * 2 * m;
      for (int j = 0; j < s; j++) {
        vec ha = h * r->a[i * s + j], hha = h * h * r->square[i * s + j];
        for (int q = 0; q < m; q++) row[j * m + q] = ha * D[q] + hha * K[q] + (i == j ? M[q] : splat(0.0));
      }
      for (int q = 0; q < m; q++) { y[q] = -K[q]; y[m + q] = -D[q] - h * r->c[i] * K[q]; }
    }
  return h;
}

/* Phi = [1, h; 0, 1] + [h^2 sum b_i (1 - c_i) w_i; h sum b_i w_i] of the first of the L, from the accelerations w (n, 2 m) by the state at the
 * beginning, back in their own coordinates. */
static void combine_stages(const Rule *r, int count, vec h, const vec *w, const double *d, double *Phi) {
  int m = r->m, columns = 2 * m;
  for (int p = 0; p < m; p++)
    for (int c = 0; c < columns; c++) {
      vec place = splat(0.0), rate = place;
      for (int i = 0; i < r->stages; i++) {
        vec own = r->b[i] * w[(i * m + p) * columns + c];
        place += (1.0 - r->c[i]) * own;
        rate += own;
      }
      double units = d[p] / d[c % m];
      place = units * h * h * place + splat(c == p) + (c == m + p ? h : splat(0.0));
      rate = units * h * rate + splat(c == m + p);
      for (int l = 0; l < count; l++) {
        double *to = Phi + (long)l * columns * columns;
        to[p * columns + c] = place[l];
        to[(m + p) * columns + c] = rate[l];
      }
    }
}

/* Transition matrices Phi (segments, 2 m, 2 m) from [M D K] at all stages (segments, stages, m, 3 m) and lengths h; tableau: c, a, a a, b;
 * good (segments,): whether each is right to rounding. To keep, or none: kept, room for (segments + 7) (2 n n + m + 1) + 8 numbers, n = stages m, and
 * by_start (segments, n, 2 m), the accelerations by the state at the beginning. Returns -1 where there is no memory. */
CALLED int factor_accelerations(int m, int stages, int segments, const double *blocks, const double *lengths, const double *tableau, double *kept,
                                double *by_start, double *Phi, int *good) {
  Rule r = read_rule(m, stages, tableau);
  long n = (long)stages * m, columns = 2 * m;
  vec *memory = aligned_alloc(sizeof(vec), (3 * m * n + 3 * n * columns + 2 * n * n + m + 9) * sizeof(vec));
  if (!memory) return -1;
  vec *own = memory, *right = own + 3 * m * n, *w = right + n * columns, *left = w + n * columns, *once = left + n * columns;
  for (int k = 0; k < segments; k += L) {
    int count = segments - k < L ? segments - k : L, turns;
    Group e = kept ? find_group(kept, n, m, k / L) : find_group((double *)once, n, m, 0);
    double d[m];
    vec h = build_equations(&r, count, blocks + 3 * m * n * k, lengths + k, d, own, e.G, right);
    for (int p = 0; p < m; p++) e.units[p] = splat(d[p]);
    memcpy(e.factors, e.G, n * n * sizeof(vec));
    memcpy(w, right, n * columns * sizeof(vec));
    eliminate(n, columns, e.factors, w);
    int sound = refine(n, columns, count, e.G, e.factors, right, w, left, REFINED, &turns);
    *e.refine = splat(turns > 0);
    for (int l = 0; l < count; l++) {
      good[k + l] = sound >> l & 1;
      for (long i = 0; i < n && by_start; i++)
        for (int c = 0; c < columns; c++) by_start[((k + l) * n + i) * columns + c] = d[i % m] * w[i * columns + c][l] / d[c % m];
    }
    combine_stages(&r, count, h, w, d, Phi + k * columns * columns);
  }
  free(memory);
  return 0;
}

/* free (steps, n) = -G^-1 F. Returns 0 without memory. */
static int solve_steps(int m, int stages, int steps, double *kept, const double *F, double *free_) {
  long n = (long)stages * m;
  vec *right = aligned_alloc(sizeof(vec), 3 * n * sizeof(vec)), *w = right + n, *left = w + n;
  int turns;
  if (!right) return 0;
  for (int k = 0; k < steps; k += L) {
    int count = steps - k < L ? steps - k : L;
    Group e = find_group(kept, n, m, k / L);
    for (long i = 0; i < n; i++)
      for (int l = 0; l < L; l++) right[i][l] = -e.units[i % m][0] * F[(k + (l < count ? l : count - 1)) * n + i];
    memcpy(w, right, n * sizeof(vec));
    solve_again(n, 1, e.factors, w);
    if ((*e.refine)[0]) refine(n, 1, L, e.G, e.factors, right, w, left, REFINED, &turns);
    for (long i = 0; i < n; i++)
      for (int l = 0; l < count; l++) free_[(k + l) * n + i] = e.units[i % m][0] * w[i][l];
  }
  free(right);
  return 1;
}

/* y and v (stages, m) at the stages of a step from a state x (2 m) with accelerations w (stages, m). */
static void follow_step(const Rule *r, double h, const double *x, const double *w, double *y, double *v) {
  int m = r->m, s = r->stages;
  for (int i = 0; i < s; i++)
    for (int p = 0; p < m; p++) {
      double rate = 0.0, place = 0.0;
      for (int j = 0; j < s; j++) { rate += r->a[i * s + j] * w[j * m + p]; place += r->square[i * s + j] * w[j * m + p]; }
      v[i * m + p] = x[m + p] + h * rate;
      y[i * m + p] = x[p] + h * r->c[i] * x[m + p] + h * h * place;
    }
}

/* Newton's step from a motion whose residuals are F (steps, stages, m) to one that begins at `start` (2 m): states x (steps + 1, 2 m) at the edges,
 * y, v and accelerations w (steps, stages, m) are changed; added: room as for w. Returns the largest change of a state against scale (2 m):
 * infinite where one is no number, negative without memory. */
static double correct(const Rule *r, int steps, const double *lengths, double *kept, const double *by_start, const double *Phi, const double *F,
                      const double *start, const double *scale, double *added, double *x, double *y, double *v, double *w) {
  int m = r->m, stages = r->stages, columns = 2 * m;
  long n = (long)stages * m;
  double step[columns], next[columns], change = 0.0;
  if (!solve_steps(m, stages, steps, kept, F, added)) return -1.0;
  for (int c = 0; c < columns; c++) step[c] = start[c] - x[c];
  for (int k = 0; k <= steps; k++) {
    double *to = x + k * columns, *own = w + k * n;
    const double *moved = added + k * n;
    for (int c = 0; c < columns; c++) {
      double part = fabs(step[c]) / scale[c];
      to[c] += step[c];
      change = part <= change ? change : isfinite(part) ? part : INFINITY;
    }
    if (k == steps) break;
    double h = lengths[k];
    for (int c = 0; c < columns; c++) {
      next[c] = 0.0;
      for (int q = 0; q < columns; q++) next[c] += Phi[(k * columns + c) * columns + q] * step[q];
    }
    for (int i = 0; i < stages; i++)
      for (int p = 0; p < m; p++) {
        next[p] += h * h * r->b[i] * (1.0 - r->c[i]) * moved[i * m + p];
        next[m + p] += h * r->b[i] * moved[i * m + p];
      }
    for (long i = 0; i < n; i++) {
      own[i] += moved[i];
      for (int c = 0; c < columns; c++) own[i] += by_start[(k * n + i) * columns + c] * step[c];
    }
    follow_step(r, h, to, own, y + k * n, v + k * n);
    memcpy(step, next, sizeof step);
  }
  return change;
}

/* torque (points, inputs) = offset - gain [y; v], gain (points, inputs, 2 m). */
static void command(int m, int inputs, long points, const double *gain, const double *offset, const double *y, const double *v, double *torque) {
  for (long j = 0; j < points; j++)
    for (int i = 0; i < inputs; i++) {
      const double *row = gain + (j * inputs + i) * 2 * m;
      double sum = offset[j * inputs + i];
      for (int p = 0; p < m; p++) sum -= row[p] * y[j * m + p] + row[m + p] * v[j * m + p];
      torque[j * inputs + i] = sum;
    }
}

/* Whether what the sweeps still leave over does not count: rule: slow, share, stalled, least; left: the share of the last change that a sweep
 * leaves, of which the least is believed: one sweep may come out small by chance, after wild ones too. */
static int settled(double change, double left, const double *rule, double tol) {
  if (left >= rule[0]) return change <= (isfinite(left) ? rule[2] : rule[1]) * tol;
  left = fmax(left, rule[3]);
  return change * left / (1.0 - left) <= rule[1] * tol;
}

/* Newton's sweeps over a window of steps with the same factors, until they settle or call for others. A sweep corrects the motion x, y, v, w by its
 * residuals F, of which those at hand are taken where known > 0; others come from the torque, offset - gain [y; v], and the program in code, whose
 * inputs `in` and outputs `out` are these arrays, among them F. Without a program (count 0), or where `once` > 0, one sweep is made.
 * state: sweeps so far, and the last change; rule: slow, share, stalled, least, grown, the most sweeps; tol.
 * Returns 0 where another sweep is to be made, 1 settled, 2 slow, 3 lost, -1 without memory; what is settled has the torque of its motion. */
CALLED int sweep_steps(int m, int stages, int steps, int inputs, const double *lengths, const double *tableau, double *kept, const double *by_start,
                       const double *Phi, const double *gain, const double *offset, const double *start, const double *scale, double tol,
                       const double *rule, int known, int once, long count, const Step *code, const double *const *in, const long *rows, double *const *out,
                       const long *sizes, double *work, double *state, double *F, double *torque, double *x, double *y, double *v, double *w) {
  Rule r = read_rule(m, stages, tableau);
  long points = (long)steps * stages, numbers = points * m;
  double *added = malloc(numbers * sizeof(double));
  int found = 0;
  if (!added) return -1;
  while (!found) {
    if (!known) {
      command(m, inputs, points, gain, offset, y, v, torque);
      run_program(count, code, points, in, rows, out, sizes, work);
    }
    known = 0;
    double sum = 0.0;
    for (long i = 0; i < numbers; i++) sum += 0.0 * F[i];
    if (!(sum == 0.0)) { found = 3; break; }
    double change = correct(&r, steps, lengths, kept, by_start, Phi, F, start, scale, added, x, y, v, w);
    double left = state[1] > 0.0 ? change / state[1] : 0.0;
    state[0] += 1.0;
    if (change < 0.0) found = -1;
    else if (!isfinite(change)) found = 3;
    else if (settled(change, state[0] > 1.0 ? left : INFINITY, rule, tol)) found = 1;
    else if ((state[0] > 2.0 && left > rule[4]) || state[0] >= rule[5]) found = 3;
    else if (state[0] > 1.0 && left >= rule[0]) found = 2;
    state[1] = change;
    if (once || !count) break;
  }
  if (found == 1) command(m, inputs, points, gain, offset, y, v, torque);
  free(added);
  return found;
}

/* States (points, 2 m) at times t between the edges (steps + 1,), and the work done since the first of them, by the polynomials through the
 * stages: powers (stages, stages) makes their coefficients, power (steps, stages) is the rate of the work. */
CALLED void read_steps(int m, int stages, int steps, long points, const double *edges, const double *tableau, const double *powers, const double *x,
                       const double *w, const double *power, const double *t, double *states, double *work) {
  const Rule r = read_rule(m, stages, tableau);
  long n = (long)stages * m;
  double once[stages], twice[stages], done[steps];
  for (int k = 0; k < steps; k++) {
    done[k] = k ? done[k - 1] : 0.0;
    for (int i = 0; i < stages && k; i++) done[k] += (edges[k] - edges[k - 1]) * r.b[i] * power[(k - 1) * stages + i];
  }
  for (long j = 0; j < points; j++) {
    int k = 0, past = steps;
    while (past - k > 1) { /* edges[k] < t <= edges[k + 1] */
      int middle = (k + past) / 2;
      if (edges[middle] < t[j]) k = middle;
      else past = middle;
    }
    double h = edges[k + 1] - edges[k], u = (t[j] - edges[k]) / h, factor = u;
    const double *from = x + k * 2 * m, *own = w + k * n;
    for (int i = 0; i < stages; i++) once[i] = twice[i] = 0.0;
    for (int q = 0; q < stages; q++, factor *= u)
      for (int i = 0; i < stages; i++) {
        once[i] += factor / (q + 1) * powers[q * stages + i];
        twice[i] += factor * u / ((q + 1) * (q + 2)) * powers[q * stages + i];
      }
    work[j] = done[k];
    for (int i = 0; i < stages; i++) work[j] += h * once[i] * power[k * stages + i];
    for (int p = 0; p < m; p++) {
      double rate = 0.0, place = 0.0;
      for (int i = 0; i < stages; i++) { rate += once[i] * own[i * m + p]; place += twice[i] * own[i * m + p]; }
      states[j * 2 * m + p] = from[p] + h * u * from[m + p] + h * h * place;
      states[j * 2 * m + m + p] = from[m + p] + h * rate;
    }
  }
}
