/* Which variant of this library the processor can run: asked of the one that runs everywhere. */
#include "core.h"

/* The highest level of x86-64 that the processor has, 1 to 4; 1 on other processors.
 * Source: System V Application Binary Interface, AMD64 Architecture Processor Supplement, section 3.1.1. */
CALLED int find_level(void) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (!(__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2"))) return 1;
  if (!(__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")))
    return 3;
  return 4;
#else
  return 1;
#endif
}
