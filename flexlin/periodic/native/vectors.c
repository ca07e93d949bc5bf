/* Vectors of eight numbers: eight times or segments at once. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef double v8 __attribute__((vector_size(64)));
typedef double u8 __attribute__((vector_size(64), aligned(8))); /* eight numbers of a caller's array */

static inline v8 splat(double x) { return (v8){x, x, x, x, x, x, x, x}; }
