/* Vectors of eight numbers, and the elementary functions of scalars (s_) and vectors (v_) that coefficients are made of. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { L = 8 };
typedef double v8 __attribute__((vector_size(64)));
typedef long long m8 __attribute__((vector_size(64)));
#ifdef __AVX512F__
#define HOLD(x) __asm__("" : "+v"(x)) /* in a register from here on, not read from memory again */
#else
#define HOLD(x)
#endif

static inline v8 splat(double x) { return (v8){x, x, x, x, x, x, x, x}; }
static inline v8 v_choose(m8 where, v8 a, v8 b) { return (v8)((where & (m8)a) | (~where & (m8)b)); }
static inline v8 v_abs(v8 a) { return (v8)((m8)a & 0x7fffffffffffffffLL); }
static inline v8 v_copysign(v8 a, v8 b) { return (v8)(((m8)a & 0x7fffffffffffffffLL) | ((m8)b & ~0x7fffffffffffffffLL)); }
static inline v8 v_max(v8 a, v8 b) { return v_choose((m8)(a > b), a, b); }
static inline v8 v_min(v8 a, v8 b) { return v_choose((m8)(a < b), a, b); }
static inline v8 v_sqrt(v8 a) {
  v8 r;
  for (int l = 0; l < L; l++) r[l] = __builtin_sqrt(a[l]);
  return r;
}
static inline v8 v_double(m8 k) {
  v8 r;
  for (int l = 0; l < L; l++) r[l] = (double)k[l];
  return r;
}
static inline int all_lanes(m8 where) {
  long long all = -1;
  for (int l = 0; l < L; l++) all &= where[l];
  return all != 0;
}
static inline int any_lane(m8 where) {
  long long any = 0;
  for (int l = 0; l < L; l++) any |= where[l];
  return any != 0;
}
/* The nearest whole number, for |a| < 2^51. */
static inline v8 v_round(v8 a) { return (a + 6755399441055744.0) - 6755399441055744.0; }

/* log x = 2 atanh((x - 1)/(x + 1)) + k log 2 for positive normal x. Polynomial: FreeBSD's e_log.c. */
static v8 v_log(v8 x) {
  m8 bits = (m8)x, k = (bits >> 52) - 1023;
  v8 m = (v8)((bits & 0xfffffffffffffLL) | 0x3ff0000000000000LL);
  m8 large = (m8)(m > 1.41421356237309504880);
  k -= large;
  m = v_choose(large, 0.5 * m, m) - 1.0;
  v8 s = m / (2.0 + m), z = s * s, w = z * z, half = 0.5 * m * m, e = v_double(k);
  v8 odd = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
  v8 even = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
  return e * 6.93147180369123816490e-01 - ((half - (s * (half + odd + even) + e * 1.90821492927058770002e-10)) - m);
}

/* sin x, and cos x where `quarter` is 1. Reduction by three parts of pi/2; polynomials: FreeBSD's k_sin.c, k_cos.c. */
static v8 v_circular(v8 x, long long quarter) {
  v8 k = v_round(x * 0.636619772367581343076);
  v8 r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) - k * 2.02226624879595063154e-21;
  m8 q = ((m8)(k + 6755399441055744.0) & 3) + quarter;
  v8 z = r * r;
  v8 s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04
    + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
  v8 c = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05
    + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
  v8 found = v_choose((m8)((q & 1) == 1), c, s);
  found = (v8)((m8)found ^ (((q >> 1) & 1) << 63));
  for (int l = 0; l < L; l++)
    if (!(fabs(x[l]) < 1e5)) found[l] = quarter ? cos(x[l]) : sin(x[l]);
  return found;
}
static v8 v_sin(v8 x) { return v_circular(x, 0); }
static v8 v_cos(v8 x) { return v_circular(x, 1); }

#define LANES_1(name) static v8 v_##name(v8 a) { v8 r; for (int l = 0; l < L; l++) r[l] = name(a[l]); return r; }
#define LANES_2(name) static v8 v_##name(v8 a, v8 b) { v8 r; for (int l = 0; l < L; l++) r[l] = name(a[l], b[l]); return r; }
LANES_1(exp) LANES_1(tan) LANES_1(asin) LANES_1(acos) LANES_1(atan) LANES_1(sinh) LANES_1(cosh) LANES_1(tanh) LANES_1(asinh)
LANES_1(acosh) LANES_1(atanh) LANES_1(floor) LANES_1(ceil) LANES_1(erf) LANES_1(log1p) LANES_1(expm1)
LANES_2(pow) LANES_2(fmod) LANES_2(atan2) LANES_2(fmin) LANES_2(fmax) LANES_2(hypot) LANES_2(remainder)
static v8 v_log_any(v8 a) { v8 r; for (int l = 0; l < L; l++) r[l] = log(a[l]); return r; }
static v8 v_fabs(v8 a) { return v_abs(a); }
static double s_sign(double a) { return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : a; }
static v8 v_sign(v8 a) { v8 r; for (int l = 0; l < L; l++) r[l] = s_sign(a[l]); return r; }
static v8 v_of(m8 where) { return v_choose(where, splat(1.0), splat(0.0)); }
static v8 v_if(v8 where, v8 a) { v8 r; for (int l = 0; l < L; l++) r[l] = where[l] != 0.0 ? a[l] : 0.0; return r; }
