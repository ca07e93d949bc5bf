/* Long products of real matrices F_(K-1) ... F_0: their periodic Schur form, and what moves their eigenvalues. */
#ifndef FLEXLIN_PRODUCT_H
#define FLEXLIN_PRODUCT_H

#include "core.h"

#define EPS 2.220446049250313e-16
#define TINY 2.2250738585072014e-308

typedef struct { double re, im; } cpx;

static inline cpx c_times(cpx a, cpx b) { return (cpx){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
static inline cpx c_over(cpx a, cpx b) {
  double scale = fmax(fabs(b.re), fabs(b.im)), x = b.re / scale, y = b.im / scale, size = scale * (x * x + y * y);
  return (cpx){(a.re * x + a.im * y) / size, (a.im * x - a.re * y) / size};
}
static inline cpx c_conj(cpx a) { return (cpx){a.re, -a.im}; }
static inline double c_abs(cpx a) { return hypot(a.re, a.im); }
static inline double c_size(cpx a) { return sqrt(a.re * a.re + a.im * a.im); } /* where squares are numbers */

/* LAPACK's routines, with the lengths of their words. */
typedef void (*Balance)(const char *, const int *, double *, const int *, int *, int *, double *, int *, size_t);
typedef void (*Schur)(const char *, const char *, void *, const int *, cpx *, const int *, int *, cpx *, cpx *, const int *, cpx *, const int *,
                      double *, int *, int *, size_t, size_t);
typedef void (*Triangularize)(const int *, const int *, cpx *, const int *, cpx *, cpx *, const int *, int *);
typedef void (*Generate)(const int *, const int *, const int *, cpx *, const int *, const cpx *, cpx *, const int *, int *);
typedef struct { Balance dgebal; Schur zgees; Triangularize zgeqrf; Generate zungqr; } Lapack;

/* F_k Q_k = Q_(k+1) T_k, Q_K = Q_0 diag(turn) up to `defect`; start: real bases of the invariant subspaces at the beginning. */
typedef struct { int n, count; cpx *Q, *T, *turn, *logs; double *start, defect; } Form;

enum { SOUND, NO_MEMORY, NOT_FINITE, NO_SCHUR_FORM };

void multiply_real(int n, const double *A, const double *B, double *C);
void multiply_complex(int n, const cpx *A, const cpx *B, cpx *C);
int multiply_pairs(int n, int count, double *factors, double *work);
/* Q (n, n) of A = Q R; A becomes R; work (2 n). */
void make_orthogonal(int n, double *A, double *Q, double *work);
int find_schur_form(const Lapack *lapack, const double *factors, const double *start, Form *form);
double wrap_angle(double angle);

#endif
