/* Rounds of decoupling for modes whose shapes hardly change, eight nodes of the period at a time: the computation of coordinates.py.
 *
 * Matrices are complex, n x n, real and imaginary parts apart: a block holds eight nodes of one matrix. Columns and rows come in
 * conjugate pairs (mate), so products are made for the first row of each pair only. C^-1 is made without pivoting: C is near 1 but for
 * a scaling of rows and columns, which elimination does not see.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef double v8 __attribute__((vector_size(64)));
typedef struct { int n, leaders, *leader, *mate; } Shape;

static inline v8 splat(double x) { return (v8){x, x, x, x, x, x, x, x}; }

/* The rows of conjugate modes are conjugate, columns exchanged. A: n n real parts, then n n imaginary ones. */
static void mirror(const Shape *s, v8 *A) {
  int n = s->n, size = n * n;
  for (int l = 0; l < s->leaders; l++) {
    int i = s->leader[l], k = s->mate[i];
    if (k == i) continue;
    for (int j = 0; j < n; j++) {
      A[k * n + s->mate[j]] = A[i * n + j];
      A[size + k * n + s->mate[j]] = -A[size + i * n + j];
    }
  }
}

/* C = A B, the leaders' rows, one block. */
static void multiply(const Shape *s, const v8 *restrict A, const v8 *restrict B, v8 *restrict C) {
  int n = s->n, size = n * n;
  for (int l = 0; l < s->leaders; l++) {
    const v8 *a = A + s->leader[l] * n;
    int j = 0;
    for (; j + 2 <= n; j += 2) {
      v8 r0 = splat(0.0), i0 = r0, r1 = r0, i1 = r0;
      for (int k = 0; k < n; k++) {
        v8 x = a[k], y = a[size + k];
        const v8 *b = B + k * n + j;
        r0 += x * b[0] - y * b[size];
        i0 += x * b[size] + y * b[0];
        r1 += x * b[1] - y * b[size + 1];
        i1 += x * b[size + 1] + y * b[1];
      }
      v8 *c = C + s->leader[l] * n + j;
      c[0] = r0; c[size] = i0; c[1] = r1; c[size + 1] = i1;
    }
    for (; j < n; j++) {
      v8 r = splat(0.0), i = r;
      for (int k = 0; k < n; k++) {
        const v8 *b = B + k * n + j;
        r += a[k] * b[0] - a[size + k] * b[size];
        i += a[k] * b[size] + a[size + k] * b[0];
      }
      C[s->leader[l] * n + j] = r;
      C[size + s->leader[l] * n + j] = i;
    }
  }
}

/* X := A^-1 X, one block; A is lost. */
static void solve(int n, v8 *restrict A, v8 *restrict X) {
  int size = n * n;
  for (int k = 0; k < n; k++) {
    v8 x = A[k * n + k], y = A[size + k * n + k], over = 1.0 / (x * x + y * y);
    v8 pr = x * over, pi = -y * over;
    for (int pass = 0; pass < 2; pass++) {
      v8 *row = (pass ? X : A) + k * n;
      for (int j = pass ? 0 : k + 1; j < n; j++) {
        v8 r = row[j], i = row[size + j];
        row[j] = r * pr - i * pi;
        row[size + j] = r * pi + i * pr;
      }
    }
    for (int i = k + 1; i < n; i++) {
      v8 fr = A[i * n + k], fi = A[size + i * n + k];
      for (int pass = 0; pass < 2; pass++) {
        v8 *row = (pass ? X : A) + i * n;
        const v8 *top = (pass ? X : A) + k * n;
        for (int j = pass ? 0 : k + 1; j < n; j++) {
          row[j] -= fr * top[j] - fi * top[size + j];
          row[size + j] -= fr * top[size + j] + fi * top[j];
        }
      }
    }
  }
  for (int k = n - 1; k >= 0; k--)
    for (int i = 0; i < k; i++) {
      v8 fr = A[i * n + k], fi = A[size + i * n + k];
      for (int j = 0; j < n; j++) {
        X[i * n + j] -= fr * X[k * n + j] - fi * X[size + k * n + j];
        X[size + i * n + j] -= fr * X[size + k * n + j] + fi * X[k * n + j];
      }
    }
}

/* Complex numbers (nodes, n, n), every `step`th of them from `first` on, into blocks, and back. */
static void gather(int n, int nodes, int step, int first, const double *from, v8 *to) {
  int size = n * n;
  for (int t = 0; t < nodes; t++) {
    const double *x = from + 2L * size * (first + (long)step * t);
    double *y = (double *)(to + 2L * size * (t / 8)) + t % 8;
    for (int e = 0; e < size; e++) { y[8 * e] = x[2 * e]; y[8 * (size + e)] = x[2 * e + 1]; }
  }
}
static void scatter(int n, int nodes, int step, int first, const v8 *from, double *to) {
  int size = n * n;
  for (int t = 0; t < nodes; t++) {
    double *x = to + 2L * size * (first + (long)step * t);
    const double *y = (const double *)(from + 2L * size * (t / 8)) + t % 8;
    for (int e = 0; e < size; e++) { x[2 * e] = y[8 * e]; x[2 * e + 1] = y[8 * (size + e)]; }
  }
}

/* out = (columns of waves)' x for one entry: x at the nodes, waves (nodes, 8 width) real, out (8 width) complex. */
static void transform(int nodes, int width, const v8 *waves, const double *re, const double *im, v8 *out_re, v8 *out_im) {
  for (int w = 0; w < width; w++) {
    v8 r = splat(0.0), i = r;
    for (int t = 0; t < nodes; t++) {
      v8 wave = waves[t * width + w];
      r += re[t] * wave;
      i += im[t] * wave;
    }
    out_re[w] = r;
    out_im[w] = i;
  }
}

enum { WIDEST = 16 }; /* v8 of cosines and sines of 64 nodes */

/* One step S of an entry: S_k = R_k / (i k w - gap) for the harmonics k <= most whose divisor is large enough, and its slope.
 *
 * returns the root mean square of what is left of R; largest: of |S|. */
static double take_step(int blocks, int most, int width, const v8 *forth, const v8 *back, double w, double gap_re, double gap_im,
                        double least, v8 *re, v8 *im, v8 *slope_re, v8 *slope_im, double *largest) {
  int nodes = 8 * blocks;
  double x[64], y[64], left = 0.0;
  for (int b = 0; b < blocks; b++)
    for (int l = 0; l < 8; l++) { x[8 * b + l] = re[b][l]; y[8 * b + l] = im[b][l]; }
  v8 fr[WIDEST], fi[WIDEST];
  transform(nodes, width, forth, x, y, fr, fi);
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
      } else pr[side] = pi[side] = 0.0;
    }
    if (k == 0) pr[1] = pi[1] = 0.0;
    /* p exp(i phi) + q exp(-i phi) = (p + q) cos phi + i (p - q) sin phi */
    double ur = pr[0] + pr[1], ui = pi[0] + pi[1], vr = -(pi[0] - pi[1]), vi = pr[0] - pr[1], kw = k * w;
    for (int b = 0; b < blocks; b++) {
      v8 cosine = back[(2 * k) * blocks + b], sine = back[(2 * k + 1) * blocks + b];
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
  return sqrt(left > 0.0 ? left : 0.0);
}

typedef struct { int blocks, most, width; const v8 *forth, *back; double w, near; } Waves;

/* Step and slope for all pairs outside of the groups, from B; returns the largest effect of what is coupled against what is allowed. */
static double take_steps(const Shape *s, const Waves *f, const unsigned char *outside, const double *allowed, const v8 *B, v8 *step, v8 *slope,
                         double *left, double *largest) {
  int n = s->n, size = n * n, blocks = f->blocks;
  double mean_re[n], mean_im[n], worst = 0.0;
  for (int i = 0; i < n; i++) {
    mean_re[i] = mean_im[i] = 0.0;
    for (int b = 0; b < blocks; b++)
      for (int l = 0; l < 8; l++) {
        mean_re[i] += B[2 * size * b + i * (n + 1)][l] / (8 * blocks);
        mean_im[i] += B[2 * size * b + size + i * (n + 1)][l] / (8 * blocks);
      }
  }
  for (int q = 0; q < s->leaders; q++) {
    int i = s->leader[q];
    for (int j = 0; j < n; j++) {
      v8 re[8], im[8], dre[8], dim[8];
      double rest = 0.0, most = 0.0, gr = mean_re[i] - mean_re[j], gi = mean_im[i] - mean_im[j];
      for (int b = 0; b < blocks; b++) { re[b] = B[2 * size * b + i * n + j]; im[b] = B[2 * size * b + size + i * n + j]; }
      if (outside[i * n + j])
        rest = take_step(blocks, f->most, f->width, f->forth, f->back, f->w, gr, gi, f->near * hypot(gr, gi), re, im, dre, dim, &most);
      else
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

/* Values between the nodes and slopes: out[e] = matrix x[e] for the leaders' entries; matrix (nodes of x, blocks of out). */
static void apply(const Shape *s, int blocks, const v8 *matrix, const v8 *x, v8 *out) {
  int n = s->n, size = n * n;
  for (int q = 0; q < s->leaders; q++)
    for (int e = s->leader[q] * n; e < (s->leader[q] + 1) * n; e++) {
      double re[64], im[64];
      v8 out_re[8], out_im[8];
      for (int b = 0; b < blocks; b++)
        for (int l = 0; l < 8; l++) { re[8 * b + l] = x[2 * size * b + e][l]; im[8 * b + l] = x[2 * size * b + size + e][l]; }
      transform(8 * blocks, blocks, matrix, re, im, out_re, out_im);
      for (int b = 0; b < blocks; b++) { out[2 * size * b + e] = out_re[b]; out[2 * size * b + size + e] = out_im[b]; }
    }
  for (int b = 0; b < blocks; b++) mirror(s, out + 2 * size * b);
}

static void make_identity(int n, v8 *X) {
  for (int e = 0; e < 2 * n * n; e++) X[e] = splat(e < n * n && e % (n + 1) == 0 ? 1.0 : 0.0);
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

/* The coordinates P, their slope, their inverse and the generator, (2 nodes, n, n) complex, from `own` at the nodes and half-way between;
 * returns the number of rounds, -1 where the first step is no number, -2 where there is no memory. */
int find_coordinates(int n, int blocks, const int *mate, const unsigned char *outside, const double *own, double w, const double *allowed,
                     int most_rounds, double near, double enough, double shrink, int most, int width, const double *forth, const double *back,
                     const double *between, double *P_out, double *slope_out, double *inverse_out, double *B_out) {
  int size = 2 * n * n, nodes = 8 * blocks, leader[n], pairs[n], made = 0;
  long whole = (long)size * blocks, tables = (long)nodes * width + 2L * (most + 1) * blocks + 3L * nodes * blocks;
  v8 *memory = aligned_alloc(64, (8 * whole + 2 * size + tables) * sizeof(v8));
  double *numbers = malloc(2L * n * n * sizeof(double)), least = INFINITY;
  if (!memory || !numbers) { free(memory); free(numbers); return -2; }
  v8 *E = memory, *B = E + whole, *P = B + whole, *best = P + whole, *step = best + whole, *slope = step + whole, *next = slope + whole;
  v8 *half = next + whole, *work = half + whole, *waves = work + 2 * size, *to_nodes = waves + (long)nodes * width;
  v8 *matrices = to_nodes + 2L * (most + 1) * blocks;
  memcpy(waves, forth, (long)nodes * width * sizeof(v8));
  memcpy(to_nodes, back, 2L * (most + 1) * blocks * sizeof(v8));
  memcpy(matrices, between, 3L * nodes * blocks * sizeof(v8));
  Shape s = {n, 0, leader, pairs};
  for (int i = 0; i < n; i++) {
    pairs[i] = mate[i];
    if (i <= mate[i]) leader[s.leaders++] = i;
  }
  Waves f = {blocks, most, width, waves, to_nodes, w, near};
  gather(n, nodes, 2, 0, own, E);
  memcpy(B, E, whole * sizeof(v8));
  for (int b = 0; b < blocks; b++) make_identity(n, P + (long)size * b);
  memcpy(best, P, whole * sizeof(v8));
  for (;; made++) {
    double worst = take_steps(&s, &f, outside, allowed, B, step, slope, numbers, numbers + n * n);
    if (!(worst < shrink * least)) { made--; break; }
    least = worst;
    memcpy(best, P, whole * sizeof(v8));
    if (worst < enough || made == most_rounds) break;
    for (int b = 0; b < blocks; b++) {
      long at = (long)size * b;
      multiply(&s, P + at, step + at, next + at);
      mirror(&s, next + at);
      memcpy(P + at, next + at, size * sizeof(v8));
      multiply(&s, B + at, step + at, next + at);
      mirror(&s, next + at);
      for (int e = 0; e < size; e++) B[at + e] = next[at + e] - slope[at + e];
      solve(n, step + at, B + at);
    }
  }
  gather(n, nodes, 2, 1, own, half);
  apply(&s, blocks, matrices, best, P);                                     /* between the nodes */
  apply(&s, blocks, matrices + (long)nodes * blocks, best, slope);          /* slopes at the nodes */
  apply(&s, blocks, matrices + 2L * nodes * blocks, best, next);            /* slopes between */
  const v8 *places[2] = {best, P}, *slopes[2] = {slope, next}, *given[2] = {E, half};
  for (int side = 0; side < 2; side++) {
    for (int b = 0; b < blocks; b++) {
      long at = (long)size * b;
      transform_generator(&s, given[side] + at, places[side] + at, slopes[side] + at, step + at, B + at, work);
    }
    scatter(n, nodes, 2, side, places[side], P_out);
    scatter(n, nodes, 2, side, slopes[side], slope_out);
    scatter(n, nodes, 2, side, step, inverse_out);
    scatter(n, nodes, 2, side, B, B_out);
  }
  free(memory);
  free(numbers);
  return made;
}

/* Solve A X = B for n unknowns and m right sides, both lost; returns 0 where A is singular. */
static int eliminate(int n, int m, double *A, double *B) {
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (fabs(A[i * n + k]) > fabs(A[pivot * n + k])) pivot = i;
    if (!(fabs(A[pivot * n + k]) > 0.0)) return 0;
    if (pivot != k) {
      for (int j = k; j < n; j++) { double x = A[k * n + j]; A[k * n + j] = A[pivot * n + j]; A[pivot * n + j] = x; }
      for (int j = 0; j < m; j++) { double x = B[k * m + j]; B[k * m + j] = B[pivot * m + j]; B[pivot * m + j] = x; }
    }
    double over = 1.0 / A[k * n + k];
    for (int i = k + 1; i < n; i++) {
      double factor = A[i * n + k] * over;
      if (factor == 0.0) continue;
      for (int j = k + 1; j < n; j++) A[i * n + j] -= factor * A[k * n + j];
      for (int j = 0; j < m; j++) B[i * m + j] -= factor * B[k * m + j];
    }
  }
  for (int k = n - 1; k >= 0; k--)
    for (int j = 0; j < m; j++) {
      double x = B[k * m + j];
      for (int i = k + 1; i < n; i++) x -= A[k * n + i] * B[i * m + j];
      B[k * m + j] = x / A[k * n + k];
    }
  return 1;
}

/* Transition matrices (segments, p, p) by Gauss collocation from samples A (segments, stages, p, p), as gauss.py; 0 where one is singular,
 * -1 where there is no memory. */
int factor_group(int p, int segments, int stages, double h, const double *A, const double *a, const double *b, double *F) {
  int n = stages * p;
  double *G = malloc(((long)n * n + (long)n * p) * sizeof(double)), *Y = G + (long)n * n;
  if (!G) return -1;
  for (int k = 0; k < segments; k++, A += (long)stages * p * p, F += p * p) {
    for (int i = 0; i < stages; i++)
      for (int r = 0; r < p; r++)
        for (int j = 0; j < stages; j++)
          for (int c = 0; c < p; c++) G[(i * p + r) * n + j * p + c] = -h * a[i * stages + j] * A[(j * p + r) * p + c] + (i == j && r == c);
    for (int i = 0; i < n * p; i++) Y[i] = i / p % p == i % p;
    if (!eliminate(n, p, G, Y)) { free(G); return 0; }
    for (int r = 0; r < p; r++)
      for (int c = 0; c < p; c++) {
        double sum = r == c;
        for (int j = 0; j < stages; j++)
          for (int l = 0; l < p; l++) sum += h * b[j] * A[(j * p + r) * p + l] * Y[(j * p + l) * p + c];
        F[r * p + c] = sum;
      }
  }
  free(G);
  return 1;
}
