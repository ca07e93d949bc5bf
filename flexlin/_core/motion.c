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
static const double COINCIDING = 1e-12; /* by which ratios of multipliers miss 1 that vectors are parted by: what couples them is far less, or they
                                         * are one vector to that */
static const double DOUBTED = 2.0; /* how many times the method's coupling counts where it is asked what has split a pair: better factors err too */
static const double MOST = 300.0;  /* logarithm of the largest ratio of growths that differs from larger ones */
static const double LOST = 0.5;    /* motion of a log by rounding beyond which nothing is known of the multiplier */
static const double APART = 1.0;   /* of logs of modes that stand above others, at the least */
static const double CLEAR = 1e-12; /* coupling at the end of a period, at the most, from modes that stand above others */
enum { TURNS = 3, LEVELS = 32, POWERS = 64 }; /* periods in which a subspace settles; parts of a product, of 2^k factors each; powers of a product
                                               * whose lengths say how it grows */

/* exp(log_i - log_j). */
static cpx find_ratio(cpx i, cpx j) {
  double angle = cimag(i - j);
  return exp(fmin(creal(i - j), MOST)) * CMPLX(cos(angle), sin(angle));
}

/* X := T^-1 X D for upper triangular X, one factor back; D: the diagonal of T and, of the last n - p modes, the whole block. These are not parted:
 * their columns of X span their subspace, and have 1 among themselves. */
static void step_back(int n, int p, const cpx *T, cpx *X) {
  for (int j = p - 1; j >= 0; j--) {
    cpx t = T[j * n + j];
    for (int i = j + 1; i < p; i++) X[j * n + i] = times(X[j * n + i], over(T[i * n + i], t));
    for (int i = n - 1; i >= p; i--) {
      cpx sum = 0.0;
      for (int l = p; l <= i; l++) sum += times(X[j * n + l], over(T[l * n + i], t));
      X[j * n + i] = sum;
    }
    for (int l = j + 1; l < n; l++) {
      cpx a = over(T[j * n + l], t);
      for (int i = l; i < n; i++) X[j * n + i] -= times(a, X[l * n + i]);
    }
  }
}

/* X unit upper triangular with X = S (X o r) for the whole period, r_ji = mu_i / mu_j, in its first p columns; entries between multipliers whose
 * ratio is 1 up to `same` stay zero, and what couples these is left in N; without N they are parted as if their ratio missed 1 by that. */
static void close_period(int n, int p, double same, const cpx *S, const cpx *total, cpx *X, cpx *N) {
  for (int e = 0; e < n * n; e++) X[e] = e % n < p ? e % (n + 1) == 0 : S[e];
  for (int e = 0; N && e < n * n; e++) N[e] = 0.0;
  for (int i = 0; i < p; i++)
    for (int j = i - 1; j >= 0; j--) {
      cpx own = 1.0 - find_ratio(total[i], total[j]), sum = S[j * n + i];
      for (int l = j + 1; l < i; l++)
        sum += times(S[j * n + l], times(find_ratio(total[i], total[l]), X[l * n + i])) - (N ? times(X[j * n + l], N[l * n + i]) : 0.0);
      if (cabs(own) >= same) X[j * n + i] = over(sum, own);
      else if (N) N[j * n + i] = sum;
      else X[j * n + i] = sum / same;
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

/* What is summed over the factors: method (n, n) of moduli, shift (n,), rounding (n, n) of squares and of sizes, noise (n, n); and loose (count,),
 * what is not known of each factor's block of modes that are not parted, relative to that. */
typedef struct { double *method, *squares, *sizes, *noise, *own, *rows, *columns, *growth, *loose; cpx *shift, *X, *R, *L, *S, *N, *work; } Sums;

/* Bounds on the couplings |L G| E |H R| by what is not known over factor k, in coordinates of the unscaled states. */
static void add_noise(int n, int k, const Noise *given, const double *scale, const Sums *s) {
  int p = given->p, q = given->q;
  const double *E = given->size + (long)k * p * q;
  cpx *left = s->work, *right = left + (long)n * n, *turned = right + (long)n * n;
  double *reach = (double *)(turned + (long)n * (p > q ? p : q)), *sums = reach + (long)q * n;
  for (int e = 0; e < n * n; e++) {
    left[e] = s->L[e] / scale[e % n];
    right[e] = s->R[e] * scale[e / n];
  }
  if (given->right) multiply_real_left(q, n, n, given->right + (long)k * q * n, right, turned);
  for (int e = 0; e < q * n; e++) reach[e] = size_of((given->right ? turned : right)[e]);
  if (given->left) multiply_mixed(n, n, p, left, given->left + (long)k * n * p, turned);
  for (int i = 0; i < n; i++) {
    for (int b = 0; b < q; b++) sums[b] = 0.0;
    for (int a = 0; a < p; a++) {
      double size = size_of((given->left ? turned : left)[i * p + a]);
      for (int b = 0; b < q; b++) sums[b] += size * E[a * q + b];
    }
    for (int b = 0; b < q; b++)
      for (int j = 0; j < n; j++) s->noise[i * n + j] += sums[b] * reach[b * n + j];
  }
}

/* What factor k adds: `better` less it, and its rounding, between the left vectors behind it and the right ones before it. What goes over to modes
 * that are not parted counts against the mode that it comes from. Returns the size of both. */
static double add_factor(int n, int p, int k, const Form *f, const double *factor, const double *better, double count, const Sums *s) {
  const cpx *T = f->T + (long)k * n * n;
  double size = 0.0, moved = 0.0, *change = (double *)s->work;
  cpx *right = s->work + (long)n * n, *all = right + (long)n * n;
  for (int e = 0; e < n * n; e++) {
    size += factor[e] * factor[e];
    change[e] = better ? better[e] - factor[e] : 0.0;
    moved += change[e] * change[e];
  }
  size = sqrt(size) * EPS;
  multiply_real_left(n, n, n, change, s->R, right);
  multiply_complex(n, n, n, s->L, right, all);
  find_lengths(n, s->L, 0, s->rows);
  find_lengths(n, s->R, 1, s->columns);
  for (int j = 0; j < n; j++) s->growth[j] = 1.0 / cabs(T[j * (n + 1)]);
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < n; j++) {
      double by = s->growth[i < p ? i : j], x = size * s->rows[i] * s->columns[j] * by;
      s->method[i * n + j] += size_of(all[i * n + j]) * by;
      s->sizes[i * n + j] += count * x;
      s->squares[i * n + j] += count * x * x;
    }
    s->shift[i] += over(all[i * (n + 1)], T[i * (n + 1)]);
  }
  return count * size + DOUBTED * sqrt(moved);
}

/* X at the end of the period from X at its beginning. work (n). */
static void pass_end(int p, const Form *f, cpx *X, cpx *work) {
  int n = f->n;
  for (int j = 0; j < p; j++) {
    for (int i = j + 1; i < p; i++) X[j * n + i] = times(X[j * n + i], over(f->turn[i], f->turn[j]));
    for (int i = p; i < n; i++) {
      work[i] = 0.0;
      for (int l = p; l < n; l++) work[i] += times(X[j * n + l], f->closure[l * n + i]);
    }
    for (int i = p; i < n; i++) X[j * n + i] = over(work[i], f->turn[j]);
  }
}

/* |X^-1| defect |X| as noise. Modes that fall behind others and catch up within a period make the defect of their cluster large, which moves no
 * other one: the product stays triangular by clusters. */
static void add_defect(const Form *f, const Sums *s) {
  int n = f->n;
  cpx *inverse = s->work;
  double *moved = (double *)(inverse + (long)n * n), worst = 0.0;
  multiply_complex(n, n, n, s->L, f->Q, inverse);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double sum = 0.0;
      for (int a = 0; a <= j; a++) sum += f->defect[i * n + a] * size_of(s->X[a * n + j]);
      moved[i * n + j] = sum;
      worst = fmax(worst, f->defect[i * n + j]);
    }
  find_lengths(n, s->L, 0, s->rows);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double sum = 0.0;
      for (int a = i; a < n; a++) sum += size_of(inverse[i * n + a]) * moved[a * n + j];
      s->noise[i * n + j] += fmin(sum, worst * s->rows[i] * s->columns[j]);
    }
}

/* The sum of the last n - p rows and columns of values (n, n). */
static double sum_block(int n, int p, const double *values) {
  double sum = 0.0;
  for (int i = p; i < n; i++)
    for (int j = p; j < n; j++) sum += values[i * n + j];
  return sum;
}

/* The length of the last n - p rows and columns of T (n, n). */
static double measure_block(int n, int p, const cpx *T) {
  double sum = TINY;
  for (int i = p; i < n; i++)
    for (int j = p; j < n; j++) sum = hypot(sum, size_of(T[i * n + j]));
  return sum;
}

/* A product of neighbouring blocks, exp(size) G with G (b, b) of length 1, known up to `loose` of that; its length is exp(most) at the most. */
typedef struct { double size, loose, most; cpx *G; } Part;

/* The product of two parts in the place of the first one, which acts first; work (b, b). */
static void join_parts(int b, Part *first, const Part *second, cpx *work) {
  multiply_complex(b, b, b, second->G, first->G, work);
  double length = measure_block(b, 0, work), loose = first->loose + second->loose + first->loose * second->loose + b * EPS;
  first->size += second->size;
  first->most = fmin(first->most + second->most, first->size + log(length + loose));
  first->size += log(length);
  first->loose = fmin(loose / length, UNKNOWN);
  for (int e = 0; e < b * b; e++) first->G[e] = work[e] / length;
}

/* A bound on the real parts of the logs of the last n - p modes: the length of powers of their product, as it is put together best. Infinite where
 * there is no memory. */
static double bound_block(int p, const Form *f, const double *loose) {
  int n = f->n, b = n - p, parts = 0;
  long size = (long)b * b;
  cpx *memory = malloc((LEVELS + 1) * size * sizeof(cpx)), *work = memory ? memory + LEVELS * size : NULL;
  Part stack[LEVELS];
  if (!memory) return INFINITY;
  for (int k = 0; k < f->count; k++) {
    const cpx *T = f->T + (long)k * n * n;
    double length = measure_block(n, p, T);
    Part *last = stack + parts;
    *last = (Part){log(length), fmin(loose[k], UNKNOWN), log(length) + log1p(loose[k]), memory + parts * size};
    for (int e = 0; e < size; e++) last->G[e] = T[(p + e / b) * n + p + e % b] / length;
    for (int done = k; done & 1; done >>= 1, parts--) join_parts(b, stack + parts - 1, stack + parts, work);
    parts++;
  }
  for (; parts > 1; parts--) join_parts(b, stack + parts - 2, stack + parts - 1, work);
  for (int e = 0; e < size; e++) {
    work[e] = 0.0;
    for (int l = 0; l < b; l++) work[e] += times(f->closure[(p + e / b) * n + p + l], stack->G[l * b + e % b]);
  }
  memcpy(stack->G, work, size * sizeof(cpx));
  stack->loose += CLEAR;
  double most = stack->most;
  for (int power = 2; power <= POWERS; power *= 2) {
    Part same = *stack;
    join_parts(b, stack, &same, work);
    most = fmin(most, stack->most / power);
  }
  free(memory);
  return most;
}

/* X at the end of the period, as `close_period` and `step_back` have it; S (n, n), work (n). Returns 0 where modes that are not ordered by their
 * growth grow too far apart on the way for eigenvectors in double precision. */
static int close_vectors(int p, double same, const Form *f, cpx *S, cpx *X, cpx *N, cpx *work) {
  int n = f->n, count = f->count;
  long size = (long)n * n;
  for (long e = 0; e < size; e++) S[e] = e % (n + 1) == 0;
  for (int k = count - 1; k >= 0; k--) step_back(n, p, f->T + k * size, S);
  for (long e = 0; e < size; e++)
    if (!isfinite(creal(S[e])) || !isfinite(cimag(S[e]))) return 0;
  close_period(n, p, same, S, f->logs, X, N);
  for (int turn = 1; p < n && turn < TURNS; turn++) {
    pass_end(p, f, X, work);
    for (int k = count - 1; k >= 0; k--) step_back(n, p, f->T + k * size, X);
  }
  pass_end(p, f, X, work);
  return 1;
}

/* Carry the eigenvectors backwards through all factors and sum what each adds. Returns 0 where `close_vectors` does. */
static int sum_factors(int p, double same, const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise,
                       const double *scale, const Sums *s) {
  int n = f->n, count = f->count;
  long size = (long)n * n;
  for (long e = 0; e < size; e++) s->method[e] = s->squares[e] = s->sizes[e] = s->noise[e] = 0.0;
  for (int i = 0; i < n; i++) s->shift[i] = 0.0;
  if (!close_vectors(p, same, f, s->S, s->X, s->N, s->work)) return 0;
  find_left(n, s->X, f->Q + count * size, s->L);
  for (int k = count - 1; k >= 0; k--) {
    step_back(n, p, f->T + k * size, s->X);
    multiply_complex(n, n, n, f->Q + k * size, s->X, s->R);
    double moved = add_factor(n, p, k, f, factors + k * size, better ? better + k * size : NULL, counts[k], s), wide = 0.0;
    double before = sum_block(n, p, s->noise);
    find_left(n, s->X, f->Q + k * size, s->L);
    if (noise) add_noise(n, k, noise, scale, s);
    for (int j = p; j < n; j++) wide = hypot(wide, s->columns[j]);
    s->loose[k] = moved * wide / measure_block(n, p, f->T + k * size) + sum_block(n, p, s->noise) - before;
  }
  add_defect(f, s);
  for (long e = 0; e < size; e++) s->sizes[e] = fmax(sqrt(s->squares[e]), COHERENT * s->sizes[e]) + s->noise[e];
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
static double bound_pairs(int n, int p, int i, const Form *f, const double *coupling, const double *own, const double *whole, const cpx *N) {
  double sum = 0.0;
  for (int j = 0; j < n; j++) {
    if (j == i) continue;
    double gap = j < p ? find_distance(f->logs[i], f->logs[j]) - own[i] - own[j] : APART;
    double size = sqrt(coupling[i * n + j] * coupling[j * n + i]), splitting = sqrt(whole[i * n + j] * whole[j * n + i]);
    gap = gap > 0.0 || isnan(gap) ? gap : 0.0;
    sum += splitting > CLOSE * gap ? 2.0 * splitting : size * size / fmax(gap, size + TINY);
  }
  return sum + bound_shared(n, i, coupling, N);
}

static double known(double bound) { return bound < UNKNOWN ? bound : UNKNOWN; }

/* Bounds on the motion of each log, of the first p of (n,), when multipliers whose ratio is 1 up to `same` are left in one block. */
static void bound_at(int p, double same, const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise,
                     const double *scale, const Sums *s, cpx *shift, double *method, double *rounding) {
  int n = f->n;
  double *own = s->own, *whole = s->squares;
  for (int i = 0; i < n; i++) { shift[i] = 0.0; method[i] = rounding[i] = UNKNOWN; }
  if (!sum_factors(p, same, f, factors, better, counts, noise, scale, s)) return;
  for (int e = 0; e < n * n; e++) whole[e] = DOUBTED * s->method[e] + s->sizes[e];
  for (int i = 0; i < n; i++) { shift[i] = s->shift[i]; own[i] = cabs(shift[i]); }
  for (int i = 0; i < p; i++)
    method[i] = known(fmax(own[i], CANCELLED * s->method[i * n + i]) + bound_pairs(n, p, i, f, s->method, own, whole, s->N));
  for (int i = 0; i < n; i++) own[i] = s->sizes[i * n + i];
  for (int i = 0; i < p; i++) rounding[i] = known(own[i] + bound_pairs(n, p, i, f, s->sizes, own, s->sizes, s->N) + 4 * EPS * cabs(f->logs[i]));
  for (int i = 0; i < p; i++) own[i] = rounding[i];
  for (int i = 0; i < p; i++)
    for (int j = 0; j < p; j++) { /* one of which nothing is known may be any of those that it reaches */
      double apart = find_distance(f->logs[i], f->logs[j]);
      if (j != i && own[j] > LOST && apart < own[i] + own[j]) rounding[i] = fmax(rounding[i], own[j] + apart);
    }
}

/* The least of these bounds of all widths of blocks. other (2 n). */
static void bound_leading(int p, const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise,
                          const double *scale, const Sums *s, cpx *shift, double *method, double *rounding, double *other) {
  int n = f->n, levels = sizeof SAME / sizeof *SAME;
  bound_at(p, SAME[0], f, factors, better, counts, noise, scale, s, shift, method, rounding);
  for (int level = 1; level < levels; level++) {
    int alone = 1;
    for (int i = 0; i < p; i++)
      for (int j = 0; j < p; j++)
        if (i != j && !(method[i] + rounding[i] < ALONE * find_distance(f->logs[i], f->logs[j]))) alone = 0;
    if (alone) break;
    bound_at(p, SAME[level], f, factors, better, counts, noise, scale, s, s->shift + n, other, other + n);
    for (int i = 0; i < p; i++) { method[i] = fmin(method[i], other[i]); rounding[i] = fmin(rounding[i], other[n + i]); }
  }
}

/* Whether the first p modes grow by more than the others, and the period closes without going over from them to the others. */
static int may_part(int p, const Form *f) {
  int n = f->n;
  for (int i = p; i < n; i++)
    for (int j = 0; j < p; j++)
      if (!(size_of(f->closure[i * n + j]) < CLEAR && creal(f->logs[j]) - creal(f->logs[i]) > APART)) return 0;
  return 1;
}

/* How many modes stand above the widest step of the moduli. */
static int find_widest_step(const Form *f) {
  int p = 1;
  for (int i = 2; i < f->n; i++)
    if (creal(f->logs[i - 1] - f->logs[i]) > creal(f->logs[p - 1] - f->logs[p])) p = i;
  return p;
}

/* Whether the first p modes are known, and stand above all that the others may be. */
static int stand_above(int p, const Form *f, const Sums *s, const double *method, const double *rounding) {
  double least = INFINITY;
  for (int i = 0; i < p; i++) {
    if (!(rounding[i] < LOST)) return 0;
    least = fmin(least, creal(f->logs[i]) - method[i] - rounding[i]);
  }
  return bound_block(p, f, s->loose) + APART < least;
}

/* Bounds on the motion of each log: by better factors (or none), and by rounding, of which each factor carries `counts`.
 *
 * part: where rounding leaves nothing of a mode, those above the widest step of the moduli stand apart, and as many as bisection finds; of the others,
 * with infinite rounding, is said that they lie below. */
int bound_motion(const Form *f, const double *factors, const double *better, const double *counts, const Noise *noise, const double *scale,
                 int part, cpx *shift, double *method, double *rounding) {
  int n = f->n, lost = 0;
  long size = (long)n * n, room = noise ? 2 * size + (long)n * (noise->p + 2 * noise->q) + noise->q : 0;
  double *memory = malloc((4 * size + 8L * n + f->count) * sizeof(double)), *tried = memory ? memory + 4 * size + 4L * n : NULL;
  cpx *space = malloc((5 * size + 3 * n + (room > 3 * size ? room : 3 * size)) * sizeof(cpx));
  if (!memory || !space) { free(memory); free(space); return NO_MEMORY; }
  Sums s = {memory, memory + size, memory + 2 * size, memory + 3 * size, memory + 4 * size, memory + 4 * size + n, memory + 4 * size + 2 * n,
            memory + 4 * size + 3 * n, tried + 4 * n, space, space + 3 * n, space + 3 * n + size, space + 3 * n + 2 * size, space + 3 * n + 3 * size,
            space + 3 * n + 4 * size, space + 3 * n + 5 * size};
  bound_leading(n, f, factors, better, counts, noise, scale, &s, shift, method, rounding, tried);
  for (int i = 0; part && i < n; i++) lost |= !(rounding[i] < LOST);
  for (int low = 1, high = n, first = 1; lost && low < high; first = 0) {
    int most = first ? find_widest_step(f) : (low + high) / 2, p = most;
    while (p >= low && !may_part(p, f)) p--;
    if (p >= low) bound_leading(p, f, factors, better, counts, noise, scale, &s, space + 2 * n, tried, tried + n, tried + 2 * n);
    if (p < low) low = first ? low : most + 1;
    else if (!stand_above(p, f, &s, tried, tried + n)) high = first ? high : p;
    else {
      low = most + 1;
      for (int i = 0; i < n; i++) { shift[i] = i < p ? space[2 * n + i] : 0.0; method[i] = i < p ? tried[i] : 0.0; rounding[i] = i < p ? tried[n + i] : INFINITY; }
    }
  }
  free(memory);
  free(space);
  return SOUND;
}

/* Right and left vectors (count, n, n) in the places of Q and T, of which Q has one more: columns of right and conjugates of columns of left belong
 * to the modes, and left^H right is the identity. The last n - p modes are not parted where they stand apart from the others. */
CALLED int find_vectors(int n, int count, int p, double complex *Q, double complex *T, double complex *closure, double complex *turn,
                        double complex *logs) {
  long size = (long)n * n;
  Form f = {n, count, (cpx *)Q, (cpx *)T, (cpx *)closure, (cpx *)turn, (cpx *)logs, NULL, NULL};
  cpx *X = malloc((4 * size + n) * sizeof(cpx)), *right = X + size, *left = X + 2 * size;
  if (!X) return NO_MEMORY;
  if (!may_part(p, &f)) p = n;
  int code = close_vectors(p, COINCIDING, &f, X + 3 * size, X, NULL, X + 4 * size) ? SOUND : NOT_FINITE;
  for (int k = count - 1; k >= 0 && code == SOUND; k--) {
    cpx *Qk = f.Q + k * size, *Tk = f.T + k * size;
    step_back(n, p, Tk, X);
    multiply_complex(n, n, n, Qk, X, right);
    find_left(n, X, Qk, left);
    memcpy(Qk, right, size * sizeof(cpx));
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) Tk[j * n + i] = conj(left[i * n + j]);
  }
  free(X);
  return code;
}
