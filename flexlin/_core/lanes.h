/* Vectors of L numbers, as wide as the instruction set: L times, segments or systems go through an operation together. */
#ifndef FLEXLIN_LANES_H
#define FLEXLIN_LANES_H

#include "core.h"

#ifdef __AVX512F__
enum { L = 8 };
#elif defined __AVX__
enum { L = 4 };
#else
enum { L = 2 };
#endif
typedef double vec __attribute__((vector_size(L * sizeof(double))));

static inline vec splat(double x) { return x - (vec){0}; }

/* x, or the size of y where that is larger, or no number. */
static inline vec larger(vec x, vec y) {
  for (int l = 0; l < L; l++) { double size = fabs(y[l]); x[l] = size <= x[l] ? x[l] : size; }
  return x;
}

#endif
