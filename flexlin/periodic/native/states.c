/* From coordinates of the modes of the mean to those of the states, and back. */

/* own = left A right, one block: rows of leaders, then their mates. */
static void take_to_modes(const Shape *s, const double *left, const v8 *A, const double *right, v8 *own, v8 *row) {
  int n = s->n, size = n * n;
  for (int q = 0; q < s->leaders; q++) {
    int i = s->leader[q];
    for (int j = 0; j < n; j++) {
      v8 r = splat(0.0), im = r;
      for (int k = 0; k < n; k++) { r += left[2 * (i * n + k)] * A[k * n + j]; im += left[2 * (i * n + k) + 1] * A[k * n + j]; }
      row[j] = r; row[n + j] = im;
    }
    for (int j = 0; j < n; j++) {
      v8 r = splat(0.0), im = r;
      for (int k = 0; k < n; k++) {
        double x = right[2 * (k * n + j)], y = right[2 * (k * n + j) + 1];
        r += x * row[k] - y * row[n + k]; im += y * row[k] + x * row[n + k];
      }
      own[i * n + j] = r; own[size + i * n + j] = im;
    }
  }
  mirror(s, own);
}

/* X := right X for columns of modes, one block. */
static void columns_to_states(const Shape *s, const double *right, v8 *X, v8 *work) {
  int n = s->n, size = n * n;
  memcpy(work, X, 2 * size * sizeof(v8));
  for (int q = 0; q < s->leaders; q++)
    for (int i = 0, j = s->leader[q], k = s->mate[j]; i < n; i++) {
      v8 r = splat(0.0), im = r;
      for (int l = 0; l < n; l++) {
        double x = right[2 * (i * n + l)], y = right[2 * (i * n + l) + 1];
        v8 a = work[l * n + j], b = work[size + l * n + j];
        r += x * a - y * b; im += y * a + x * b;
      }
      X[i * n + j] = r; X[size + i * n + j] = im;
      if (k != j) { X[i * n + k] = r; X[size + i * n + k] = -im; }
    }
}

/* X := X left for rows of modes, one block. */
static void rows_to_states(const Shape *s, const double *left, v8 *X, v8 *work) {
  int n = s->n, size = n * n;
  memcpy(work, X, 2 * size * sizeof(v8));
  for (int q = 0; q < s->leaders; q++)
    for (int j = 0, i = s->leader[q], k = s->mate[i]; j < n; j++) {
      v8 r = splat(0.0), im = r;
      for (int l = 0; l < n; l++) {
        double x = left[2 * (l * n + j)], y = left[2 * (l * n + j) + 1];
        v8 a = work[i * n + l], b = work[size + i * n + l];
        r += x * a - y * b; im += y * a + x * b;
      }
      X[i * n + j] = r; X[size + i * n + j] = im;
      if (k != i) { X[k * n + j] = r; X[size + k * n + j] = -im; }
    }
}

/* Columns v, conj v of a real group become sqrt 2 Re v, sqrt 2 Im v (step 1, stride n, sign 1), or rows (n, 1, -1). */
static void make_real(int n, int at, int mate, int step, int stride, double sign, v8 *X) {
  for (int k = 0, size = n * n; k < n; k++) {
    v8 *a = X + at * step + k * stride, *b = X + mate * step + k * stride, ar = a[0], ai = a[size], br = b[0], bi = b[size];
    a[0] = (ar + br) * M_SQRT1_2;
    a[size] = (ai + bi) * M_SQRT1_2;
    b[0] = sign * (ai - bi) * M_SQRT1_2;
    b[size] = sign * (br - ar) * M_SQRT1_2;
  }
}

/* Coordinates of modes to those of the states, real groups with real columns; slopes at the nodes only. */
static void take_to_states(const Shape *s, int blocks, const int *group, const double *right, const double *left, Side *sides, v8 *work, double *residual) {
  int n = s->n;
  long size = 2L * n * n;
  for (int side = 0; side < 2; side++)
    for (int b = 0; b < blocks; b++) {
      v8 *T = sides[side].P + size * b, *slope = sides[side].slope + size * b, *inverse = sides[side].inverse + size * b, *B = sides[side].B + size * b;
      columns_to_states(s, right, T, work);
      if (!side) columns_to_states(s, right, slope, work);
      rows_to_states(s, left, inverse, work);
      for (int i = 0; i < n; i++) {
        int k = s->mate[i];
        if (k <= i || group[k] != group[i]) continue;
        make_real(n, i, k, 1, n, 1.0, T);
        if (!side) make_real(n, i, k, 1, n, 1.0, slope);
        make_real(n, i, k, 1, n, 1.0, B);
        make_real(n, i, k, n, 1, -1.0, inverse);
        make_real(n, i, k, n, 1, -1.0, B);
      }
    }
  for (int i = 0; i < n; i++) {
    int k = s->mate[i];
    if (k <= i || group[k] != group[i]) continue;
    for (int pass = 0; pass < 2; pass++) /* columns, then rows */
      for (int j = 0; j < n; j++) {
        double *a = residual + (pass ? i * n + j : j * n + i), *b = residual + (pass ? k * n + j : j * n + k);
        *a = *b = (*a + *b) * M_SQRT1_2;
      }
  }
}
