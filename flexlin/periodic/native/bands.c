/* Eigenvectors along a period of modes in two bands of their growth, the strong ones followed forward, the others backward: as `follow_vectors` in
 * tame.py. */

/* The product of factors (segments, n, n) but for its size, `step` numbers from one to the next. */
static void multiply_scaled(int n, int segments, long step, const double *factors, double *product) {
  int size = n * n;
  double work[size];
  memcpy(product, factors, size * sizeof(double));
  for (int k = 1; k < segments; k++) {
    multiply_real(n, factors + k * step, product, work);
    double over = 1.0 / fmax(measure_size(size, work), 1e-290);
    for (int e = 0; e < size; e++) product[e] = over * work[e];
  }
}

/* Columns of a square of eigenvectors (n, n) in that order, some of them conjugated, into columns of another from `first` on, and their eigenvalues. */
static void take_columns(int n, int count, const int *order, int conjugated, const z *own, const z *vectors, int first, z *to_own, z *to) {
  for (int c = 0; c < count; c++) {
    to_own[first + c] = own[order[c]];
    for (int i = 0; i < n; i++) to[i * n + first + c] = conjugated ? conj(vectors[i * n + order[c]]) : vectors[i * n + order[c]];
  }
}

/* The indices of the `count` largest, pairs side by side; 0 where a pair would be torn apart. */
static int find_largest(int n, int count, const z *values, int *order) {
  double torn = 0.0;
  for (int i = 0; i < n; i++) {
    int k = i < count ? i : count;
    for (; k > 0 && cabs(values[order[k - 1]]) < cabs(values[i]); k--)
      if (k < count) order[k] = order[k - 1];
    if (k < count) order[k] = i;
  }
  for (int k = 0; k < count; k++) torn += cimag(values[order[k]]);
  return torn == 0.0;
}

/* The modes from `strong` on: followed backward from the end, into columns of the last, of `start` and of back (segments, n, n), which are the
 * vectors at the ends of the segments. 0 where they are not found, -1 where there is no memory. */
static int follow_back(Geev *geev, int n, int segments, const double *factors, int strong, z *own, z *start, z *back) {
  int size = n * n, order[n], done = 1;
  double *inverse = malloc((long)segments * size * sizeof(double)), product[size], A[size];
  z values[n], vectors[size], *last = back + (segments - 1L) * size;
  if (!inverse) return -1;
  for (int k = 0; k < segments && done; k++) {
    double *X = inverse + (long)k * size;
    memcpy(A, factors + (long)k * size, size * sizeof(double));
    for (int e = 0; e < size; e++) X[e] = e % (n + 1) == 0;
    done = eliminate(n, n, A, X);
  }
  if (done) {
    multiply_scaled(n, segments, -size, inverse + (segments - 1L) * size, product);
    done = find_eigenvectors(geev, n, product, values, vectors) && find_largest(n, n - strong, values, order);
  }
  if (done) take_columns(n, n - strong, order, 1, values, vectors, strong, own, last);
  for (int k = segments - 1; k >= 0 && done; k--) {
    z *to = k ? back + (k - 1L) * size : start;
    for (int j = strong; j < n; j++) {
      double square = 0.0;
      for (int i = 0; i < n; i++) {
        z sum = 0.0;
        for (int l = 0; l < n; l++) sum += inverse[(long)k * size + i * n + l] * back[(long)k * size + l * n + j];
        to[i * n + j] = sum;
        square += creal(sum) * creal(sum) + cimag(sum) * cimag(sum);
      }
      for (int i = 0; i < n; i++) to[i * n + j] /= sqrt(square);
    }
  }
  free(inverse);
  return done;
}

/* Eigenvalues (n,) of the product of factors, of which the angles alone are right, its vectors (n, n), and how many of them are followed forward; the
 * others at the ends of all segments in columns of back (segments, n, n). 0 where they are not found, -1 where there is no memory. */
static int find_bands(Geev *geev, int n, int segments, const double *factors, double growth, z *own, z *start, z *back, int *strong) {
  int size = n * n, order[n];
  double product[size], largest = 0.0;
  z values[n], vectors[size];
  multiply_scaled(n, segments, size, factors, product);
  if (!find_eigenvectors(geev, n, product, values, vectors)) return 0;
  for (int i = 0; i < n; i++) largest = fmax(largest, cabs(values[i]));
  *strong = 0;
  for (int i = 0; i < n; i++)
    if (cabs(values[i]) * growth > largest) order[(*strong)++] = i;
  take_columns(n, *strong, order, 0, values, vectors, 0, own, start);
  return *strong == n ? 1 : follow_back(geev, n, segments, factors, *strong, own, start, back);
}
