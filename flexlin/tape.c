/* A list of scalar operations carried out for many points at once: W of them go through each operation together. */

#include <math.h>
#include <string.h>

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
long run_tape(long steps, const Step *code, long points, const double *const *in, const long *rows, double *const *out,
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
long keep_outputs(long steps, const Step *code, const int *wanted, char *live, Step *kept)
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
