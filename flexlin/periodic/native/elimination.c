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
