/* The modes of a mean matrix in groups: the computation of mean_modes.py. */
typedef void Geev(const char *, const char *, const int *, double *, const int *, double *, double *, double *, const int *, double *, const int *,
                  double *, const int *, int *, size_t, size_t); /* LAPACK's dgeev, and the lengths of its two words */

typedef struct { int n, groups; int *mate, *label, *partner; z *values, *right, *left; char *together; } Modes;
/* mate: the conjugate of each mode; label: its group; partner: the group of a group's conjugates; right (n, n): columns; left: rows. */

static Modes take_modes(int n, int *places, z *numbers, char *together) {
  return (Modes){n, 0, places, places + n, places + 2 * n, numbers, numbers + n, numbers + n + n * n, together};
}

/* The modes `from`, in the room of `to`. */
static void copy_modes(const Modes *from, Modes *to) {
  int n = from->n;
  to->groups = from->groups;
  memcpy(to->mate, from->mate, n * sizeof(int));
  memcpy(to->label, from->label, n * sizeof(int));
  memcpy(to->partner, from->partner, n * sizeof(int));
  memcpy(to->values, from->values, n * sizeof(z));
  memcpy(to->right, from->right, (long)n * n * sizeof(z));
  memcpy(to->left, from->left, (long)n * n * sizeof(z));
}

/* Eigenvalues (n,) and vectors as columns of vectors (n, n) of a real matrix (n, n); 0 where they are not found or there is no memory. */
static int find_eigenvectors(Geev *geev, int n, const double *matrix, z *values, z *vectors) {
  int length = 16 * n, none = 1, info = 1;
  double *memory = malloc((2L * n * n + 2 * n + length) * sizeof(double)), *A = memory, *V = A + n * n, *re = V + n * n, *im = re + n, unused[1];
  if (!memory) return 0;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) A[j * n + i] = matrix[i * n + j];
  geev("N", "V", &n, A, &n, re, im, unused, &none, V, &n, im + n, &length, &info, 1, 1);
  for (int k = 0; k < n && info == 0; k++) {
    values[k] = re[k] + I * im[k];
    int first = im[k] < 0.0 ? k - 1 : k; /* a pair: real parts, then imaginary ones */
    for (int i = 0; i < n; i++) vectors[i * n + k] = im[k] == 0.0 ? V[k * n + i] : V[first * n + i] + (im[k] < 0.0 ? -I : I) * V[(first + 1) * n + i];
  }
  free(memory);
  return info == 0;
}

/* Put modes together that are connected by neighbours, those of conjugates in a row: the order of the modes (n,), as `group_neighbours`. */
static void group_neighbours(Modes *m, int *columns) {
  int n = m->n, label[n], order[n], first[n + 1], owns = 0, at = 0;
  for (int i = 0; i < n; i++) label[i] = -1;
  for (int i = 0; i < n; i++) {
    if (label[i] >= 0) continue;
    first[owns] = at;
    order[at++] = i;
    label[i] = owns;
    for (int k = first[owns]; k < at; k++)
      for (int j = 0; j < n; j++)
        if (m->together[order[k] * n + j] && label[j] < 0) { label[j] = owns; order[at++] = j; }
    owns++;
  }
  first[owns] = at;
  int groups = 0, place = 0;
  for (int i = 0; i < owns; i++) {
    int other = label[m->mate[order[first[i]]]];
    if (other < i) continue;
    for (int pass = 0; pass < (other == i ? 1 : 2); pass++) {
      for (int k = first[i]; k < first[i + 1]; k++) {
        columns[place] = pass ? m->mate[order[k]] : order[k];
        m->label[place++] = groups;
      }
      m->partner[groups] = other == i ? groups : pass ? groups - 1 : groups + 1;
      groups++;
    }
  }
  m->groups = groups;
}

/* Take the modes in another order: `columns` (n,); work (2 n n + n). */
static void reorder_modes(Modes *m, const int *columns, z *work) {
  int n = m->n, place[n], mate[n];
  z *right = work, *left = right + n * n, *values = left + n * n;
  for (int k = 0; k < n; k++) place[columns[k]] = k;
  for (int k = 0; k < n; k++) {
    mate[k] = place[m->mate[columns[k]]];
    values[k] = m->values[columns[k]];
    for (int i = 0; i < n; i++) { right[i * n + k] = m->right[i * n + columns[k]]; left[k * n + i] = m->left[columns[k] * n + i]; }
  }
  memcpy(m->mate, mate, n * sizeof(int));
  memcpy(m->right, right, (long)n * n * sizeof(z));
  memcpy(m->left, left, (long)n * n * sizeof(z));
  memcpy(m->values, values, n * sizeof(z));
}

/* The root of the sum of squares of |left| |right|, which no units of the states change. */
static double measure_condition(int n, const z *left, const z *right) {
  double sum = 0.0;
  for (int i = 0; i < n; i++) {
    double row[n];
    for (int j = 0; j < n; j++) row[j] = 0.0;
    for (int k = 0; k < n; k++) {
      double size = cabs(left[i * n + k]);
      for (int j = 0; j < n; j++) row[j] += size * cabs(right[k * n + j]);
    }
    for (int j = 0; j < n; j++) sum += row[j] * row[j];
  }
  return sqrt(sum);
}

/* Group modes, of which eigenvalues and right vectors are there: together where closer than `closest`, and than `parted` in their real parts; 0 where
 * they do not serve. */
static int group_modes(double closest, double parted, double largest, Modes *m, z *work) {
  int n = m->n, columns[n], all = 1;
  for (int i = 0; i < n; i++) {
    double least = INFINITY;
    for (int j = 0; j < n; j++) {
      z gap = m->values[i] - m->values[j];
      m->together[i * n + j] = cabs(gap) < closest && fabs(creal(gap)) < parted;
      all &= m->together[i * n + j];
      double apart = cabs(conj(m->values[i]) - m->values[j]);
      if (apart < least) { least = apart; m->mate[i] = j; }
    }
  }
  for (int i = 0; i < n; i++)
    if (m->mate[m->mate[i]] != i) return 0;
  if (all) return 0;
  group_neighbours(m, columns);
  if (m->groups == 1 || !invert_complex(n, m->right, m->left, work)) return 0;
  if (!(measure_condition(n, m->left, m->right) < largest)) return 0;
  reorder_modes(m, columns, work);
  return 1;
}

/* Each mode in one group with its partner (n,), -1 for none, and the conjugates likewise; 0 where all join. */
static int join_modes(Modes *m, const int *partner, z *work) {
  int n = m->n, columns[n];
  for (int e = 0; e < n * n; e++) m->together[e] = m->label[e / n] == m->label[e % n];
  for (int i = 0; i < n; i++) {
    if (partner[i] < 0) continue;
    int a = m->mate[i], b = m->mate[partner[i]];
    m->together[i * n + partner[i]] = m->together[partner[i] * n + i] = m->together[a * n + b] = m->together[b * n + a] = 1;
  }
  group_neighbours(m, columns);
  if (m->groups == 1) return 0;
  reorder_modes(m, columns, work);
  return 1;
}

/* Whether perturbation theory says all of the groups: real ones, of modes that can be followed over a period. */
static int may_be_tame(const Modes *m, double period, double most) {
  double growth[m->n];
  for (int i = 0, size; i < m->n; i += size) {
    for (size = 0; i + size < m->n && m->label[i + size] == m->label[i]; size++) growth[size] = creal(m->values[i + size]) * period;
    if (size > 1 && (m->partner[m->label[i]] != m->label[i] || !are_in_bands(size, growth, most))) return 0;
  }
  return 1;
}

/* How far A (times, n, n), every `step`th time, mixes two modes of its mean that are not in one group, at most; work (3 n n). */
static double find_mixing(const Modes *m, int times, int step, const double *A, z *work) {
  int n = m->n, size = n * n;
  z *own = work, *half = own + size, *real = half + size;
  double largest[size], worst = 0.0;
  for (int e = 0; e < size; e++) largest[e] = 0.0;
  for (int t = 0; t < times; t += step) {
    for (int e = 0; e < size; e++) real[e] = A[(long)t * size + e];
    multiply_complex(n, m->left, real, half);
    multiply_complex(n, half, m->right, own);
    for (int e = 0; e < size; e++) largest[e] = fmax(largest[e], cabs(own[e]));
  }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++)
      if (m->label[i] != m->label[j]) worst = fmax(worst, largest[i * n + j] * largest[j * n + i] / pow(cabs(m->values[i] - m->values[j]), 2));
  return sqrt(worst);
}
