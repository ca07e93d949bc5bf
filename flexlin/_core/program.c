/* The operations of a program, with the numbers that CasADi gives them (casadi/core/calculus.hpp). */
#include "core.h"
#include "program.h"

#define EACH(expression)             \
  for (int j = 0; j < WIDE; j++) {   \
    const double x = p[j], y = q[j]; \
    (void)y;                         \
    r[j] = (expression);             \
  }                                  \
  break

long run_steps(long steps, const Step *code, double *memory) {
  for (long k = 0; k < steps; k++) {
    const Step s = code[k];
    double *r = memory + (long)s.to * WIDE;
    if (s.op == 44) {
      double value;
      memcpy(&value, &code[k].a, sizeof value);
      for (int j = 0; j < WIDE; j++) r[j] = value;
      continue;
    }
    const double *p = memory + (long)s.a * WIDE, *q = memory + (long)s.b * WIDE;
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
    case 13: EACH(sin(x));
    case 14: EACH(cos(x));
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
