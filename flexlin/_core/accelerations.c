/* Transition matrices of M y'' + D y' + K y = 0 by Gauss collocation in the accelerations, L segments at a time, without exchanging rows:
 * M_i w_i + D_i v_i + K_i y_i = 0,   v_i = v_0 + h sum_j a_ij w_j,   y_i = y_0 + h c_i v_0 + h^2 sum_j (a a)_ij w_j.
 * There are half as many unknowns as states, and M is never inverted. Source: Hairer, Norsett, Wanner, Solving ODEs I, II.14. */
#include "accelerations.h"

/* Blocks [M D K] of the stages (stages, m, 3 m) in units d: times d d'. */
static void gather_blocks(const Rule *r, int segments, const double *from, const double *d, vec *to) {
  int m = r->m, rows = r->stages * m;
  for (int l = 0; l < L; l++) { /* the last segment again where there are fewer */
    const double *x = from + (long)rows * 3 * m * (l < segments ? l : segments - 1);
    vec *y = to;
    for (int i = 0; i < r->stages; i++)
      for (int p = 0; p < m; p++)
        for (int block = 0; block < 3; block++)
          for (int q = 0; q < m; q++) (*y++)[l] = *x++ * (d[p] * d[q]);
  }
}

/* G w = right for the accelerations of all stages, G_ij = M_i (i = j) + h a_ij D_i + h^2 (a a)_ij K_i. The units are powers of two, which round
 * nothing. */
vec build_equations(const Rule *r, int segments, const double *blocks, const double *lengths, double *d, vec *own, vec *G, vec *right) {
  int m = r->m, s = r->stages, n = s * m;
  vec h;
  for (int p = 0; p < m; p++) d[p] = exp2(-round(0.5 * log2(fabs(blocks[p * 3 * m + p]))));
  for (int l = 0; l < L; l++) h[l] = lengths[l < segments ? l : segments - 1];
  gather_blocks(r, segments, blocks, d, own);
  for (int i = 0; i < s; i++)
    for (int p = 0; p < m; p++) {
      const vec *M = own + (i * m + p) * 3 * m, *D = M + m, *K = D + m;
      vec *row = G + (long)(i * m + p) * n, *y = right + (long)(i * m + p) * 2 * m;
      for (int j = 0; j < s; j++) {
        vec ha = h * r->a[i * s + j], hha = h * h * r->square[i * s + j];
        for (int q = 0; q < m; q++) row[j * m + q] = ha * D[q] + hha * K[q] + (i == j ? M[q] : splat(0.0));
      }
      for (int q = 0; q < m; q++) { y[q] = -K[q]; y[m + q] = -D[q] - h * r->c[i] * K[q]; }
    }
  return h;
}

/* Phi = [1, h; 0, 1] + [h^2 sum b_i (1 - c_i) w_i; h sum b_i w_i] of the first of the L, back in their own coordinates. */
void combine_stages(const Rule *r, int count, vec h, const vec *w, const double *d, double *Phi) {
  int m = r->m, columns = 2 * m;
  for (int p = 0; p < m; p++)
    for (int c = 0; c < columns; c++) {
      vec place = splat(0.0), rate = place;
      for (int i = 0; i < r->stages; i++) {
        vec own = r->b[i] * w[(i * m + p) * columns + c];
        place += (1.0 - r->c[i]) * own;
        rate += own;
      }
      double units = d[p] / d[c % m];
      place = units * h * h * place + splat(c == p) + (c == m + p ? h : splat(0.0));
      rate = units * h * rate + splat(c == m + p);
      for (int l = 0; l < count; l++) {
        double *to = Phi + (long)l * columns * columns;
        to[p * columns + c] = place[l];
        to[(m + p) * columns + c] = rate[l];
      }
    }
}

/* Transition matrices (segments, 2 m, 2 m) from [M D K] at all stages (segments, stages, m, 3 m) and lengths h; tableau: c, a, a a, b;
 * good (segments,): whether each is right to rounding. Returns 0 where there is no memory. */
CALLED int factor_accelerations(int m, int stages, int segments, const double *blocks, const double *lengths, const double *tableau, double *Phi, int *good) {
  Rule r = read_rule(m, stages, tableau);
  long n = (long)stages * m, columns = 2 * m;
  vec *memory = aligned_alloc(sizeof(vec), (3 * m * n + 2 * n * n + 3 * n * columns) * sizeof(vec));
  if (!memory) return 0;
  vec *own = memory, *G = own + 3 * m * n, *right = G + n * n, *w = right + n * columns, *work = w + n * columns;
  for (int k = 0; k < segments; k += L) {
    int count = segments - k < L ? segments - k : L;
    double d[m];
    vec h = build_equations(&r, count, blocks + 3 * m * n * k, lengths + k, d, own, G, right);
    int sound = solve_together(n, columns, count, G, right, w, work);
    combine_stages(&r, count, h, w, d, Phi + k * columns * columns);
    for (int l = 0; l < count; l++) good[k + l] = sound >> l & 1;
  }
  free(memory);
  return 1;
}
