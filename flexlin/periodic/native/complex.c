/* Complex matrices (n, n) of one time. */
#include <complex.h>

typedef double complex z;

/* C = A B */
static void multiply_complex(int n, const z *A, const z *B, z *C) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double re = 0.0, im = 0.0;
      for (int k = 0; k < n; k++) {
        z a = A[i * n + k], b = B[k * n + j];
        re += creal(a) * creal(b) - cimag(a) * cimag(b);
        im += creal(a) * cimag(b) + cimag(a) * creal(b);
      }
      C[i * n + j] = re + I * im;
    }
}

/* The root of the sum of squares. */
static double measure_complex(int size, const z *A) {
  double sum = 0.0;
  for (int e = 0; e < size; e++) sum += creal(A[e]) * creal(A[e]) + cimag(A[e]) * cimag(A[e]);
  return sqrt(sum);
}

/* X = A^-1 (n, n), once improved; work (2 n n). 0 where A is singular. */
static int invert_complex(int n, const z *A, z *X, z *work) {
  memcpy(work, A, (long)n * n * sizeof(z));
  for (int e = 0; e < n * n; e++) X[e] = e % (n + 1) == 0;
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (cabs(work[i * n + k]) > cabs(work[pivot * n + k])) pivot = i;
    if (!(cabs(work[pivot * n + k]) > 0.0)) return 0;
    for (int j = 0; j < n && pivot != k; j++) {
      z x = work[k * n + j], y = X[k * n + j];
      work[k * n + j] = work[pivot * n + j]; work[pivot * n + j] = x;
      X[k * n + j] = X[pivot * n + j]; X[pivot * n + j] = y;
    }
    z over = 1.0 / work[k * n + k];
    for (int j = 0; j < n; j++) { work[k * n + j] *= over; X[k * n + j] *= over; }
    for (int i = 0; i < n; i++) {
      z factor = work[i * n + k];
      if (i == k || factor == 0.0) continue;
      for (int j = 0; j < n; j++) { work[i * n + j] -= factor * work[k * n + j]; X[i * n + j] -= factor * X[k * n + j]; }
    }
  }
  z *more = work + n * n;
  multiply_complex(n, A, X, work);
  for (int e = 0; e < n * n; e++) work[e] = (e % (n + 1) == 0) - work[e];
  multiply_complex(n, X, work, more);
  for (int e = 0; e < n * n; e++) X[e] += more[e];
  return 1;
}

