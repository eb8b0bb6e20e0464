/* Arithmetic on LANES numbers side by side: what the functions made by lanes.py are written in.

GCC's and Clang's vector extension; on x86-64 with glibc, GCC calls the vector forms of sin and its kin. */
#include <math.h>

/* as many as a register holds: a compiler takes wider vectors apart through memory, five times slower */
#ifdef __AVX512F__
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif
typedef double V __attribute__((vector_size(LANES * sizeof(double))));

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define IN_LANES __attribute__((simd("notinbranch"))) double
IN_LANES sin(double);
IN_LANES cos(double);
IN_LANES exp(double);
IN_LANES log(double);
IN_LANES pow(double, double);
#if __GLIBC_PREREQ(2, 35)
IN_LANES tan(double);
IN_LANES asin(double);
IN_LANES acos(double);
IN_LANES atan(double);
IN_LANES sinh(double);
IN_LANES cosh(double);
IN_LANES tanh(double);
IN_LANES expm1(double);
IN_LANES log1p(double);
IN_LANES erf(double);
IN_LANES atan2(double, double);
#endif
#endif

#define EACH(l) for (int l = 0; l < LANES; l++)
#define OF_ONE(name, value)                                                                                            \
    static inline V v_##name(V x) {                                                                                    \
        V y;                                                                                                           \
        EACH(l) {                                                                                                      \
            double a = x[l];                                                                                           \
            y[l] = (value);                                                                                            \
        }                                                                                                              \
        return y;                                                                                                      \
    }
#define OF_TWO(name, value)                                                                                            \
    static inline V v_##name(V x, V z) {                                                                               \
        V y;                                                                                                           \
        EACH(l) {                                                                                                      \
            double a = x[l], b = z[l];                                                                                 \
            y[l] = (value);                                                                                            \
        }                                                                                                              \
        return y;                                                                                                      \
    }

static inline V v_same(double a) { return (V){0} + a; }

OF_ONE(sqrt, sqrt(a))
OF_ONE(sin, sin(a))
OF_ONE(cos, cos(a))
OF_ONE(tan, tan(a))
OF_ONE(asin, asin(a))
OF_ONE(acos, acos(a))
OF_ONE(atan, atan(a))
OF_ONE(sinh, sinh(a))
OF_ONE(cosh, cosh(a))
OF_ONE(tanh, tanh(a))
OF_ONE(exp, exp(a))
OF_ONE(expm1, expm1(a))
OF_ONE(log, log(a))
OF_ONE(log1p, log1p(a))
OF_ONE(erf, erf(a))
OF_ONE(fabs, fabs(a))
OF_ONE(floor, floor(a))
OF_ONE(ceil, ceil(a))
OF_ONE(sign, a < 0.0 ? -1.0 : a > 0.0 ? 1.0 : a)
OF_ONE(not, a == 0.0)
OF_TWO(pow, pow(a, b))
OF_TWO(atan2, atan2(a, b))
OF_TWO(fmod, fmod(a, b))
OF_TWO(fmin, a < b ? a : b)
OF_TWO(fmax, a > b ? a : b)
OF_TWO(copysign, copysign(a, b))
OF_TWO(lt, a < b)
OF_TWO(le, a <= b)
OF_TWO(eq, a == b)
OF_TWO(ne, a != b)
OF_TWO(and, a != 0.0 && b != 0.0)
OF_TWO(or, a != 0.0 || b != 0.0)
OF_TWO(if, a != 0.0 ? b : 0.0)
