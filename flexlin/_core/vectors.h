/* Vectors of L numbers, one of each of L systems: masks, and what needs them. */
#ifndef FLEXLIN_VECTORS_H
#define FLEXLIN_VECTORS_H

#include "lanes.h"

#define S STATES /* of each size that CMakeLists.txt lists */
#define H ROWS

typedef long long mask __attribute__((vector_size(sizeof(vec))));

static inline vec v_choose(mask where, vec a, vec b) { return (vec)((where & (mask)a) | (~where & (mask)b)); }
static inline vec v_abs(vec a) { return (vec)((mask)a & 0x7fffffffffffffffLL); }
static inline vec v_copysign(vec a, vec b) { return (vec)(((mask)a & 0x7fffffffffffffffLL) | ((mask)b & ~0x7fffffffffffffffLL)); }
static inline vec v_max(vec a, vec b) { return v_choose((mask)(a > b), a, b); }
static inline vec v_min(vec a, vec b) { return v_choose((mask)(a < b), a, b); }
static inline vec v_sqrt(vec a) {
  vec r;
  for (int l = 0; l < L; l++) r[l] = __builtin_sqrt(a[l]);
  return r;
}
static inline mask no_lanes(void) { return (mask)splat(0.0); }
static inline mask every_lane(void) { return ~no_lanes(); }
static inline int any_lane(mask where) {
  long long any = 0;
  for (int l = 0; l < L; l++) any |= where[l];
  return any != 0;
}
static inline int all_lanes(mask where) { return !any_lane(~where); }
/* The nearest whole number, for |a| < 2^51. */
static inline vec v_round(vec a) { return (a + 6755399441055744.0) - 6755399441055744.0; }

#endif
