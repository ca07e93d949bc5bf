/* How far the logs of a group's multipliers may be off: first order, and what pairs do to each other, as in tame.py. */
#include <complex.h>

typedef double complex z;

/* C = A B, (p, p): complex A and real B, or the other way round. */
static void multiply_mixed(int p, const z *A, const double *B, int real_first, z *C) {
  for (int i = 0; i < p; i++)
    for (int j = 0; j < p; j++) {
      z sum = 0.0;
      for (int k = 0; k < p; k++) sum += real_first ? B[i * p + k] * A[k * p + j] : A[i * p + k] * B[k * p + j];
      C[i * p + j] = sum;
    }
}

/* Errors (p,) of logs (p,): `out` as `follow_group` leaves it, vectors and their inverse, what is not known in each segment (p, p).
 *
 * numbers: safety, cancelled, close, roundings of a factor, eps. Returns 0 where there is no memory. */
static int bound_group(int p, int segments, int most, const double *out, const double *unknown, const double *numbers, const double *vectors,
                const double *rows, const double *logs, double *errors) {
  int size = p * p;
  double *sums = calloc(2L * size, sizeof(double)), *known = sums + size;
  z *work = malloc((5L * size + p) * sizeof(z)), *R = work + size, *L = R + size, *half = L + size, *step = half + size, *motion = step + size;
  if (!sums || !work) { free(sums); free(work); return 0; }
  long whole = (most + 1L) * size;
  const z *V = (const z *)vectors, *W = (const z *)rows, *log = (const z *)logs;
  for (int i = 0; i < p; i++) motion[i] = 0.0;
  for (int k = 0; k < segments; k++) {
    const double *F = out + (long)k * size, *better = F + whole;
    double change[size], rounding = numbers[3] * numbers[4] * measure_size(size, F);
    for (int e = 0; e < size; e++) change[e] = better[e] - F[e];
    multiply_mixed(p, V, F + 2 * whole, 1, R);
    multiply_mixed(p, W, F + 3 * whole + size, 0, L);
    multiply_mixed(p, R, change, 1, half);
    for (int i = 0; i < p; i++)
      for (int j = 0; j < p; j++) {
        z sum = 0.0;
        double modulus = 0.0;
        for (int l = 0; l < p; l++) {
          double inner = 0.0;
          for (int q = 0; q < p; q++) inner += (unknown[l * p + q] + rounding) * cabs(R[q * p + j]);
          sum += L[i * p + l] * half[l * p + j];
          modulus += cabs(L[i * p + l]) * inner;
        }
        sums[i * p + j] += cabs(sum);
        known[i * p + j] += modulus;
        if (i == j) motion[i] += sum;
      }
  }
  double own[p];
  for (int i = 0; i < p; i++) own[i] = numbers[0] * fmax(cabs(motion[i]), numbers[1] * sums[i * (p + 1)]) + known[i * (p + 1)];
  for (int i = 0; i < p; i++) {
    errors[i] = own[i] + 4 * numbers[4] * cabs(log[i]);
    for (int j = 0; j < p; j++) {
      if (j == i) continue;
      double turn = cimag(log[i] - log[j]);
      double gap = fmax(hypot(creal(log[i] - log[j]), turn - 2 * M_PI * round(turn / (2 * M_PI))) - own[i] - own[j], 0.0);
      double product = (sums[i * p + j] + known[i * p + j]) * (sums[j * p + i] + known[j * p + i]), both = sqrt(product);
      errors[i] += both > numbers[2] * gap ? 2 * both : product / fmax(gap, both + 2.2e-308);
    }
  }
  free(sums);
  free(work);
  return 1;
}
