/* Long products of real matrices F_(K-1) ... F_0: their periodic Schur form, and what moves their eigenvalues. */
#ifndef FLEXLIN_SCHUR_H
#define FLEXLIN_SCHUR_H

#include "core.h"

#include <complex.h>

typedef double complex cpx;

/* Without looking for numbers that are not finite. */
static inline cpx times(cpx a, cpx b) { return CMPLX(creal(a) * creal(b) - cimag(a) * cimag(b), creal(a) * cimag(b) + cimag(a) * creal(b)); }
static inline cpx over(cpx a, cpx b) {
  double scale = fmax(fabs(creal(b)), fabs(cimag(b)));
  cpx c = b / scale;
  return times(a, conj(c)) / (scale * (creal(c) * creal(c) + cimag(c) * cimag(c)));
}
static inline double size_of(cpx a) { return sqrt(creal(a) * creal(a) + cimag(a) * cimag(a)); } /* where squares are numbers */

/* Products of an A of m rows, or columns where it is turned, and B (n, p) into C (m, p), from terms of A and B at i, k and j. */
#define PRODUCT(name, left, right, made, term)                                                                               \
  static inline void name(int m, int n, int p, const left *restrict A, const right *restrict B, made *restrict C) {          \
    for (int i = 0; i < m; i++) {                                                                                            \
      made *row = C + (long)i * p;                                                                                           \
      for (int j = 0; j < p; j++) row[j] = 0.0;                                                                              \
      for (int k = 0; k < n; k++)                                                                                            \
        for (int j = 0; j < p; j++) row[j] += term;                                                                          \
    }                                                                                                                        \
  }
PRODUCT(multiply_real, double, double, double, A[(long)i * n + k] * B[(long)k * p + j])
PRODUCT(multiply_complex, cpx, cpx, cpx, times(A[(long)i * n + k], B[(long)k * p + j]))
PRODUCT(multiply_real_left, double, cpx, cpx, A[(long)i * n + k] * B[(long)k * p + j])
PRODUCT(multiply_mixed, cpx, double, cpx, A[(long)i * n + k] * B[(long)k * p + j])
PRODUCT(multiply_transposed, double, double, double, A[(long)k * m + i] * B[(long)k * p + j])
PRODUCT(multiply_adjoint, cpx, cpx, cpx, times(conj(A[(long)k * m + i]), B[(long)k * p + j]))

/* LAPACK's routines, with the lengths of their words. */
typedef void (*Balance)(const char *, const int *, double *, const int *, int *, int *, double *, int *, size_t);
typedef void (*Schur)(const char *, const char *, void *, const int *, cpx *, const int *, int *, cpx *, cpx *, const int *, cpx *, const int *,
                      double *, int *, int *, size_t, size_t);
typedef void (*Exchange)(const char *, const int *, cpx *, const int *, cpx *, const int *, const int *, const int *, int *, size_t);
typedef void (*Triangularize)(const int *, const int *, void *, const int *, void *, void *, int *);
typedef void (*Generate)(const int *, const int *, const int *, void *, const int *, const void *, void *, int *);
typedef void (*Solve)(const int *, const int *, double *, const int *, int *, double *, const int *, int *);
typedef struct { Balance dgebal; Schur zgees; Triangularize dgelq2, zgelq2; Generate dorgl2, zungl2; Solve dgesv; Exchange ztrexc; } Lapack;

/* F_k Q_k = Q_(k+1) T_k, Q_K = Q_0 closure, closure = diag(turn) up to `defect` (n, n): of a cluster, all that any of it misses. start: real bases
 * of the invariant subspaces at the beginning. */
typedef struct { int n, count; cpx *Q, *T, *closure, *turn, *logs; double *defect, *start; } Form;

enum { NO_MEMORY = -1, SOUND, NOT_FINITE, NO_SCHUR_FORM };

int multiply_pairs(int n, int count, double *factors, double *work);
/* Q (n, n) of A = Q R; A becomes R; work (2 n). */
void make_orthogonal(const Lapack *lapack, int n, double *A, double *Q, double *work);
int find_schur_form(const Lapack *lapack, const double *factors, const double *start, Form *form);
double wrap_angle(double angle);

/* Bounds |L left| size |right R| on couplings over each factor by what is not known, for left and right vectors at its beginning:
 * left (K, n, p) or none (1, and p = n), size (K, p, q), right (K, q, n) or none (1, and q = n). */
typedef struct { int p, q; const double *left, *size, *right; } Noise;

int bound_motion(const Form *form, const double *factors, const double *better, const double *counts, const Noise *noise, const double *scale,
                 int part, cpx *shift, double *method, double *rounding);

#endif
