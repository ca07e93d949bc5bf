/* One sweep of orthogonal iteration over many factors, with LAPACK's signs. */
#include "core.h"

/* C = A B (n, n). */
static void multiply_rows(int n, const double *restrict A, const double *restrict B, double *restrict C) {
  for (int i = 0; i < n; i++) {
    double *row = C + (long)i * n;
    for (int j = 0; j < n; j++) row[j] = 0.0;
    for (int k = 0; k < n; k++) {
      double a = A[(long)i * n + k];
      const double *b = B + (long)k * n;
      for (int j = 0; j < n; j++) row[j] += a * b[j];
    }
  }
}

/* Rows first ... n - 1 of X, columns `from` on, less tau v (v' X), v_first = 1; v: the column `first` of A below its diagonal. */
static void reflect(int n, int first, int from, double tau, const double *A, double *X, double *work) {
  for (int j = from; j < n; j++) work[j] = X[(long)first * n + j];
  for (int i = first + 1; i < n; i++) {
    double v = A[(long)i * n + first];
    const double *row = X + (long)i * n;
    for (int j = from; j < n; j++) work[j] += v * row[j];
  }
  for (int j = from; j < n; j++) { work[j] *= tau; X[(long)first * n + j] -= work[j]; }
  for (int i = first + 1; i < n; i++) {
    double v = A[(long)i * n + first], *row = X + (long)i * n;
    for (int j = from; j < n; j++) row[j] -= v * work[j];
  }
}

/* A = Q R (n, n) by Householder's reflections; A becomes R. work (2 n). */
static void factor_orthogonal(int n, double *A, double *Q, double *work) {
  double *tau = work + n;
  for (int k = 0; k < n; k++) {
    double largest = 0.0, below = 0.0, alpha = A[(long)k * n + k];
    for (int i = k + 1; i < n; i++) largest = fmax(largest, fabs(A[(long)i * n + k]));
    tau[k] = 0.0;
    if (!(largest > 0.0)) continue;
    largest = fmax(largest, fabs(alpha));
    for (int i = k; i < n; i++) {
      double x = A[(long)i * n + k] / largest;
      below += x * x;
    }
    double beta = -copysign(largest * sqrt(below), alpha), over = 1.0 / (alpha - beta);
    tau[k] = (beta - alpha) / beta;
    for (int i = k + 1; i < n; i++) A[(long)i * n + k] *= over;
    reflect(n, k, k + 1, tau[k], A, A, work);
    A[(long)k * n + k] = beta;
  }
  for (int e = 0; e < n * n; e++) Q[e] = e % (n + 1) == 0;
  for (int k = n - 1; k >= 0; k--)
    if (tau[k] != 0.0) reflect(n, k, k, tau[k], A, Q, work);
  for (int i = 1; i < n; i++)
    for (int j = 0; j < i; j++) A[(long)i * n + j] = 0.0;
}

/* F_k Q_k = Q_(k+1) R_k for factors (count, n, n): all R_k, and all Q_k (count + 1, n, n), or the first and then the last in turns (2, n, n). */
CALLED void sweep_factors(int n, int count, int all, const double *factors, double *Q, double *R) {
  double work[2 * n];
  long size = (long)n * n;
  for (int k = 0; k < count; k++) {
    double *from = Q + (all ? k : k % 2) * size, *to = Q + (all ? k + 1 : (k + 1) % 2) * size;
    multiply_rows(n, factors + k * size, from, R + k * size);
    factor_orthogonal(n, R + k * size, to, work);
  }
}
