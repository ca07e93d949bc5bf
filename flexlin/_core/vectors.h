/* Vectors of eight numbers, one of each of eight systems: masks, and what needs them. */
#ifndef FLEXLIN_VECTORS_H
#define FLEXLIN_VECTORS_H

#include "lanes.h"

#define S STATES /* of each size that CMakeLists.txt lists */
#define H ROWS

enum { L = 8 };
typedef long long m8 __attribute__((vector_size(64)));
#ifdef __AVX512F__
#define HOLD(x) __asm__("" : "+v"(x)) /* in a register from here on, not read from memory again */
#define REGISTERS 32 /* that hold eight numbers */
#else
#define HOLD(x)
#define REGISTERS 8
#endif
#define UNROLL _Pragma("GCC unroll 36")
#define FORCED static inline __attribute__((always_inline))

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
static inline m8 no_lanes(void) { return (m8)splat(0.0); }
static inline m8 every_lane(void) { return ~no_lanes(); }
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

#endif
