/* What rounding and the error of the coefficients' series may do to the entries of the generator. */

/* Z (+)= |X| |Y|, (rows, inner) and (inner, columns); moduli of complex numbers, whose imaginary parts stand x_im, y_im further. */
static v8 size_of(const v8 *x, long im) {
  if (!im) { v8 r; for (int l = 0; l < 8; l++) r[l] = fabs(x[0][l]); return r; }
  v8 r = x[0] * x[0] + x[im] * x[im];
  for (int l = 0; l < 8; l++) r[l] = sqrt(r[l]);
  return r;
}
static void take_sizes(int count, const v8 *X, long im, v8 *Z) { for (int e = 0; e < count; e++) Z[e] = size_of(X + e, im); }
static void add_product(int rows, int inner, int columns, const v8 *X, const v8 *Y, v8 *Z) {
  for (int i = 0; i < rows; i++)
    for (int k = 0; k < inner; k++) {
      v8 x = X[i * inner + k];
      for (int j = 0; j < columns; j++) Z[i * columns + j] += x * Y[k * columns + j];
    }
}

typedef struct { int m; const double *samples, *error, *inverse; double rounding, known, uncertain; } Unknown;
/* m: coordinates behind the states, or 0; samples: [M D K] at all times, or none; error: of their series, or of that of A; inverse: M^-1 at
 * every fourth time; what one rounding is, how much of an entry is not known, and the part of it that adds up. */

/* |left| |dA| |right| in the form of second order, as `couple_second_order` in uncertainty.py, added to Z. */
static void couple_second_order(int n, const Unknown *u, const v8 *blocks, const v8 *inverse, const v8 *A, const v8 *T, const v8 *X, v8 *work, v8 *Z) {
  int m = u->m, size = n * n, half = m * n;
  v8 *z = work, *V = z + 2 * half, *moved = V + 2 * half, *part = moved + half, *other = part + half;
  memset(work, 0, (6L * half + m * m) * sizeof(v8));
  for (int p = 0; p < 2; p++) {
    add_product(m, n, n, A + half, T + p * size, z + p * half);
    for (int i = 0; i < n; i++) add_product(1, m, m, X + p * size + i * n + m, inverse, V + p * half + i * m);
  }
  for (int c = 0; c < 3; c++) { /* M, D, K with accelerations, rates, positions */
    for (int i = 0; i < m; i++)
      for (int j = 0; j < m; j++) {
        int e = i * 3 * m + c * m + j;
        other[i * m + j] = u->known * size_of(blocks + e, 0) + u->error[e];
      }
    const v8 *with = c == 0 ? z : c == 1 ? T + half : T;
    take_sizes(half, with, c == 0 ? half : size, part);
    add_product(m, m, n, other, part, moved);
  }
  take_sizes(half, V, half, part);
  add_product(n, m, n, part, moved, Z);
}

/* The entries' rounding, mean over every fourth time: as `with_evidence` in decouple.py. */
static void find_rounding(int n, int blocks, const Unknown *u, const v8 *A, const Side *at, v8 *work, double *rounding) {
  int size = n * n, m = u->m, every[8] = {1, 0, 1, 0, 1, 0, 1, 0};
  v8 *a = work, *t = a + size, *x = t + size, *first = x + size, *sum = first + size, *more = sum + size, *MDK = more + size, *inverse = MDK + 3 * m * m;
  memset(rounding, 0, size * sizeof(double));
  for (int b = 0; b < blocks; b++) {
    const v8 *T = at->P + 2L * size * b, *X = at->inverse + 2L * size * b, *own = A + (long)size * b;
    take_sizes(size, own, 0, a);
    take_sizes(size, T, size, t);
    take_sizes(size, X, size, x);
    take_sizes(size, at->slope + 2L * size * b, size, first);
    memset(sum, 0, 2L * size * sizeof(v8));
    add_product(n, n, n, a, t, first);
    add_product(n, n, n, x, first, sum);
    if (m) {
      gather(1, 3 * m * m, 8, 2, 16 * b, u->samples, MDK);
      for (int l = 0; l < 8; l += 2)
        for (int e = 0; e < m * m; e++) inverse[e][l] = inverse[e][l + 1] = u->inverse[(4L * b + l / 2) * m * m + e];
      couple_second_order(n, u, MDK, inverse, own, T, X, inverse + m * m, more);
    } else {
      for (int e = 0; e < size; e++) a[e] = u->known * a[e] + u->error[e];
      memset(first, 0, size * sizeof(v8));
      add_product(n, n, n, a, t, first);
      add_product(n, n, n, x, first, more);
    }
    for (int e = 0; e < size; e++)
      for (int l = 0; l < 8; l++)
        if (every[l]) rounding[e] += (u->rounding * sum[e][l] + u->uncertain * more[e][l]) / (4 * blocks);
  }
}

