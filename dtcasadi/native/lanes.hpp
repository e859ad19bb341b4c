/* A number of robots in one: `dtc_lanes` holds DTC_LANES doubles and takes the place of casadi_real,
   so that the C code of one robot computes as many at a time. C++17 with GCC's vector extensions
   (gcc, clang). Comparisons give 0 or 1 in each lane; there is no conversion to bool, so that code
   which branches on a number does not compile.

   sin and cos are at most 1 unit in the last place off up to 1e6 (absolute error 1e-25 where they
   are nearly zero), 1e-15 off up to 1e9, and not a number beyond; without fused multiply-add the C
   library is called lane by lane, as for everything that has no vector form. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#if defined(__AVX__)
#include <immintrin.h>
#endif

#ifndef DTC_LANES
#if defined(__AVX512F__)
#define DTC_LANES 8
#elif defined(__AVX__)
#define DTC_LANES 4
#else
#define DTC_LANES 2
#endif
#endif

/* CasADi's fmin and fmax branch where they take the language for older than C99. */
#if !defined(__STDC_VERSION__)
#define __STDC_VERSION__ 199901L
#endif

#define DTC_INLINE static inline __attribute__((always_inline))
#define DTC_EACH(i) for (int i = 0; i < DTC_LANES; ++i)

namespace {

typedef double dtc_vector __attribute__((vector_size(8 * DTC_LANES)));
typedef int64_t dtc_mask __attribute__((vector_size(8 * DTC_LANES)));

struct dtc_lanes {
  dtc_vector v;
  dtc_lanes() = default;
  inline __attribute__((always_inline)) dtc_lanes(double x) : v(x - dtc_vector{}) {}
  inline __attribute__((always_inline)) explicit dtc_lanes(dtc_vector x) : v(x) {}
  inline __attribute__((always_inline)) explicit dtc_lanes(dtc_mask m)
      : v((dtc_vector)(m & (dtc_mask)(1.0 - dtc_vector{}))) {}
};

#define DTC_ARITHMETIC(op)                                                                      \
  DTC_INLINE dtc_lanes operator op(dtc_lanes a, dtc_lanes b) { return dtc_lanes(a.v op b.v); } \
  DTC_INLINE dtc_lanes &operator op##=(dtc_lanes &a, dtc_lanes b) { return a = a op b; }
DTC_ARITHMETIC(+)
DTC_ARITHMETIC(-)
DTC_ARITHMETIC(*)
DTC_ARITHMETIC(/)
DTC_INLINE dtc_lanes operator+(dtc_lanes a) { return a; }
DTC_INLINE dtc_lanes operator-(dtc_lanes a) { return dtc_lanes(-a.v); }

#define DTC_COMPARISON(op)                                         \
  DTC_INLINE dtc_lanes operator op(dtc_lanes a, dtc_lanes b) { \
    return dtc_lanes((dtc_mask)(a.v op b.v));                    \
  }
DTC_COMPARISON(<)
DTC_COMPARISON(<=)
DTC_COMPARISON(>)
DTC_COMPARISON(>=)
DTC_COMPARISON(==)
DTC_COMPARISON(!=)
DTC_INLINE dtc_lanes operator!(dtc_lanes a) { return a == 0.0; }
DTC_INLINE dtc_lanes operator&&(dtc_lanes a, dtc_lanes b) { return (a != 0.0) * (b != 0.0); }
DTC_INLINE dtc_lanes operator||(dtc_lanes a, dtc_lanes b) { return !(!a && !b); }

/* a where the condition holds, else b. */
DTC_INLINE dtc_lanes dtc_choose(dtc_lanes condition, dtc_lanes a, dtc_lanes b) {
  return dtc_lanes(condition.v != 0.0 ? a.v : b.v);
}

/* Exchange two numbers in the lanes where the condition holds. */
DTC_INLINE void dtc_swap(dtc_lanes condition, dtc_lanes *a, dtc_lanes *b) {
  const dtc_lanes was = *a;
  *a = dtc_choose(condition, *b, was);
  *b = dtc_choose(condition, was, *b);
}

/* Vector instructions that the compiler does not find behind a loop over the lanes. */
#if defined(__AVX512F__) && DTC_LANES == 8
DTC_INLINE dtc_vector dtc_root(dtc_vector x) { return _mm512_mask_sqrt_pd(x, 255, x); }
DTC_INLINE dtc_vector dtc_round(dtc_vector x) { return _mm512_mask_roundscale_pd(x, 255, x, 0); }
DTC_INLINE bool dtc_any(dtc_mask m) { return _mm512_test_epi64_mask((__m512i)m, (__m512i)m) != 0; }
#elif defined(__AVX__) && DTC_LANES == 4
DTC_INLINE dtc_vector dtc_root(dtc_vector x) { return _mm256_sqrt_pd(x); }
DTC_INLINE dtc_vector dtc_round(dtc_vector x) { return _mm256_round_pd(x, 8); }
DTC_INLINE bool dtc_any(dtc_mask m) { return _mm256_movemask_pd((__m256d)m) != 0; }
#else
DTC_INLINE dtc_vector dtc_root(dtc_vector x) {
  DTC_EACH(i) x[i] = __builtin_sqrt(x[i]);
  return x;
}
DTC_INLINE dtc_vector dtc_round(dtc_vector x) {
  DTC_EACH(i) x[i] = __builtin_rint(x[i]);
  return x;
}
DTC_INLINE bool dtc_any(dtc_mask m) {
  int64_t some = 0;
  DTC_EACH(i) some |= m[i];
  return some != 0;
}
#endif
DTC_INLINE bool dtc_any(dtc_lanes condition) { return dtc_any(condition.v != 0.0); }

DTC_INLINE dtc_lanes sqrt(dtc_lanes x) { return dtc_lanes(dtc_root(x.v)); }
DTC_INLINE dtc_lanes fabs(dtc_lanes x) { return dtc_lanes(x.v < 0.0 ? -x.v : x.v); }
/* As in C, the other argument where one is not a number. */
DTC_INLINE dtc_lanes fmin(dtc_lanes a, dtc_lanes b) {
  return dtc_lanes((a.v < b.v) | (b.v != b.v) ? a.v : b.v);
}
DTC_INLINE dtc_lanes fmax(dtc_lanes a, dtc_lanes b) {
  return dtc_lanes((a.v > b.v) | (b.v != b.v) ? a.v : b.v);
}

#define DTC_LANEWISE(f)                                      \
  static __attribute__((unused)) dtc_lanes f(dtc_lanes x) { \
    DTC_EACH(i) x.v[i] = ::f((double)x.v[i]);                  \
    return x;                                                \
  }
DTC_LANEWISE(floor)
DTC_LANEWISE(ceil)
DTC_LANEWISE(exp)
DTC_LANEWISE(expm1)
DTC_LANEWISE(log)
DTC_LANEWISE(log1p)
DTC_LANEWISE(tan)
DTC_LANEWISE(asin)
DTC_LANEWISE(acos)
DTC_LANEWISE(atan)
DTC_LANEWISE(sinh)
DTC_LANEWISE(cosh)
DTC_LANEWISE(tanh)
DTC_LANEWISE(asinh)
DTC_LANEWISE(acosh)
DTC_LANEWISE(atanh)
DTC_LANEWISE(erf)

#define DTC_LANEWISE_2(f)                                                 \
  static __attribute__((unused)) dtc_lanes f(dtc_lanes x, dtc_lanes y) { \
    DTC_EACH(i) x.v[i] = ::f((double)x.v[i], (double)y.v[i]);               \
    return x;                                                             \
  }
DTC_LANEWISE_2(pow)
DTC_LANEWISE_2(atan2)
DTC_LANEWISE_2(fmod)
DTC_LANEWISE_2(hypot)
DTC_LANEWISE_2(copysign)

#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
/* x - k p with one rounding, whatever the compiler is told about contractions. */
DTC_INLINE dtc_vector dtc_less(dtc_vector x, dtc_vector k, double p) {
#if defined(__AVX512F__) && DTC_LANES == 8
  return _mm512_fnmadd_pd(k, _mm512_set1_pd(p), x);
#elif defined(__AVX__) && DTC_LANES == 4
  return _mm256_fnmadd_pd(k, _mm256_set1_pd(p), x);
#else
  DTC_EACH(i) x[i] = __builtin_fma(-k[i], p, x[i]);
  return x;
#endif
}

/* sin(x + turns pi/2). x less the nearest multiple k of pi/2 is r + t: pi/2 in two parts, of which
   k times the first is taken off exactly. On [-pi/4, pi/4] near-minimax polynomials, errors below
   2^-57 (sin, relative) and 2^-60 (cos). For sin and cos of one x the compiler shares all but the
   choice at the end. */
template <int turns>
DTC_INLINE dtc_lanes dtc_wave(dtc_vector x) {
  x = (dtc_vector)((dtc_mask)x | ~(x * x <= 1e18));
  const dtc_vector k = dtc_round(x * 0x1.45f306dc9c883p-1);
  const dtc_vector a = dtc_less(x, k, 0x1.921fb54442d18p+0);
  const dtc_vector r = dtc_less(a, k, 0x1.1a62633145c07p-54);
  const dtc_vector t = dtc_less(a - r, k, 0x1.1a62633145c07p-54);
  const dtc_vector z = r * r;
  dtc_vector s = z * 0x1.5d931cd8bbc04p-33 - 0x1.ae5e6691c8932p-26;
  s = z * s + 0x1.71de357819827p-19;
  s = z * s - 0x1.a01a019c11fb5p-13;
  s = z * s + 0x1.111111110f87dp-7;
  s = z * s - 0x1.5555555555549p-3;
  s = r + (r * (z * s) + (t - t * (z * 0.5)));
  dtc_vector c = z * -0x1.90058a43d732bp-37 + 0x1.1eea967feba5ap-29;
  c = z * c - 0x1.27e4f908631b3p-22;
  c = z * c + 0x1.a01a019e15908p-16;
  c = z * c - 0x1.6c16c16c15fcap-10;
  c = z * c + 0x1.5555555555552p-5;
  const dtc_vector half = z * 0.5, whole = 1.0 - half;
  c = whole + (((1.0 - whole) - half) + (z * z * c - r * t));
  /* The low bits of k, which adding 1.5 2^52 brings to the end of the number. */
  const dtc_mask quarter = (dtc_mask)(k + 0x1.8p52) + turns;
  const dtc_vector value = (quarter & 1) != 0 ? c : s;
  return dtc_lanes((dtc_vector)((dtc_mask)value ^ ((quarter & 2) << 62)));
}
DTC_INLINE dtc_lanes sin(dtc_lanes x) { return dtc_wave<0>(x.v); }
DTC_INLINE dtc_lanes cos(dtc_lanes x) { return dtc_wave<1>(x.v); }
#else
DTC_LANEWISE(sin)
DTC_LANEWISE(cos)
#endif

}  // namespace
