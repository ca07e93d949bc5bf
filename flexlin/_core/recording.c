/* What a recorded program goes through: each value gets one number, is laid out in a slot of memory, and is computed for many points. */

#include "core.h"
#include "program.h"

enum { CONST = 44, INPUT = 45, OUTPUT = 46 }; /* an input: argument a, place b; an output: number `to`, value a, place b */

static int reads(int op) { return op == CONST || op == INPUT ? 0 : op == OUTPUT ? 1 : 2; }

/* Number values by their steps, and compute what is computed more than once only once: CasADi makes a new sine wherever one is written or
   differentiated. code: steps with slots, changed; found: mask + 1 times -1; value: as many as slots. Returns how many steps are left. */
CALLED long number_values(long steps, Step *code, long mask, int *found, int *value) {
  long count = 0;
  for (long k = 0; k < steps; k++) {
    Step s = code[k];
    const int to = s.to, many = reads(s.op);
    if (many > 0) s.a = value[s.a];
    if (s.op == OUTPUT) {
      code[count++] = s;
      continue;
    }
    if (many == 2) s.b = value[s.b];
    if ((s.op == 1 || s.op == 3) && s.b < s.a) { /* sums and products: either order */
      const int a = s.a;
      s.a = s.b;
      s.b = a;
    }
    const unsigned long long mixed = s.op * 0x9E3779B97F4A7C15ull ^ (unsigned)s.a * 0xC2B2AE3D27D4EB4Full
                                     ^ (unsigned)s.b * 0x165667B19E3779F9ull;
    long at = (long)(mixed >> 32 & (unsigned long)mask);
    while (found[at] >= 0 && (code[found[at]].op != s.op || code[found[at]].a != s.a || code[found[at]].b != s.b))
      at = (at + 1) & mask;
    if (found[at] < 0) {
      found[at] = s.to = (int)count;
      code[count++] = s;
    }
    value[to] = found[at];
  }
  return count;
}

/* needs[k]: the kinds of all inputs that step k depends on, joined by or; kinds: one for each argument. */
CALLED void find_needs(long steps, const Step *code, const int *kinds, int *needs) {
  for (long k = 0; k < steps; k++) {
    const Step s = code[k];
    const int many = reads(s.op);
    needs[k] = s.op == INPUT ? kinds[s.a] : (many > 0 ? needs[s.a] : 0) | (many > 1 ? needs[s.b] : 0);
  }
}

/* Lay out the steps that lead to the outputs with wanted[i] > 0, which become outputs wanted[i] - 1, and to the values with live[k] > 0,
   which stay to the end. slot[k] >= 0: this value is there already. Slots from `first` on are used, and used again when nobody reads them
   any more. live: steps, changed; slot, last, empty, placed: steps each, the first two filled with -1 where nothing is known.
   Returns how many steps there are; *slots: how many slots they need. */
CALLED long lay_out(long steps, const Step *code, const int *wanted, char *live, int *slot, int first, int *last, int *empty, Step *placed,
                    int *slots) {
  for (long k = steps - 1; k >= 0; k--) {
    const Step s = code[k];
    if (s.op == OUTPUT ? wanted[s.to] <= 0 : !live[k] || slot[k] >= 0) continue;
    const int operands[2] = {s.a, s.b};
    for (int i = 0; i < reads(s.op); i++) {
      const int a = operands[i];
      if (!live[a]) live[a] = 2;
      if (last[a] < 0) last[a] = live[a] == 2 ? (int)k : -1;
    }
  }
  int used = first, top = 0;
  long left = 0;
  for (long k = 0; k < steps; k++) {
    Step s = code[k];
    const int a = s.a, b = s.b, many = reads(s.op);
    if (s.op == OUTPUT ? wanted[s.to] <= 0 : !live[k] || slot[k] >= 0) continue;
    if (many > 0 && last[a] == k && slot[a] >= first) empty[top++] = slot[a];
    if (many > 1 && b != a && last[b] == k && slot[b] >= first) empty[top++] = slot[b];
    if (many > 0) s.a = slot[a];
    if (many > 1) s.b = slot[b];
    s.to = s.op == OUTPUT ? wanted[s.to] - 1 : (slot[k] = top ? empty[--top] : used++);
    placed[left++] = s;
  }
  *slots = used;
  return left;
}

/* Carry out a program for many points. in[k]: points x rows[k]; out[k]: points x sizes[k]; work: slots x WIDE numbers. Returns 0, or the
   number of a step whose operation is not known. */
long run_program(long steps, const Step *code, long points, const double *const *in, const long *rows, double *const *out,
                 const long *sizes, double *work) {
  for (long first = 0, wide; first < points; first += wide) {
    wide = points - first > FEW ? WIDE : FEW;
    const long many = points - first < wide ? points - first : wide;
    for (long k = 0; k < steps;) {
      const Step s = code[k];
      if (s.op == INPUT) {
        const double *from = in[s.a] + first * rows[s.a] + s.b;
        double *to = work + s.to * wide;
        for (int j = 0; j < wide; j++) to[j] = from[(j < many ? j : 0) * rows[s.a]];
        k++;
      } else if (s.op == OUTPUT) {
        double *to = out[s.to] + first * sizes[s.to] + s.b;
        const double *from = work + s.a * wide;
        for (int j = 0; j < many; j++) to[j * sizes[s.to]] = from[j];
        k++;
      } else {
        long end = k + 1;
        while (end < steps && code[end].op != INPUT && code[end].op != OUTPUT) end++;
        const long unknown = run_steps((int)wide, end - k, code + k, work);
        if (unknown) return k + unknown;
        k = end;
      }
    }
  }
  return 0;
}

/* The same `times` times: input and output k stand ahead[k] and beyond[k] numbers further on each time, so that an output may be the next
   time's input. Both tables are changed. */
CALLED long march_program(long steps, const Step *code, long points, long times, long inputs, const double **in, const long *rows,
                          const long *ahead, long outputs, double **out, const long *sizes, const long *beyond, double *work) {
  for (long t = 0; t < times; t++) {
    const long unknown = run_program(steps, code, points, in, rows, out, sizes, work);
    if (unknown) return unknown;
    for (long k = 0; k < inputs; k++) in[k] += ahead[k];
    for (long k = 0; k < outputs; k++) out[k] += beyond[k];
  }
  return 0;
}
