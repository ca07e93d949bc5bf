/* Transition matrices of a small system over equal segments. */

/* One transition matrix (p, p) by Gauss collocation from samples A (stages, p, p), as gauss.py, rows exchanged; 0 where it is singular, -1 where
 * there is no memory. */
static int factor_one(int p, int stages, double h, const double *A, const double *a, const double *b, double *F) {
  int n = stages * p, done;
  double *G = malloc(((long)n * n + (long)n * p) * sizeof(double)), *Y = G + (long)n * n;
  if (!G) return -1;
  for (int i = 0; i < stages; i++)
    for (int r = 0; r < p; r++)
      for (int j = 0; j < stages; j++)
        for (int c = 0; c < p; c++) G[(i * p + r) * n + j * p + c] = -h * a[i * stages + j] * A[(j * p + r) * p + c] + (i == j && r == c);
  for (int i = 0; i < n * p; i++) Y[i] = i / p % p == i % p;
  done = eliminate(n, p, G, Y);
  for (int r = 0; r < p; r++)
    for (int c = 0; c < p; c++) {
      double sum = r == c;
      for (int j = 0; j < stages; j++)
        for (int l = 0; l < p; l++) sum += h * b[j] * A[(j * p + r) * p + l] * Y[(j * p + l) * p + c];
      F[r * p + c] = sum;
    }
  free(G);
  return done;
}

enum { SAFE = 8 }; /* one over the least pivot with which rows need not be exchanged: the stages' matrices are near 1 */

/* The same for eight segments at once, without exchanging rows, the first `segments` of which count; 0 where a pivot is small. work: (stages p)
 * (stages + 1) p eights. */
static int factor_eight(int p, int stages, double h, const v8 *own, int segments, const double *a, const double *b, v8 *work, double *F) {
  int n = stages * p, size = p * p;
  v8 *G = work, *Y = G + (long)n * n;
  for (int i = 0; i < stages; i++)
    for (int r = 0; r < p; r++) {
      v8 *row = G + (long)(i * p + r) * n, *right = Y + (long)(i * p + r) * p;
      for (int j = 0; j < stages; j++)
        for (int c = 0; c < p; c++) row[j * p + c] = -h * a[i * stages + j] * own[j * size + r * p + c];
      row[i * p + r] += 1.0;
      for (int c = 0; c < p; c++) right[c] = splat(c == r);
    }
  v8 least = eliminate_eight(n, p, G, Y);
  for (int l = 0; l < 8; l++)
    if (!(least[l] * SAFE >= 1.0)) return 0;
  for (int r = 0; r < p; r++)
    for (int c = 0; c < p; c++) {
      v8 sum = splat(0.0);
      for (int j = 0; j < stages; j++)
        for (int k = 0; k < p; k++) sum += b[j] * own[j * size + r * p + k] * Y[(j * p + k) * p + c];
      for (int l = 0; l < 8 && l < segments; l++) F[l * size + r * p + c] = (r == c) + h * sum[l];
    }
  return 1;
}

/* Values (stages, p p) of a series, sums of cosines and sines (highest + 1, 2, p p), at the stages c of eight equal segments from `first` on. */
static void evaluate_series(int size, int highest, const double *series, int first, int segments, int stages, const double *c, v8 *values) {
  for (int j = 0; j < stages; j++, values += size) {
    v8 cosine, sine, x = splat(1.0), y = splat(0.0);
    for (int l = 0; l < 8; l++) {
      double angle = 2.0 * M_PI * (first + l + c[j]) / segments;
      cosine[l] = cos(angle);
      sine[l] = sin(angle);
    }
    for (int e = 0; e < size; e++) values[e] = splat(0.0);
    for (int k = 0; k <= highest; k++) {
      const double *a = series + 2 * k * size, *b = a + size;
      for (int e = 0; e < size; e++) values[e] += a[e] * x + b[e] * y;
      v8 turned = x * cosine - y * sine;
      y = x * sine + y * cosine;
      x = turned;
    }
  }
}

/* Transition matrices (segments, p, p) over equal segments of length h; rule: c, a, b. 0 where one is singular, -1 where there is no memory. */
static int factor_group(int p, int highest, const double *series, int segments, int stages, double h, const double *rule, double *F) {
  long n = stages * p, size = p * p;
  const double *a = rule + stages, *b = a + stages * stages;
  v8 *own = aligned_alloc(64, (n * n + n * p + stages * size) * sizeof(v8));
  double *one = malloc(stages * size * sizeof(double));
  int done = own && one ? 1 : -1;
  for (int k = 0; k < segments && done == 1; k += 8) {
    int left = segments - k < 8 ? segments - k : 8;
    evaluate_series(size, highest, series, k, segments, stages, rule, own);
    if (factor_eight(p, stages, h, own, left, a, b, own + stages * size, F + k * size)) continue;
    for (int l = 0; l < left && done == 1; l++) {
      for (int e = 0; e < stages * size; e++) one[e] = own[e][l];
      done = factor_one(p, stages, h, one, a, b, F + (k + l) * size);
    }
  }
  free(own);
  free(one);
  return done;
}
