/* What every file of the core includes: double precision, and the mark of the functions that Python calls; what has no mark stays inside. */
#ifndef FLEXLIN_CORE_H
#define FLEXLIN_CORE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define EPS 2.220446049250313e-16
#define TINY 2.2250738585072014e-308
#define CALLED __attribute__((visibility("default")))
#define FORCED static inline __attribute__((always_inline))

#endif
