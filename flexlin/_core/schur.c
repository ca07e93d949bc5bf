/* The periodic Schur form of a long product: orthogonal iteration from its factors until only clusters of near moduli are left, then the
 * complex Schur form of each of these. Sources: Bojanczyk, Golub, Van Dooren, SPIE 1770 (1992); Watkins, SIAM Review 47 (2005). */
#include "schur.h"

static const double CLEAN = 1e-14;  /* times n: coupling below a cut between groups of moduli */
static const double SLACK = 8.0;    /* how much less clean cuts may be in the last sweep, which goes over all factors */
static const double SPREAD = 4.6;   /* of the logs of moduli inside one cluster, which is multiplied out: log 100, so two digits are lost */
static const double DISORDER = 5.0; /* by which logs of moduli may rise from one mode to the next: they lie in one cluster then */
static const double GRADED = 200.0; /* of logs of a triangular product's diagonal, up to which factors are multiplied together */
static const double SMALL = 0.1;    /* ratio of moduli from which on the order in a Schur form is kept: what is behind may be without memory */
static const double DEAD = 1e-120;  /* a mode that shrinks by this against the others in one factor counts as no smaller */
enum { FULL_SWEEPS = 2, MIN_SWEEPS = 12, MAX_SWEEPS = 400, MAX_WORK = 8000000 }; /* over all factors; n^2 times QR factorizations */

/* The products F_1 F_0, F_3 F_2, ... in place; an odd last factor stays as it is. Returns how many there are; work (n, n). */
int multiply_pairs(int n, int count, double *factors, double *work) {
  long size = (long)n * n;
  for (int k = 0; k < count / 2; k++) {
    multiply_real(n, n, n, factors + (2 * k + 1) * size, factors + 2 * k * size, work);
    memcpy(factors + k * size, work, size * sizeof(double));
  }
  if (count % 2) memmove(factors + count / 2 * size, factors + (count - 1) * size, size * sizeof(double));
  return (count + 1) / 2;
}

/* A = Q R (n, n); A becomes R. For LAPACK, which counts by columns, these are the transposes: A' = L Q'. work (2 n). */
void make_orthogonal(const Lapack *lapack, int n, double *A, double *Q, double *work) {
  int failed;
  lapack->dgelq2(&n, &n, A, &n, work, work + n, &failed);
  memcpy(Q, A, (size_t)n * n * sizeof(double));
  lapack->dorgl2(&n, &n, &n, Q, &n, work, work + n, &failed);
  for (int i = 1; i < n; i++)
    for (int j = 0; j < i; j++) A[(long)i * n + j] = 0.0;
}

/* F_k Q_k = Q_(k+1) R_k for factors (count, n, n): all R_k, and all Q_k (count + 1, n, n), or the first and then the last in turns (2, n, n).
 * work (2 n). */
static void sweep_factors(const Lapack *lapack, int n, int count, int all, const double *factors, double *Q, double *R, double *work) {
  long size = (long)n * n;
  for (int k = 0; k < count; k++) {
    double *from = Q + (all ? k : k % 2) * size, *to = Q + (all ? k + 1 : (k + 1) % 2) * size;
    multiply_real(n, n, n, factors + k * size, from, R + k * size);
    make_orthogonal(lapack, n, R + k * size, to, work);
  }
}

/* Sums of log |r_ii| (n,) over the factors; a zero counts as the smallest number. */
static void sum_log_moduli(int n, int count, const double *R, double *sizes) {
  for (int i = 0; i < n; i++) {
    sizes[i] = 0.0;
    for (int k = 0; k < count; k++) sizes[i] += log(fmax(fabs(R[((long)k * n + i) * n + i]), TINY));
  }
}

/* Cut where W is decoupled up to `clean`: cut (n + 1). Returns the widest spread of log moduli in a cluster. */
static double find_clusters(int n, const double *W, const double *sizes, double clean, int *cut) {
  double spread = 0.0, low = sizes[0], high = sizes[0];
  cut[0] = cut[n] = 1;
  for (int i = 1; i < n; i++) {
    double coupling = 0.0;
    for (int r = i; r < n; r++)
      for (int c = 0; c < i; c++) coupling = fmax(coupling, fabs(W[r * n + c]));
    cut[i] = coupling <= clean;
    low = cut[i] ? sizes[i] : fmin(low, sizes[i]);
    high = cut[i] ? sizes[i] : fmax(high, sizes[i]);
    spread = fmax(spread, high - low);
  }
  return spread;
}

/* Multiply neighbouring triangular factors, in place, while the logs of their diagonals stay below GRADED; returns how many are left. */
static int group_triangular(int n, int count, double *R, double *sizes, double *work) {
  for (int k = 0; k < count; k++)
    for (int i = 0; i < n; i++) sizes[k * n + i] = log(fmax(fabs(R[((long)k * n + i) * n + i]), TINY));
  while (count > 1) {
    double largest = 0.0;
    int left = (count + 1) / 2;
    for (int k = 0; k < left; k++)
      for (int i = 0; i < n; i++) {
        sizes[k * n + i] = sizes[2 * k * n + i] + (2 * k + 1 < count ? sizes[(2 * k + 1) * n + i] : 0.0);
        largest = fmax(largest, fabs(sizes[k * n + i]));
      }
    if (!(largest <= GRADED)) break;
    count = multiply_pairs(n, count, R, work);
  }
  return count;
}

/* Where sweeps work: triangular factors and those that they are multiplied together to, bases in turns, small matrices, logs. */
typedef struct { const Lapack *lapack; double *R, *grouped, *ends, *W, *base, *work, *sizes; int *cut; } Bench;

/* Sweep from the bases Q (n, n) until every cluster is narrow; the width that is accepted rises slowly so that equal gaps end too.
 *
 * After FULL_SWEEPS the rows of R are graded: then triangular factors are multiplied together without loss, and the sweeps go on over W and
 * these few products. */
static void iterate(int n, int count, const double *factors, double *Q, const Bench *at) {
  long size = (long)n * n;
  int limit = MAX_SWEEPS;
  for (int sweep = 1;; sweep++) {
    memcpy(at->ends, Q, size * sizeof(double));
    sweep_factors(at->lapack, n, count, 0, factors, at->ends, at->R, at->work);
    double *end = at->ends + count % 2 * size;
    multiply_transposed(n, n, n, Q, end, at->W);
    sum_log_moduli(n, count, at->R, at->sizes);
    if (find_clusters(n, at->W, at->sizes, CLEAN * n, at->cut) <= SPREAD + sweep / 20.0 || sweep >= limit) break;
    if (sweep == FULL_SWEEPS) {
      memcpy(at->base, Q, size * sizeof(double));
      memcpy(at->grouped, at->R, count * size * sizeof(double));
      count = group_triangular(n, count, at->grouped, at->sizes, at->work);
      memcpy(at->grouped + count++ * size, at->W, size * sizeof(double));
      factors = at->grouped;
      end = at->W;
      limit = (int)fmin(fmax(MAX_WORK / ((double)size * count), MIN_SWEEPS), MAX_SWEEPS);
    }
    memcpy(Q, end, size * sizeof(double));
  }
  if (factors == at->grouped) {
    multiply_real(n, n, n, at->base, Q, at->W);
    memcpy(Q, at->W, size * sizeof(double));
  }
}

/* How the period of bases Q (count + 1, n, n) closes, and what the modes grow by. */
static void end_sweep(int n, int count, const double *Q, const Bench *at) {
  multiply_transposed(n, n, n, Q, Q + (long)count * n * n, at->W);
  sum_log_moduli(n, count, at->R, at->sizes);
}

/* All bases Q (count + 1, n, n) and R (count, n, n) of converged sweeps; where a start in an invariant subspace left the moduli out of order,
 * once more from a turned one. */
static void find_bases(int n, int count, const double *factors, double *Q, const Bench *at) {
  for (int attempt = 0; attempt < 2; attempt++) {
    iterate(n, count, factors, Q, at);
    sweep_factors(at->lapack, n, count, 1, factors, Q, at->R, at->work);
    end_sweep(n, count, Q, at);
    int ordered = 1;
    for (int i = 1; i < n; i++) ordered &= at->sizes[i] - at->sizes[i - 1] <= DISORDER;
    if (ordered || attempt) return;
    for (int e = 0; e < n * n; e++) at->work[e] = sin(1.0 + (double)e * e); /* in no special position */
    make_orthogonal(at->lapack, n, at->work, at->base, at->work + n * n);
    multiply_real(n, n, n, Q, at->base, at->W);
    memcpy(Q, at->W, (size_t)n * n * sizeof(double));
  }
}

/* Sweep on over R alone while clusters are wide: where modes overtake each other within the period, rounding of the size of the factors is what closes
 * it badly, and from triangular ones small entries are rounded by little. */
static void clean_bases(int n, int count, double *Q, const Bench *at) {
  long size = (long)n * n;
  double *U = at->ends, *product = U + size;
  for (int sweep = 0; find_clusters(n, at->W, at->sizes, SLACK * CLEAN * n, at->cut) > 2 * SPREAD && sweep < MIN_SWEEPS; sweep++) {
    make_orthogonal(at->lapack, n, at->W, U, at->work);
    for (int k = 0; k <= count; k++) {
      multiply_real(n, n, n, Q + k * size, U, product);
      memcpy(Q + k * size, product, size * sizeof(double));
      if (k == count) break;
      multiply_real(n, n, n, at->R + k * size, U, product);
      make_orthogonal(at->lapack, n, product, U, at->work);
      memcpy(at->R + k * size, product, size * sizeof(double));
    }
    end_sweep(n, count, Q, at);
  }
}

static void transpose(int n, cpx *A) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) { cpx x = A[i * n + j]; A[i * n + j] = A[j * n + i]; A[j * n + i] = x; }
}

/* Z (b, b) unitary with A = Z T Z^H, T upper triangular with small eigenvalues behind large ones, of A in rows; A becomes T in rows. Returns whether
 * it was found. work (b (b + 2) + 2). */
static int find_complex_schur(const Lapack *lapack, int b, cpx *A, cpx *Z, cpx *work) {
  int none, failed, room = b < 2 ? 2 : b * b;
  cpx *values = work + room;
  transpose(b, A);
  lapack->zgees("V", "N", NULL, &b, A, &b, &none, values, Z, &b, work, &room, (double *)(values + b), NULL, &failed, 1, 1);
  for (int i = 2; i <= b && !failed; i++) {
    int to = i;
    while (to > 1 && cabs(A[(to - 2) * (b + 1)]) < SMALL * cabs(A[(i - 1) * (b + 1)])) to--;
    if (to < i) lapack->ztrexc("V", &b, A, &b, Z, &b, &i, &to, &none, 1);
  }
  transpose(b, A);
  transpose(b, Z);
  return !failed;
}

/* The unitary factor of A (b, b), in its place, all in rows; work (2 b). */
static void make_unitary(const Lapack *lapack, int b, cpx *A, cpx *work) {
  int failed;
  lapack->zgelq2(&b, &b, A, &b, work, work + b, &failed);
  lapack->zungl2(&b, &b, &b, A, &b, work, work + b, &failed);
}

/* The block of b modes from `first` on of W R_(K-1) ... R_0, multiplied out and scaled. */
static void multiply_block(int n, int count, int first, int b, const double *W, const double *R, cpx *P, cpx *next, cpx *factor) {
  for (int k = 0; k <= count; k++) {
    const double *from = k < count ? R + (long)k * n * n : W;
    double largest = 0.0;
    for (int e = 0; e < b * b; e++) factor[e] = from[(first + e / b) * n + first + e % b];
    if (k == 0) memcpy(P, factor, (size_t)b * b * sizeof(cpx));
    else {
      multiply_complex(b, b, b, factor, P, next);
      memcpy(P, next, (size_t)b * b * sizeof(cpx));
    }
    for (int e = 0; e < b * b; e++) largest = fmax(largest, fabs(creal(P[e])));
    if (largest > 0.0)
      for (int e = 0; e < b * b; e++) P[e] /= largest;
  }
}

/* U (n, n) block by block, unitary, such that U^H W R_(K-1) ... R_0 U has upper triangular blocks. Returns whether all were found. */
static int start_blocks(const Lapack *lapack, const Form *f, const int *cut, const double *W, const double *R, cpx *U, cpx *work) {
  int n = f->n, found = 1;
  long size = (long)n * n;
  for (long e = 0; e < size; e++) U[e] = e % (n + 1) == 0;
  for (int first = 0, past = 1; first < n; first = past++) {
    while (!cut[past]) past++;
    int b = past - first;
    if (b == 1) continue;
    multiply_block(n, f->count, first, b, W, R, work, work + size, work + 2 * size);
    found &= find_complex_schur(lapack, b, work, work + size, work + 2 * size);
    for (int e = 0; e < b * b; e++) U[(first + e / b) * n + first + e % b] = work[size + e];
  }
  return found;
}

/* Keep the upper triangle of T, and put a small number where a mode has died out to nothing beside the others, so that its log exists. */
static void complete_triangle(int n, cpx *T) {
  double largest = 0.0;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      if (j < i) T[i * n + j] = 0.0;
      else largest = fmax(largest, size_of(T[i * n + j]));
    }
  double least = DEAD * fmax(largest, TINY / DEAD);
  for (int i = 0; i < n; i++)
    if (!(cabs(T[i * n + i]) >= least)) T[i * n + i] = least;
}

/* T and Q of all factors from their real bases and triangular factors: U_(k+1) T_k = R_k U_k, block by block. work (3 n n). */
static void carry_blocks(const Lapack *lapack, Form *f, const int *cut, const double *bases, const double *R, cpx *U, cpx *work) {
  int n = f->n, single = 1;
  long size = (long)n * n;
  cpx *RU = work, *block = work + size, *room = block + size;
  for (int i = 0; i < n; i++) single &= cut[i];
  multiply_real_left(n, n, n, bases, U, f->Q);
  for (int k = 0; k < f->count; k++) {
    const double *Rk = R + k * size;
    if (single)
      for (long e = 0; e < size; e++) f->T[k * size + e] = Rk[e];
    else {
      multiply_real_left(n, n, n, Rk, U, RU);
      for (int first = 0, past = 1; first < n; first = past++) {
        while (!cut[past]) past++;
        int b = past - first;
        if (b == 1) continue;
        for (int e = 0; e < b * b; e++) block[e] = RU[(first + e / b) * n + first + e % b];
        make_unitary(lapack, b, block, room);
        for (int e = 0; e < b * b; e++) U[(first + e / b) * n + first + e % b] = block[e];
      }
      multiply_adjoint(n, n, n, U, RU, f->T + k * size);
    }
    complete_triangle(n, f->T + k * size);
    multiply_real_left(n, n, n, bases + (k + 1) * size, U, f->Q + (k + 1) * size);
  }
}

/* How the period closes. */
static void close_form(Form *f, const int *cut) {
  int n = f->n;
  multiply_adjoint(n, n, n, f->Q, f->Q + (long)f->count * n * n, f->closure);
  for (int i = 0; i < n; i++) {
    cpx own = f->closure[i * n + i];
    f->turn[i] = own == 0.0 ? 1.0 : own / cabs(own);
    for (int j = 0; j < n; j++) f->defect[i * n + j] = cabs(f->closure[i * n + j] - (i == j ? f->turn[i] : 0.0));
  }
  for (int first = 0, past = 1; first < n; first = past++) {
    double missed = 0.0;
    while (!cut[past]) past++;
    for (int i = first; i < past; i++)
      for (int j = first; j < past; j++) missed = fmax(missed, f->defect[i * n + j]);
    for (int i = first; i < past; i++)
      for (int j = first; j < past; j++) f->defect[i * n + j] = missed;
  }
}

/* Into (-pi, pi]. */
double wrap_angle(double angle) {
  double near = remainder(angle, 2 * M_PI);
  return near <= -M_PI ? M_PI : near;
}

/* The logs of the modes; roundings of many factors would add up in double precision, and half turns are counted. */
static void sum_logs(Form *f) {
  int n = f->n;
  for (int i = 0; i < n; i++) {
    int halves = 0;
    long double size = 0.0, angle = 0.0;
    for (int k = 0; k <= f->count; k++) {
      cpx t = k < f->count ? f->T[((long)k * n + i) * n + i] : f->turn[i];
      if (k < f->count) size += log(fmax(cabs(t), TINY));
      if (cimag(t) == 0.0) halves ^= creal(t) < 0.0;
      else angle += carg(t);
    }
    f->logs[i] = CMPLX(size, wrap_angle(angle + (halves ? M_PI : 0.0)));
  }
}

/* One matrix: its complex Schur form. */
static int find_single_form(const Lapack *lapack, const double *factor, Form *f, cpx *work) {
  int n = f->n;
  long size = (long)n * n;
  for (long e = 0; e < size; e++) f->T[e] = factor[e];
  if (!find_complex_schur(lapack, n, f->T, f->Q, work)) return NO_SCHUR_FORM;
  memcpy(f->Q + size, f->Q, size * sizeof(cpx));
  complete_triangle(n, f->T);
  for (long e = 0; e < size; e++) f->start[e] = e % (n + 1) == 0;
  for (int e = 0; e < size; e++) { f->closure[e] = e % (n + 1) == 0; f->defect[e] = 0.0; }
  for (int i = 0; i < n; i++) f->turn[i] = 1.0;
  sum_logs(f);
  return SOUND;
}

/* Bring factors (count, n, n) into periodic Schur form, from bases `start` (n, n) or, where that is none, from those of no system. */
int find_schur_form(const Lapack *lapack, const double *factors, const double *start, Form *f) {
  int n = f->n, count = f->count, code = SOUND;
  long size = (long)n * n;
  for (long e = 0; e < count * size; e++)
    if (!isfinite(factors[e])) return NOT_FINITE;
  double *memory = malloc(((3L * count + 7) * size + (count + 3L) * n) * sizeof(double));
  cpx *work = malloc((5 * size + 2 * n + 2) * sizeof(cpx)), *U = work ? work + 4 * size + 2 * n + 2 : NULL;
  int *cut = malloc((n + 1) * sizeof(int));
  if (!memory || !work || !cut) code = NO_MEMORY;
  else if (count == 1) code = find_single_form(lapack, factors, f, work);
  else {
    double *bases = memory, *R = bases + (count + 1) * size, *ends = R + (2 * count + 1) * size;
    Bench at = {lapack, R, R + count * size, ends, ends + 2 * size, ends + 3 * size, ends + 4 * size, ends + 5 * size + 2 * n, cut};
    for (long e = 0; e < size; e++) bases[e] = start ? start[e] : e % (n + 1) == 0;
    find_bases(n, count, factors, bases, &at);
    clean_bases(n, count, bases, &at);
    memcpy(f->start, bases, size * sizeof(double));
    if (!start_blocks(lapack, f, cut, at.W, at.R, U, work)) code = NO_SCHUR_FORM;
    else {
      carry_blocks(lapack, f, cut, bases, at.R, U, work);
      close_form(f, cut);
      sum_logs(f);
    }
  }
  free(memory);
  free(work);
  free(cut);
  return code;
}

/* The periodic Schur form of factors (count, n, n): Q (count + 1, n, n), T (count, n, n), and how the period closes. */
CALLED int find_form(int n, int count, const double *factors, const void *lapack, double complex *Q, double complex *T, double complex *closure,
                     double complex *turn, double complex *logs) {
  double *defect = malloc(2L * n * n * sizeof(double));
  if (!defect) return NO_MEMORY;
  Form form = {n, count, (cpx *)Q, (cpx *)T, (cpx *)closure, (cpx *)turn, (cpx *)logs, defect, defect + n * n};
  int code = find_schur_form(lapack, factors, NULL, &form);
  free(defect);
  return code;
}
