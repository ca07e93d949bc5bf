/* What every file of the core includes: the mark of the functions that Python calls; what has no mark stays inside the library. */
#ifndef FLEXLIN_CORE_H
#define FLEXLIN_CORE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CALLED __attribute__((visibility("default")))
#define FORCED static inline __attribute__((always_inline))

#endif
