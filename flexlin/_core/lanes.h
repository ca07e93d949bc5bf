/* Vectors of eight numbers: eight times, segments or systems go through an operation together. */
#ifndef FLEXLIN_LANES_H
#define FLEXLIN_LANES_H

#include "core.h"

typedef double v8 __attribute__((vector_size(64)));
typedef double u8 __attribute__((vector_size(64), aligned(8))); /* eight numbers of a caller's array */

static inline v8 splat(double x) { return (v8){x, x, x, x, x, x, x, x}; }

/* x, or the size of y where that is larger, or no number. */
static inline v8 larger(v8 x, v8 y) {
  for (int l = 0; l < 8; l++) { double size = fabs(y[l]); x[l] = size <= x[l] ? x[l] : size; }
  return x;
}

static inline v8 absolute(v8 x) {
  for (int l = 0; l < 8; l++) x[l] = fabs(x[l]);
  return x;
}

#endif
