/* A list of scalar operations carried out for many points at once: W of them go through each operation together. */

#include "core.h"

enum { W = 32 };

typedef struct {
    int op, to, a, b; /* b and what follows it in memory: a and b hold the eight bytes of a constant */
} Step;

#define EACH(expression) \
    for (int j = 0; j < W; j++) { \
        double x = p[j], y = q[j]; \
        (void)y; \
        r[j] = (expression); \
    } \
    break

/* code: steps; in[k]: points x rows[k]; out[k]: points x sizes[k]; work: slots x W numbers. Returns 0, or the number of a step
   whose operation is not known. */
CALLED long run_tape(long steps, const Step *code, long points, const double *const *in, const long *rows, double *const *out,
              const long *sizes, double *work)
{
    for (long first = 0; first < points; first += W) {
        const int many = points - first < W ? (int)(points - first) : W;
        for (long k = 0; k < steps; k++) {
            const Step s = code[k];
            if (s.op == 44) {
                double value;
                memcpy(&value, &code[k].a, sizeof value);
                double *r = work + (size_t)s.to * W;
                for (int j = 0; j < W; j++)
                    r[j] = value;
                continue;
            }
            if (s.op == 45) {
                const double *from = in[s.a] + first * rows[s.a] + s.b;
                double *r = work + (size_t)s.to * W;
                for (int j = 0; j < W; j++)
                    r[j] = from[(j < many ? j : 0) * rows[s.a]];
                continue;
            }
            if (s.op == 46) {
                double *to = out[s.to] + first * sizes[s.to] + s.b;
                const double *p = work + (size_t)s.a * W;
                for (int j = 0; j < many; j++)
                    to[j * sizes[s.to]] = p[j];
                continue;
            }
            const double *p = work + (size_t)s.a * W, *q = work + (size_t)s.b * W;
            double *r = work + (size_t)s.to * W;
            switch (s.op) { /* the numbers that CasADi gives its operations */
            case 0: EACH(x);
            case 1: EACH(x + y);
            case 2: EACH(x - y);
            case 3: EACH(x * y);
            case 4: EACH(x / y);
            case 5: EACH(-x);
            case 6: EACH(exp(x));
            case 7: EACH(log(x));
            case 8: EACH(pow(x, y));
            case 9: EACH(pow(x, y));
            case 10: EACH(sqrt(x));
            case 11: EACH(x * x);
            case 12: EACH(2. * x);
            case 13: EACH(sin(x));
            case 14: EACH(cos(x));
            case 15: EACH(tan(x));
            case 16: EACH(asin(x));
            case 17: EACH(acos(x));
            case 18: EACH(atan(x));
            case 19: EACH((double)(x < y));
            case 20: EACH((double)(x <= y));
            case 21: EACH((double)(x == y));
            case 22: EACH((double)(x != y));
            case 23: EACH((double)!x);
            case 24: EACH((double)(x && y));
            case 25: EACH((double)(x || y));
            case 26: EACH(floor(x));
            case 27: EACH(ceil(x));
            case 29: EACH(fabs(x));
            case 30: EACH(x < 0 ? -1. : x > 0 ? 1. : x);
            case 31: EACH(copysign(x, y));
            case 32: EACH(x ? y : 0.);
            case 34: EACH(x <= y || y != y ? x : y);
            case 35: EACH(x >= y || y != y ? x : y);
            case 36: EACH(1. / x);
            case 37: EACH(sinh(x));
            case 38: EACH(cosh(x));
            case 39: EACH(tanh(x));
            case 40: EACH(asinh(x));
            case 41: EACH(acosh(x));
            case 42: EACH(atanh(x));
            case 43: EACH(atan2(x, y));
            case 93: EACH(log1p(x));
            case 94: EACH(expm1(x));
            case 95: EACH(hypot(x, y));
            default: return k + 1;
            }
        }
    }
    return 0;
}

/* Keep the steps that lead to some outputs: kept gets these, with wanted[i] - 1 in the place of output i; live: slots zeros.
   Returns how many there are. */
CALLED long keep_outputs(long steps, const Step *code, const int *wanted, char *live, Step *kept)
{
    long left = steps;
    for (long k = steps - 1; k >= 0; k--) {
        Step s = code[k];
        if (s.op == 46) {
            if (!wanted[s.to])
                continue;
            s.to = wanted[s.to] - 1;
            live[s.a] = 1;
        } else {
            if (!live[s.to])
                continue;
            live[s.to] = 0;
            if (s.op != 44 && s.op != 45)
                live[s.a] = live[s.b] = 1;
        }
        kept[--left] = s;
    }
    memmove(kept, kept + left, (size_t)(steps - left) * sizeof *kept);
    return steps - left;
}

static int reads(int op) { return op == 44 || op == 45 ? 0 : op == 46 ? 1 : 2; }

/* Compute what is computed more than once only once: CasADi makes a new sine wherever one is written or differentiated. Values are
   numbered by their steps, then get slots anew. code: steps, changed; found: mask + 1 times -1; value: slots numbers; last: steps times
   -1; place, empty: steps numbers each. Returns how many steps are left; *slots: how many slots they need. */
CALLED long share_steps(long steps, Step *code, long mask, int *found, int *value, int *last, int *place, int *empty, int *slots)
{
    long count = 0, left = 0;
    for (long k = 0; k < steps; k++) {
        Step s = code[k];
        const int to = s.to, many = reads(s.op);
        if (many > 0)
            s.a = value[s.a];
        if (s.op == 46) {
            code[count++] = s;
            continue;
        }
        if (many == 2)
            s.b = value[s.b];
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
            found[at] = (int)count;
            code[count++] = s;
        }
        value[to] = found[at];
    }
    for (long k = 0; k < count; k++) {
        if (reads(code[k].op) > 0)
            last[code[k].a] = (int)k;
        if (reads(code[k].op) > 1)
            last[code[k].b] = (int)k;
    }
    int used = 0, top = 0;
    for (long k = 0; k < count; k++) {
        Step s = code[k];
        const int a = s.a, b = s.b, many = reads(s.op);
        if (many > 0 && last[a] == k)
            empty[top++] = place[a];
        if (many > 1 && b != a && last[b] == k)
            empty[top++] = place[b];
        if (many > 0)
            s.a = place[a];
        if (many > 1)
            s.b = place[b];
        if (s.op != 46) {
            if (last[k] < 0)
                continue;
            s.to = place[k] = top ? empty[--top] : used++;
        }
        code[left++] = s;
    }
    *slots = used;
    return left;
}
