/* Eigenvalues of one small real matrix in each lane: Hessenberg form by reflections, then the complex QR method with Wilkinson's single shifts, for
 * all lanes until the last of them is done. Source: Golub, Van Loan, Matrix Computations, 7.4, 7.5. */
#ifndef FLEXLIN_EIGENVALUES_H
#define FLEXLIN_EIGENVALUES_H

#include "vectors.h"

enum { MAX_SHIFTS = 60 };

typedef struct { vec re, im; } Complex;

FORCED Complex c_sum(Complex a, vec by, Complex b) { return (Complex){a.re + by * b.re, a.im + by * b.im}; }
FORCED Complex c_product(Complex a, Complex b) { return (Complex){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
FORCED Complex c_conjugate(Complex a) { return (Complex){a.re, -a.im}; }
FORCED vec c_square(Complex a) { return a.re * a.re + a.im * a.im; }

static void reduce_hessenberg(int n, vec a[S][S]) {
  for (int m = 1; m < n - 1 && m < S - 1; m++) {
    vec v[S], size = splat(TINY);
    for (int i = m; i < n; i++) { v[i] = a[i][m - 1]; size += v[i] * v[i]; }
    size = v_sqrt(size);
    v[m] += v_copysign(size, v[m]);
    const vec beta = 1.0 / (size * v_abs(v[m]));
    for (int j = m - 1; j < n; j++) {
      vec dot = splat(0.0);
      for (int i = m; i < n; i++) dot += v[i] * a[i][j];
      for (int i = m; i < n; i++) a[i][j] -= beta * dot * v[i];
    }
    for (int i = 0; i < n; i++) {
      vec dot = splat(0.0);
      for (int j = m; j < n; j++) dot += a[i][j] * v[j];
      for (int j = m; j < n; j++) a[i][j] -= beta * dot * v[j];
    }
  }
}

/* The eigenvalue of the last two rows and columns of h that lies nearer to the last diagonal entry. */
static Complex find_shift(int last, Complex h[S][S]) {
  const vec one = splat(1.0), half = splat(0.5);
  const Complex d = h[last][last], beside = c_product(h[last - 1][last], h[last][last - 1]);
  Complex apart = c_sum(h[last - 1][last - 1], -one, d);
  apart = (Complex){half * apart.re, half * apart.im};
  const Complex square = c_sum(c_product(apart, apart), one, beside);
  const vec size = v_sqrt(c_square(square)), re = v_sqrt(half * v_abs(size + square.re)), im = v_sqrt(half * v_abs(size - square.re));
  const Complex root = {re, v_copysign(im, square.im)};
  const Complex far = c_sum(apart, v_copysign(one, apart.re * root.re + apart.im * root.im), root);
  return c_sum(d, -1.0 / (c_square(far) + TINY), c_product(beside, c_conjugate(far)));
}

/* h := R Q + shift for h - shift = Q R, of the leading rows and columns up to `last`. */
static void turn_once(int last, Complex shift, Complex h[S][S]) {
  const vec one = splat(1.0);
  Complex c[S], s[S];
  for (int k = 0; k <= last; k++) h[k][k] = c_sum(h[k][k], -one, shift);
  for (int k = 0; k < last; k++) {
    Complex x = h[k][k], y = h[k + 1][k];
    x.re += 1e-150; /* where both are nothing */
    const vec by = 1.0 / v_sqrt(c_square(x) + c_square(y));
    c[k] = (Complex){by * x.re, by * x.im};
    s[k] = (Complex){by * y.re, by * y.im};
    for (int j = k; j <= last; j++) {
      const Complex p = h[k][j], q = h[k + 1][j];
      h[k][j] = c_sum(c_product(c_conjugate(c[k]), p), one, c_product(c_conjugate(s[k]), q));
      h[k + 1][j] = c_sum(c_product(c[k], q), -one, c_product(s[k], p));
    }
  }
  for (int k = 0; k < last; k++)
    for (int i = 0; i <= k + 1; i++) {
      const Complex p = h[i][k], q = h[i][k + 1];
      h[i][k] = c_sum(c_product(p, c[k]), one, c_product(q, s[k]));
      h[i][k + 1] = c_sum(c_product(q, c_conjugate(c[k])), -one, c_product(p, c_conjugate(s[k])));
    }
  for (int k = 0; k <= last; k++) h[k][k] = c_sum(h[k][k], one, shift);
}

/* Eigenvalues (n,) of a, which is changed, in some lanes; returns in which of these they were found. Conjugates stand beside each other, the one
 * with positive imaginary part first: the other one is the shift for it. What is real up to rounding is real. */
static mask find_eigenvalues(int n, vec a[S][S], mask lanes, vec *re, vec *im) {
  Complex h[S][S];
  vec size = splat(0.0);
  mask second = no_lanes(); /* where the conjugate of the one found last comes next */
  reduce_hessenberg(n, a);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      h[i][j] = (Complex){i > j + 1 ? splat(0.0) : a[i][j], splat(0.0)};
      size += v_abs(h[i][j].re);
    }
  lanes &= (mask)(size < INFINITY);
  for (int last = n - 1; last >= 0; last--) {
    for (int tries = 0; last; tries++) {
      const vec below = v_sqrt(c_square(h[last][last - 1])), beside = v_sqrt(c_square(h[last][last])) + v_sqrt(c_square(h[last - 1][last - 1]));
      const mask found = (mask)(below <= 0.5 * EPS * beside);
      if (tries == MAX_SHIFTS) lanes &= found;
      if (all_lanes(found | ~lanes)) break;
      Complex shift = tries % 10 == 9 ? (Complex){below, below} : find_shift(last, h);
      if (last < n - 1) shift = (Complex){v_choose(second, re[last + 1], shift.re), v_choose(second, -im[last + 1], shift.im)};
      turn_once(last, shift, h);
    }
    const Complex x = h[last][last];
    const mask real = (mask)(v_abs(x.im) <= 4.0 * EPS * size);
    re[last] = x.re;
    im[last] = v_choose(real, splat(0.0), x.im);
    if (last < n - 1) {
      re[last] = v_choose(second, re[last + 1], re[last]);
      im[last] = v_choose(second, v_abs(im[last + 1]), im[last]);
      im[last + 1] = v_choose(second, -im[last], im[last + 1]);
    }
    second = ~second & ~real;
  }
  im[0] = v_choose(second, splat(0.0), im[0]);
  return lanes;
}

#endif
