/* What moves the eigenvalues of a product. */
#ifndef FLEXLIN_MOTION_H
#define FLEXLIN_MOTION_H

#include "schur.h"

/* Bounds |L left| size |right R| on couplings over each factor by what is not known, for left and right vectors at its beginning:
 * left (K, n, p) or none (1, and p = n), size (K, p, q), right (K, q, n) or none (1, and q = n). */
typedef struct { int p, q; const double *left, *size, *right; } Noise;

int bound_motion(const Form *form, const double *factors, const double *better, const double *counts, const Noise *noise, const double *scale,
                 cpx *shift, double *method, double *rounding);

#endif
