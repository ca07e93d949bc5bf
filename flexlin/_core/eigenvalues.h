/* Eigenvalues of one small matrix: Hessenberg form by elimination, then Francis' double shifts (EISPACK's elmhes and hqr). */
#ifndef FLEXLIN_EIGENVALUES_H
#define FLEXLIN_EIGENVALUES_H

#include "vectors.h"

enum { MAX_SHIFTS = 60, EDGE = S < 4 ? 4 : S }; /* the compiler sees steps of larger matrices beside small ones */

static void reduce_hessenberg(int n, double a[EDGE][EDGE]) {
  for (int m = 1; m < n - 1; m++) {
    int pivot = m;
    for (int i = m + 1; i < n; i++)
      if (fabs(a[i][m - 1]) > fabs(a[pivot][m - 1])) pivot = i;
    if (pivot != m) {
      for (int j = m - 1; j < n; j++) { double t = a[pivot][j]; a[pivot][j] = a[m][j]; a[m][j] = t; }
      for (int i = 0; i < n; i++) { double t = a[i][pivot]; a[i][pivot] = a[i][m]; a[i][m] = t; }
    }
    if (a[m][m - 1] == 0.0) continue;
    for (int i = m + 1; i < n; i++) {
      double y = a[i][m - 1] / a[m][m - 1];
      if (y == 0.0) continue;
      a[i][m - 1] = 0.0;
      for (int j = m; j < n; j++) a[i][j] -= y * a[m][j];
      for (int k = 0; k < n; k++) a[k][m] += y * a[k][i];
    }
  }
}

static int find_eigenvalues(int n, double a[EDGE][EDGE], double *re, double *im) {
  double size = 0.0, t = 0.0, p = 0, q = 0, r = 0, s, w, x, y, z;
  reduce_hessenberg(n, a);
  for (int i = 0; i < n; i++)
    for (int j = i ? i - 1 : 0; j < n; j++) size += fabs(a[i][j]);
  if (!(size < INFINITY)) return 0;
  for (int last = n - 1, tries = 0; last >= 0;) {
    int l = last;
    for (; l >= 1; l--) {
      s = fabs(a[l - 1][l - 1]) + fabs(a[l][l]);
      if (s == 0.0) s = size;
      if (fabs(a[l][l - 1]) <= 1.1102230246251565e-16 * s) { a[l][l - 1] = 0.0; break; }
    }
    x = a[last][last];
    if (l == last) { re[last] = x + t; im[last] = 0.0; last--; tries = 0; continue; }
    y = a[last - 1][last - 1];
    w = a[last][last - 1] * a[last - 1][last];
    if (l == last - 1) {
      p = 0.5 * (y - x);
      q = p * p + w;
      z = sqrt(fabs(q));
      x += t;
      if (q >= 0.0) {
        z = p + copysign(z, p);
        re[last - 1] = re[last] = x + z;
        if (z != 0.0) re[last] = x - w / z;
        im[last - 1] = im[last] = 0.0;
      } else {
        re[last - 1] = re[last] = x + p;
        im[last - 1] = z;
        im[last] = -z;
      }
      last -= 2;
      tries = 0;
      continue;
    }
    if (tries == MAX_SHIFTS) return 0;
    if (tries && tries % 10 == 0) {
      t += x;
      for (int i = 0; i <= last; i++) a[i][i] -= x;
      s = fabs(a[last][last - 1]) + fabs(a[last - 1][last - 2]);
      y = x = 0.75 * s;
      w = -0.4375 * s * s;
    }
    tries++;
    int m = last - 2;
    for (; m >= l; m--) {
      z = a[m][m];
      r = x - z;
      s = y - z;
      p = (r * s - w) / a[m + 1][m] + a[m][m + 1];
      q = a[m + 1][m + 1] - z - r - s;
      r = a[m + 2][m + 1];
      s = 1.0 / (fabs(p) + fabs(q) + fabs(r));
      p *= s; q *= s; r *= s;
      if (m == l) break;
      double u = fabs(a[m][m - 1]) * (fabs(q) + fabs(r));
      double v = fabs(p) * (fabs(a[m - 1][m - 1]) + fabs(z) + fabs(a[m + 1][m + 1]));
      if (u <= 1.1102230246251565e-16 * v) break;
    }
    for (int i = m + 2; i <= last; i++) {
      a[i][i - 2] = 0.0;
      if (i != m + 2) a[i][i - 3] = 0.0;
    }
    for (int k = m; k < last; k++) {
      if (k != m) {
        p = a[k][k - 1];
        q = a[k + 1][k - 1];
        r = k != last - 1 ? a[k + 2][k - 1] : 0.0;
        x = fabs(p) + fabs(q) + fabs(r);
        if (x == 0.0) continue;
        s = 1.0 / x;
        p *= s; q *= s; r *= s;
      }
      s = copysign(sqrt(p * p + q * q + r * r), p);
      if (s == 0.0) continue;
      if (k != m) a[k][k - 1] = -s * x;
      else if (l != m) a[k][k - 1] = -a[k][k - 1];
      p += s;
      double is = 1.0 / s, ip = 1.0 / p;
      x = p * is; y = q * is; z = r * is;
      q *= ip; r *= ip;
      for (int j = k; j <= last; j++) {
        p = a[k][j] + q * a[k + 1][j];
        if (k != last - 1) { p += r * a[k + 2][j]; a[k + 2][j] -= p * z; }
        a[k + 1][j] -= p * y;
        a[k][j] -= p * x;
      }
      int end = last < k + 3 ? last : k + 3;
      for (int i = l; i <= end; i++) {
        p = x * a[i][k] + y * a[i][k + 1];
        if (k != last - 1) { p += z * a[i][k + 2]; a[i][k + 2] -= p * r; }
        a[i][k + 1] -= p * q;
        a[i][k] -= p;
      }
    }
  }
  return 1;
}

#endif
