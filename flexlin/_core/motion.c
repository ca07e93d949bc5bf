/* How far perturbations of the factors move the logs of a product's eigenvalues: first order by left and right vectors, and what clusters add.
 * Sources: Stewart, Sun, Matrix Perturbation Theory (1990), IV.1.3, V.2; for products Benner, Mehrmann, Xu (2002). */
#include "schur.h"

static const double COHERENT = 0.25; /* the part of the rounding errors that may add up with one sign */
static const double CANCELLED = 0.3; /* the part of the factors' errors that counts even where their sum cancels */
static const double UNKNOWN = 1e100; /* a bound that says nothing: a number, since infinity stands for what decays too fast to be resolved */
static const double SAME[] = {1e-6, 1e-3, 0.1}; /* of ratios of multipliers that count as equal; wider ones where a perturbation is larger than gaps */
static const double ALONE = 0.01; /* an eigenvalue that moves by less than this part of the distance to its neighbour is in no block */
static const double CLOSE = 0.1; /* couplings above this part of a gap move the pair by about their own size: of m multipliers of a split chain
                                  * by 1 / (2 m sin(pi / m)) */
static const double DOUBTED = 2.0; /* how many times the method's coupling counts where it is asked what has split a pair: better factors err too */
static const double LOST = 1.0;   /* motion of a log by rounding, from which on nothing is known of a mode */
static const double APART = 1.0;  /* least distance of logs between modes without memory, wherever rounding puts them, and the others */
static const double POWERS = 64.0; /* of non-negative matrices, whose sizes say how they grow */
static const double MOST = 300.0;  /* logarithm of the largest ratio of growths that differs from larger ones */

/* exp(log_i - log_j). */
static cpx find_ratio(cpx i, cpx j) {
  double angle = cimag(i - j);
  return exp(fmin(creal(i - j), MOST)) * CMPLX(cos(angle), sin(angle));
}

/* X := N^-1 (X o r) for upper triangular X, N = T / diag(t), r_ji = t_i / t_j: one factor back. The modes from `alive` on stay one block, whose
 * basis is that of the Schur form: X := T_a^-1 (X T_d - T_ad). */
static void step_back(int n, int alive, const cpx *T, cpx *X) {
  for (int j = alive - 1; j >= 0; j--) {
    cpx t = T[j * n + j];
    for (int i = j + 1; i < alive; i++) X[j * n + i] = times(X[j * n + i], over(T[i * n + i], t));
    for (int i = n - 1; i >= alive; i--) {
      cpx sum = 0.0;
      for (int l = alive; l <= i; l++) sum += times(X[j * n + l], T[l * n + i]);
      X[j * n + i] = over(sum, t);
    }
    for (int l = j + 1; l < n; l++) {
      cpx a = over(T[j * n + l], t);
      for (int i = l; i < n; i++) X[j * n + i] -= times(a, X[l * n + i]);
    }
  }
}

/* X unit upper triangular with X = S (X o r) for the whole period; entries between multipliers whose ratio is 1 up to `same` stay zero, and what
 * couples these is left in N. */
static void close_period(int n, int alive, double same, const cpx *S, const cpx *total, cpx *X, cpx *N) {
  for (int e = 0; e < n * n; e++) { X[e] = e % (n + 1) == 0; N[e] = 0.0; }
  for (int i = 0; i < alive; i++)
    for (int j = i - 1; j >= 0; j--) {
      cpx own = 1.0 - find_ratio(total[i], total[j]), sum = S[j * n + i];
      for (int l = j + 1; l < i; l++) sum += times(S[j * n + l], times(find_ratio(total[i], total[l]), X[l * n + i])) - times(X[j * n + l], N[l * n + i]);
      if (cabs(own) < same) N[j * n + i] = sum;
      else X[j * n + i] = over(sum, own);
    }
}

/* L = X^-1 Q^H for unit upper triangular X. */
static void find_left(int n, const cpx *X, const cpx *Q, cpx *L) {
  for (int i = n - 1; i >= 0; i--) {
    for (int j = 0; j < n; j++) L[i * n + j] = conj(Q[j * n + i]);
    for (int k = i + 1; k < n; k++)
      for (int j = 0; j < n; j++) L[i * n + j] -= times(X[i * n + k], L[k * n + j]);
  }
}

/* C = A B, A complex (n, m), B real (m, p). */
static void multiply_mixed(int n, int m, int p, const cpx *A, const double *B, cpx *C) {
  for (int i = 0; i < n; i++) {
    cpx *row = C + (long)i * p;
    for (int j = 0; j < p; j++) row[j] = 0.0;
    for (int k = 0; k < m; k++)
      for (int j = 0; j < p; j++) row[j] += A[(long)i * m + k] * B[(long)k * p + j];
  }
}

/* Lengths of the rows, or of the columns, of A (n, n). */
static void find_lengths(int n, const cpx *A, int columns, double *lengths) {
  for (int i = 0; i < n; i++) {
    double sum = 0.0;
    for (int j = 0; j < n; j++) {
      double size = size_of(A[columns ? j * n + i : i * n + j]);
      sum += size * size;
    }
    lengths[i] = sqrt(sum);
  }
}

/* What is summed over the factors: method (n, n) of moduli, shift (n,), rounding (n, n) of squares and of sizes, noise (n, n). The modes from
 * `alive` on are without memory; the log of their largest multiplier is at most `reach`, block (2 n n). */
typedef struct {
  double *method, *squares, *sizes, *noise, *block, *own, *rows, *columns, *units, reach;
  cpx *shift, *X, *R, *L, *S, *N, *work;
  int alive;
} Sums;

/* Bounds on the couplings |L G| E |H R| by what is not known over factor k, in coordinates of the unscaled states. */
static void add_noise(int n, int k, const Noise *given, const double *scale, const Sums *s) {
  int p = given->p, q = given->q;
  cpx *left = s->work, *turned = left + (long)n * (n + p), *right = turned, *out = right + (long)n * n;
  double *sums = (double *)(out + (long)q * n);
  for (int e = 0; e < n * n; e++) {
    left[e] = s->L[e] / scale[e % n];
    right[e] = s->R[e] * scale[e / n];
  }
  if (given->left) {
    multiply_mixed(n, n, p, left, given->left + (long)k * n * p, left + n * n);
    left += n * n;
  }
  if (given->right) {
    multiply_real_left(q, n, given->right + (long)k * q * n, right, out);
    right = out;
  }
  const double *E = given->size + (long)k * p * q;
  for (int i = 0; i < n; i++) {
    for (int b = 0; b < q; b++) sums[b] = 0.0;
    for (int a = 0; a < p; a++) {
      double size = size_of(left[i * p + a]);
      for (int b = 0; b < q; b++) sums[b] += size * E[a * q + b];
    }
    for (int b = 0; b < q; b++)
      for (int j = 0; j < n; j++) s->noise[i * n + j] += sums[b] * size_of(right[b * n + j]);
  }
}

/* The size of a rounding of a factor (n, n). */
static double measure_rounding(int n, const double *factor) {
  double size = 0.0;
  for (int e = 0; e < n * n; e++) size += factor[e] * factor[e];
  return EPS * sqrt(size);
}

/* block := block B, for B of non-negative numbers (d, d) in work, up to its largest entry, whose log is added to `reach`. */
static void multiply_sizes(int d, const double *B, Sums *s) {
  double largest = TINY, *product = s->block + d * d;
  multiply_real(d, s->block, B, product);
  for (int e = 0; e < d * d; e++) largest = fmax(largest, product[e]);
  for (int e = 0; e < d * d; e++) s->block[e] = product[e] / largest;
  s->reach += log(largest);
}

/* What the block of modes without memory is at the most by one factor more, whatever its rounding is, and by the changes (n, n; or none). */
static void carry_block(int n, const cpx *T, const cpx *changes, double rounding, Sums *s) {
  int a = s->alive, d = n - a;
  double *B = (double *)s->work;
  if (!d) return;
  for (int i = 0; i < d; i++)
    for (int j = 0; j < d; j++) {
      int e = (a + i) * n + a + j;
      B[i * d + j] = cabs(T[e]) + (changes ? DOUBTED * size_of(changes[e]) : 0.0) + rounding * s->rows[a + i] * s->columns[a + j];
    }
  multiply_sizes(d, B, s);
}

/* What factor k adds: `better` less it, and its rounding, between the left vectors behind it and the right ones before it. */
static void add_factor(int n, int k, const Form *f, const double *factor, const double *better, double count, Sums *s) {
  const cpx *T = f->T + (long)k * n * n;
  double size = measure_rounding(n, factor), *rows = s->rows;
  cpx *moved = s->work + (long)n * n, *all = moved + (long)n * n;
  if (better) {
    double *change = (double *)s->work;
    for (int e = 0; e < n * n; e++) change[e] = better[e] - factor[e];
    multiply_real_left(n, n, change, s->R, moved);
    multiply_complex(n, s->L, moved, all);
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) {
        int by = i < s->alive ? i : j; /* what goes over to modes without memory counts against the mode that it comes from */
        cpx x = over(all[i * n + j], T[by * n + by]);
        s->method[i * n + j] += size_of(x);
        if (i == j) s->shift[i] += x;
      }
  }
  find_lengths(n, s->L, 0, rows);
  find_lengths(n, s->R, 1, s->columns);
  for (int i = 0; i < n; i++) s->units[i] = size / cabs(T[i * n + i]);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double x = rows[i] * s->units[i < s->alive ? i : j] * s->columns[j];
      s->sizes[i * n + j] += count * x;
      s->squares[i * n + j] += count * x * x;
    }
  carry_block(n, T, better ? all : NULL, count * size, s);
}

/* X of the modes without memory at the end of the period: what they are a period before, in the bases there. They have lost what they were, so
 * that a period is enough. */
static void close_block(const Form *f, Sums *s) {
  int n = f->n, a = s->alive, d = n - a;
  long size = (long)n * n;
  cpx *X = s->work, *turned = X + size;
  double *B = (double *)(turned + size);
  memcpy(X, s->X, size * sizeof(cpx));
  for (int k = f->count - 1; k >= 0; k--) step_back(n, a, f->T + k * size, X);
  for (int i = 0; i < d; i++)
    for (int j = 0; j < d; j++) {
      cpx sum = 0.0;
      for (int l = 0; l < n; l++) sum += times(conj(f->Q[l * n + a + i]), f->Q[f->count * size + l * n + a + j]);
      turned[i * d + j] = sum;
      B[i * d + j] = cabs(sum);
      s->block[i * d + j] = i == j;
    }
  for (int j = 0; j < a; j++)
    for (int i = 0; i < d; i++) {
      cpx sum = 0.0;
      for (int l = 0; l < d; l++) sum += times(X[j * n + a + l], turned[l * d + i]);
      s->X[j * n + a + i] = over(sum, f->turn[j]);
    }
  multiply_sizes(d, B, s);
}

/* The log of the largest multiplier of the modes without memory at the most: by powers of what they are after a period. */
static double bound_block(int d, Sums *s) {
  double power = 1.0;
  for (; power < POWERS; power *= 2.0) {
    s->reach *= 2.0;
    multiply_sizes(d, s->block, s);
  }
  return (s->reach + log(d)) / power;
}

/* Carry the eigenvectors backwards through all factors and sum what each adds. Returns 0 where modes that are not ordered by their growth grow
 * too far apart on the way for eigenvectors in double precision. */
static int sum_factors(double same, const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise,
                       const double *scale, Sums *s) {
  int n = f->n, count = f->count, alive = s->alive;
  long size = (long)n * n;
  s->reach = INFINITY;
  for (long e = 0; e < size; e++) {
    s->method[e] = s->squares[e] = s->sizes[e] = s->noise[e] = 0.0;
    s->X[e] = e % (n + 1) == 0;
  }
  for (int i = 0; i < n; i++) s->shift[i] = 0.0;
  for (int k = count - 1; k >= 0; k--) step_back(n, alive, f->T + k * size, s->X);
  for (long e = 0; e < size; e++) {
    if (!isfinite(creal(s->X[e])) || !isfinite(cimag(s->X[e]))) return 0;
    s->S[e] = s->X[e];
  }
  close_period(n, alive, same, s->S, f->logs, s->X, s->N);
  for (int j = 0; j < alive; j++)
    for (int i = j + 1; i < alive; i++) s->X[j * n + i] = times(s->X[j * n + i], over(f->turn[i], f->turn[j]));
  s->reach = 0.0;
  if (alive < n) close_block(f, s);
  find_left(n, s->X, f->Q + count * size, s->L);
  for (int k = count - 1; k >= 0; k--) {
    step_back(n, alive, f->T + k * size, s->X);
    multiply_complex(n, f->Q + k * size, s->X, s->R);
    add_factor(n, k, f, factors + k * size, better ? better + k * size : NULL, counts[k], s);
    find_left(n, s->X, f->Q + k * size, s->L);
    if (noise) add_noise(n, k, noise, scale, s);
  }
  find_lengths(n, s->L, 0, s->rows);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double *to = s->sizes + i * n + j;
      double defect = fmax(f->defect[i < alive ? i : j], f->defect[j < alive ? j : i]);
      *to = fmax(sqrt(s->squares[i * n + j]), COHERENT * *to) + defect * s->rows[i] * s->columns[j] + s->noise[i * n + j];
    }
  return 1;
}

static double find_distance(cpx a, cpx b) { return hypot(creal(a - b), wrap_angle(cimag(a - b))); }

/* Elsner's bound (|N| + |E|)^(1 - 1/m) |E|^(1/m) for each block of m multipliers that N couples. */
static double bound_shared(int n, int i, const double *coupling, const cpx *N) {
  double worst = 0.0;
  for (int row = 0; row < n; row++) { /* the block of a row: itself and what it is coupled to */
#define LINKED(a) ((a) == row || size_of(N[row * n + (a)]) + size_of(N[(a) * n + row]) > 0.0)
    int members = 0;
    double E = 0.0, shared = 0.0;
    if (!LINKED(i)) continue;
    for (int a = 0; a < n; a++) {
      if (!LINKED(a)) continue;
      members++;
      for (int b = 0; b < n; b++)
        if (LINKED(b)) {
          double x = coupling[a * n + b], y = size_of(N[a * n + b]);
          E += x * x;
          shared += y * y;
        }
    }
    E = sqrt(E);
    if (members > 1) worst = fmax(worst, pow(sqrt(shared) + E, 1.0 - 1.0 / members) * pow(E, 1.0 / members));
  }
#undef LINKED
  return worst;
}

/* What pairs of eigenvalues do to eigenvalue i beyond first order: A_ij A_ji / gap, but never more than twice its root; own: first-order motions,
 * which may close gaps; whole: all that may have split a pair. */
static double bound_pairs(int n, int alive, int i, const Form *f, const double *coupling, const double *own, const double *whole, const cpx *N) {
  double sum = 0.0;
  for (int j = 0; j < n; j++) {
    if (j == i) continue;
    double gap = j < alive ? find_distance(f->logs[i], f->logs[j]) - own[i] - own[j] : 1.0;
    double size = sqrt(coupling[i * n + j] * coupling[j * n + i]), splitting = sqrt(whole[i * n + j] * whole[j * n + i]);
    gap = gap > 0.0 || isnan(gap) ? gap : 0.0;
    sum += splitting > CLOSE * gap ? 2.0 * splitting : size * size / fmax(gap, size + TINY);
  }
  return sum + bound_shared(n, i, coupling, N);
}

static double known(double bound) { return bound < UNKNOWN ? bound : UNKNOWN; }

/* Bounds on the motion of each log, (n,), when multipliers whose ratio is 1 up to `same` are left in one block. */
static void bound_at(double same, const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise,
                     const double *scale, Sums *s, cpx *shift, double *method, double *rounding) {
  int n = f->n;
  double *own = s->own, *whole = s->squares;
  for (int i = 0; i < n; i++) { shift[i] = 0.0; method[i] = rounding[i] = UNKNOWN; }
  for (int i = s->alive; i < n; i++) { method[i] = 0.0; rounding[i] = INFINITY; }
  if (!sum_factors(same, f, factors, better, counts, noise, scale, s)) return;
  for (int e = 0; e < n * n; e++) whole[e] = DOUBTED * s->method[e] + s->sizes[e];
  for (int i = 0; i < s->alive; i++) { shift[i] = s->shift[i]; own[i] = cabs(shift[i]); }
  for (int i = 0; i < s->alive; i++)
    method[i] = known(fmax(own[i], CANCELLED * s->method[i * n + i]) + bound_pairs(n, s->alive, i, f, s->method, own, whole, s->N));
  for (int i = 0; i < s->alive; i++) own[i] = s->sizes[i * n + i];
  for (int i = 0; i < s->alive; i++) rounding[i] = known(own[i] + bound_pairs(n, s->alive, i, f, s->sizes, own, s->sizes, s->N) + 4 * EPS * cabs(f->logs[i]));
}

/* The same, of the levels of `same` that say the least of an eigenvalue; other (2 n), moved (n). */
static void bound_levels(const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise, const double *scale,
                         Sums *s, cpx *shift, double *method, double *rounding, double *other, cpx *moved) {
  int n = f->n, levels = sizeof SAME / sizeof *SAME;
  bound_at(SAME[0], f, factors, better, counts, noise, scale, s, shift, method, rounding);
  for (int level = 1; level < levels; level++) {
    int alone = 1;
    for (int i = 0; i < s->alive; i++)
      for (int j = 0; j < s->alive; j++)
        if (i != j && !(method[i] + rounding[i] < ALONE * find_distance(f->logs[i], f->logs[j]))) alone = 0;
    if (alone) break;
    bound_at(SAME[level], f, factors, better, counts, noise, scale, s, moved, other, other + n);
    for (int i = 0; i < n; i++) { method[i] = fmin(method[i], other[i]); rounding[i] = fmin(rounding[i], other[n + i]); }
  }
}

/* Whether rounding leaves something of all modes before `alive`: it moves no log by LOST. */
static int are_known(int n, const Sums *s) {
  for (int i = 0; i < s->alive; i++)
    if (!(s->sizes[i * (n + 1)] < LOST)) return 0;
  return 1;
}

/* Bounds on the motion of each log: by better factors (or none), and by rounding, of which each factor carries `counts`.
 *
 * Modes of which rounding leaves nothing say nothing of the others: if wherever it puts them they decay beside these, theirs is infinite. Those of
 * differential equations, whose coefficients are not known exactly, have a memory. */
int bound_motion(const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise, const double *scale,
                 cpx *shift, double *method, double *rounding) {
  int n = f->n;
  long size = (long)n * n, room = noise ? size + (long)n * noise->p + size + (long)noise->q * (n + 1) : 0;
  double *memory = malloc((6 * size + 6L * n) * sizeof(double)), *lengths = memory ? memory + 6 * size : NULL;
  cpx *space = malloc((5 * size + 2 * n + (room > 3 * size ? room : 3 * size)) * sizeof(cpx)), *moved = space + n;
  if (!memory || !space) { free(memory); free(space); return NO_MEMORY; }
  Sums s = {memory, memory + size, memory + 2 * size, memory + 3 * size, memory + 4 * size, lengths, lengths + n, lengths + 2 * n, lengths + 3 * n,
            0.0, space, space + 2 * n, space + 2 * n + size, space + 2 * n + 2 * size, space + 2 * n + 3 * size, space + 2 * n + 4 * size,
            space + 2 * n + 5 * size, n};
  for (int alive = n;; s.alive = alive ? alive : n) {
    bound_levels(f, factors, better, counts, noise, scale, &s, shift, method, rounding, lengths + 4 * n, moved);
    double reach = s.alive < n ? bound_block(n - s.alive, &s) : -INFINITY;
    if (noise || alive == 0 || (are_known(n, &s) && reach < fmin(0.0, creal(f->logs[alive - 1]) - APART))) break;
    do alive--;
    while (alive > 0 && creal(f->logs[alive]) > creal(f->logs[alive - 1]) - APART);
  }
  free(memory);
  free(space);
  return SOUND;
}
