/* The operations of a program, with the numbers that CasADi gives them (casadi/core/calculus.hpp). */
#include "core.h"
#include "program.h"
#include <stdint.h>

#define EACH(expression)             \
  for (int j = 0; j < wide; j++) {   \
    const double x = p[j], y = q[j]; \
    (void)y;                         \
    r[j] = (expression);             \
  }                                  \
  break

/* The sine of `wide` numbers (quarter 0) or their cosine (1): less n pi/2 in three parts, then polynomials on [-pi/4, pi/4]; within an ulp.
 * Large ones are the library's. Source: fdlibm 5.3, e_rem_pio2.c, k_sin.c, k_cos.c. */
FORCED void turn(const int wide, const double *angles, double *to, int quarter) {
  double own[WIDE];
  int small = 1;
  memcpy(own, angles, wide * sizeof *own);
  for (int j = 0; j < wide; j++) {
    double shifted = own[j] * 6.36619772367581382433e-01 + 0x1.8p52, n = shifted - 0x1.8p52; /* the nearest whole number, in the last bits too */
    uint64_t which;
    memcpy(&which, &shifted, sizeof which);
    which += (unsigned)quarter;
    double first = own[j] - n * 1.57079632673412561417e+00, second = n * 6.07710050630396597660e-11, rough = first - second;
    double third = n * 2.02226624879595063154e-21 - ((first - rough) - second), x = rough - third, y = (rough - x) - third, z = x * x;
    double s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06
               + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    double c = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05
               + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
    double sine = x - ((z * (0.5 * y - z * x * s) - y) + z * x * 1.66666666666666324348e-01);
    double half = 0.5 * z, near = 1.0 - half, cosine = near + (((1.0 - near) - half) + (z * z * c - x * y));
    double value = which & 1 ? cosine : sine;
    to[j] = which & 2 ? -value : value;
    small &= fabs(own[j]) <= 1e5;
  }
  for (int j = 0; j < wide && !small; j++)
    if (!(fabs(own[j]) <= 1e5)) to[j] = quarter ? cos(own[j]) : sin(own[j]);
}

FORCED long run_lanes(const int wide, long steps, const Step *code, double *memory) {
  for (long k = 0; k < steps; k++) {
    const Step s = code[k];
    double *r = memory + (long)s.to * wide;
    if (s.op == 44) {
      double value;
      memcpy(&value, &code[k].a, sizeof value);
      for (int j = 0; j < wide; j++) r[j] = value;
      continue;
    }
    const double *p = memory + (long)s.a * wide, *q = memory + (long)s.b * wide;
    switch (s.op) {
    case 0: EACH(x);
    case 1: EACH(x + y);
    case 2: EACH(x - y);
    case 3: EACH(x * y);
    case 4: EACH(x / y);
    case 5: EACH(-x);
    case 6: EACH(exp(x));
    case 7: EACH(log(x));
    case 8:
    case 9: EACH(pow(x, y));
    case 10: EACH(sqrt(x));
    case 11: EACH(x * x);
    case 12: EACH(2.0 * x);
    case 13:
    case 14: turn(wide, p, r, s.op - 13); break;
    case 15: EACH(tan(x));
    case 16: EACH(asin(x));
    case 17: EACH(acos(x));
    case 18: EACH(atan(x));
    case 19: EACH((double)(x < y));
    case 20: EACH((double)(x <= y));
    case 21: EACH((double)(x == y));
    case 22: EACH((double)(x != y));
    case 23: EACH((double)!x);
    case 24: EACH((double)(x && y));
    case 25: EACH((double)(x || y));
    case 26: EACH(floor(x));
    case 27: EACH(ceil(x));
    case 28: EACH(fmod(x, y));
    case 29: EACH(fabs(x));
    case 30: EACH(x < 0 ? -1.0 : x > 0 ? 1.0 : x);
    case 31: EACH(copysign(x, y));
    case 32: EACH(x ? y : 0.0);
    case 33: EACH(erf(x));
    case 34: EACH(x <= y || y != y ? x : y);
    case 35: EACH(x >= y || y != y ? x : y);
    case 36: EACH(1.0 / x);
    case 37: EACH(sinh(x));
    case 38: EACH(cosh(x));
    case 39: EACH(tanh(x));
    case 40: EACH(asinh(x));
    case 41: EACH(acosh(x));
    case 42: EACH(atanh(x));
    case 43: EACH(atan2(x, y));
    case 93: EACH(log1p(x));
    case 94: EACH(expm1(x));
    case 95: EACH(hypot(x, y));
    case 97: EACH(remainder(x, y));
    default: return k + 1;
    }
  }
  return 0;
}

long run_steps(int wide, long steps, const Step *code, double *memory) {
  return wide == WIDE ? run_lanes(WIDE, steps, code, memory) : run_lanes(FEW, steps, code, memory);
}
