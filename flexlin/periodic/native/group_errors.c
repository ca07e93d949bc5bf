/* Logs of a group's multipliers and how far they may be off, by its Floquet vectors along the period, as in tame.py. */

static double measure_modulus(z x) { return sqrt(creal(x) * creal(x) + cimag(x) * cimag(x)); }

/* C = A B, (p, p): real A and complex B. */
static void multiply_mixed(int p, const double *A, const z *B, z *C) {
  for (int i = 0; i < p; i++)
    for (int j = 0; j < p; j++) {
      z sum = 0.0;
      for (int k = 0; k < p; k++) sum += A[i * p + k] * B[k * p + j];
      C[i * p + j] = sum;
    }
}

/* Columns of length 1, (p, p), and the lengths (p,) that they had. */
static void shorten_columns(int p, z *R, double *lengths) {
  for (int j = 0; j < p; j++) {
    double square = 0.0;
    for (int i = 0; i < p; i++) square += creal(R[i * p + j]) * creal(R[i * p + j]) + cimag(R[i * p + j]) * cimag(R[i * p + j]);
    lengths[j] = sqrt(square);
    for (int i = 0; i < p; i++) R[i * p + j] /= lengths[j];
  }
}

/* |A| (B + more) |C| over growth (p,) of the rows, added to sum (p, p); B real. */
static void add_moduli(int p, const z *A, const double *B, double more, const z *C, const double *growth, double *sum) {
  double inner[p * p], moduli[p * p];
  for (int e = 0; e < p * p; e++) { moduli[e] = measure_modulus(C[e]); inner[e] = 0.0; }
  for (int i = 0; i < p; i++)
    for (int k = 0; k < p; k++)
      for (int j = 0; j < p; j++) inner[i * p + j] += (B[i * p + k] + more) * moduli[k * p + j];
  for (int i = 0; i < p; i++)
    for (int k = 0; k < p; k++) {
      double factor = measure_modulus(A[i * p + k]) / growth[i];
      for (int j = 0; j < p; j++) sum[i * p + j] += factor * inner[k * p + j];
    }
}

/* What pairs of logs do to each other beyond first order is added to the errors (p,), own (p,) the first order; as `bound_pairs`. */
static void add_pairs(int p, double close, const z *logs, const double *coupling, const double *own, double *errors) {
  for (int i = 0; i < p; i++)
    for (int j = 0; j < p; j++) {
      if (j == i) continue;
      double turn = cimag(logs[i] - logs[j]);
      double gap = fmax(hypot(creal(logs[i] - logs[j]), turn - 2 * M_PI * round(turn / (2 * M_PI))) - own[i] - own[j], 0.0);
      double product = coupling[i * p + j] * coupling[j * p + i], both = sqrt(product);
      errors[i] += both > close * gap ? 2 * both : product / fmax(gap, both + 2.2e-308);
    }
}

/* Logs (p,) of the multipliers and their errors (p,), and the largest that is the method's: factors (2, segments, p, p), the second more or less
 * accurate, which share of the difference counts, the vectors at the beginning, and at the ends of all segments those behind the first `strong`
 * ones, which are followed; what is not known in each segment (p, p), `apart` numbers from one segment's to the next; roundings: products behind a
 * factor.
 *
 * numbers: cancelled, close, roundings of a factor, eps, independent, and the logarithm of the largest growth.
 * Returns 1, 0 where the vectors are not independent or grow too much against each other, -1 where there is no memory. */
static int bound_group(int p, int segments, const double *factors, double share, int roundings, const double *unknown, long apart,
                       const double *numbers, const z *vectors, const z *back, int strong, z *logs, double *errors, double *method) {
  int size = p * p, good = 1;
  double *sums = calloc(2L * size + 4 * p, sizeof(double)), *known = sums + size, *growth = known + size, *one = growth + p, *length = one + p, *own = length + p;
  z *work = malloc((7L * size + 2 * p) * sizeof(z)), *R = work + 2 * size, *L = R + size, *first = L + size, *next = first + size, *half = next + size;
  z *motion = half + size;
  if (!sums || !work) { free(sums); free(work); return -1; }
  for (int i = 0; i < p; i++) { motion[i] = 0.0; one[i] = 1.0; }
  memcpy(R, vectors, size * sizeof(z));
  good = invert_complex(p, R, first, work) && measure_complex(size, R) * measure_complex(size, first) < numbers[4] * p;
  for (int k = 0; k < segments && good; k++) {
    const double *F = factors + (long)k * size, *better = F + (long)segments * size;
    double change[size];
    for (int e = 0; e < size; e++) change[e] = better[e] - F[e];
    multiply_mixed(p, F, R, next);
    shorten_columns(p, next, growth);
    for (int e = 0; e < size; e++)
      if (e % p >= strong) next[e] = back[(long)k * size + e];
    good = invert_complex(p, next, L, work) && measure_complex(size, next) * measure_complex(size, L) < numbers[4] * p;
    add_moduli(p, L, unknown + k * apart, roundings * numbers[2] * numbers[3] * measure_size(size, F), R, growth, known);
    multiply_mixed(p, change, R, half);
    multiply_complex(p, L, half, work);
    for (int e = 0; e < size; e++) sums[e] += measure_modulus(work[e]) / growth[e / p];
    for (int i = 0; i < p; i++) { motion[i] += work[i * (p + 1)] / growth[i]; length[i] += log(growth[i]); }
    memcpy(R, next, size * sizeof(z));
  }
  multiply_complex(p, first, R, next); /* the closure */
  *method = 0.0;
  for (int i = 0; i < p; i++) {
    double last = 0.0;
    for (int k = 0; k < p; k++) last += cabs(first[i * p + k]) * cabs(R[k * p + i]);
    logs[i] = length[i] + clog(next[i * (p + 1)]);
    double off = share * fmax(cabs(motion[i]), numbers[0] * sums[i * (p + 1)]);
    *method = off <= *method ? *method : off;
    own[i] = off + known[i * (p + 1)] + numbers[2] * numbers[3] * last;
    errors[i] = own[i] + 4 * numbers[3] * cabs(logs[i]);
  }
  for (int e = 0; e < size; e++) sums[e] += known[e] + cabs(next[e]);
  add_pairs(p, numbers[1], logs, sums, own, errors);
  good = good && are_in_bands(p, length, numbers[5]);
  free(sums);
  free(work);
  return good;
}
