// Arithmetic on numbers and on packs of numbers by the same code.
//
// Every kernel is a template over V: `double` for one rollout, or `pack` for LANES rollouts side by side in the vector
// registers of the machine (vector types of GCC and Clang). A lane of a pack goes through the same operations in the
// same order as a single number, so its result is the same to the last bit. Functions of the C library are called lane
// by lane for the same reason; compile with -ffp-contract=off and without -ffast-math.
#pragma once
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifndef LANES
#define LANES 8
#endif
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define NOINLINE __attribute__((noinline))

typedef long long integer;  // as wide as a double, as masks of vector types are
typedef double pack __attribute__((vector_size(8 * LANES)));
typedef integer pack_mask __attribute__((vector_size(8 * LANES)));

template <class V> struct Lanes;
template <> struct Lanes<double> { typedef integer Mask; static constexpr int count = 1; };
template <> struct Lanes<pack> { typedef pack_mask Mask; static constexpr int count = LANES; };
template <class V> using Mask = typename Lanes<V>::Mask;

// Comparisons give masks: all bits set where true, none where false or where a number is NaN.
ALWAYS_INLINE integer less(double a, double b) { return -(integer)(a < b); }
ALWAYS_INLINE pack_mask less(pack a, pack b) { return a < b; }
ALWAYS_INLINE integer less_equal(double a, double b) { return -(integer)(a <= b); }
ALWAYS_INLINE pack_mask less_equal(pack a, pack b) { return a <= b; }
ALWAYS_INLINE integer equal(double a, double b) { return -(integer)(a == b); }
ALWAYS_INLINE pack_mask equal(pack a, pack b) { return a == b; }
ALWAYS_INLINE double select(integer mask, double a, double b) { return mask ? a : b; }
ALWAYS_INLINE pack select(pack_mask mask, pack a, pack b) { return mask ? a : b; }
ALWAYS_INLINE bool any(integer mask) { return mask != 0; }
ALWAYS_INLINE bool any(pack_mask mask) {
  integer bits = 0;
  for (int lane = 0; lane < LANES; lane++) bits |= mask[lane];
  return bits != 0;
}

// One lane of a number or pack, as a number.
ALWAYS_INLINE double lane_of(double x, int) { return x; }
ALWAYS_INLINE double lane_of(const pack &x, int lane) { return x[lane]; }
ALWAYS_INLINE bool lane_of(integer mask, int) { return mask != 0; }
ALWAYS_INLINE bool lane_of(const pack_mask &mask, int lane) { return mask[lane] != 0; }
ALWAYS_INLINE void set_lane(double &x, int, double value) { x = value; }
ALWAYS_INLINE void set_lane(pack &x, int lane, double value) { x[lane] = value; }
ALWAYS_INLINE void set_lane(integer &mask, int, bool value) { mask = -(integer)value; }
ALWAYS_INLINE void set_lane(pack_mask &mask, int lane, bool value) { mask[lane] = -(integer)value; }

// Apply a function of the C library lane by lane.
template <class V, class F> ALWAYS_INLINE V lanewise(F f, V x) {
  for (int lane = 0; lane < Lanes<V>::count; lane++) set_lane(x, lane, f(lane_of(x, lane)));
  return x;
}
template <class V> ALWAYS_INLINE V number(double x) { return V{} + x; }  // x in all lanes
template <class V> ALWAYS_INLINE V square_root(V x) { return lanewise([](double a) { return sqrt(a); }, x); }
// The C library is called only for functions that no compiler replaces by a version of its own, as some do with exp.
template <class V> ALWAYS_INLINE V exponential_minus_1(V x) { return lanewise([](double a) { return expm1(a); }, x); }
// exp x for x ≤ 0, within 2^-53 of the number itself, not relative to it.
template <class V> ALWAYS_INLINE V small_exponential(V x) { return 1.0 + exponential_minus_1(x); }
ALWAYS_INLINE double absolute(double x) { return fabs(x); }
ALWAYS_INLINE pack absolute(pack x) { return (pack)((pack_mask)x & 0x7fffffffffffffffLL); }
template <class V> ALWAYS_INLINE V larger(V a, V b) { return select(less(a, b), b, a); }
template <class V> ALWAYS_INLINE V smaller(V a, V b) { return select(less(b, a), b, a); }
template <class V> ALWAYS_INLINE V clamped(V x, V low, V high) { return smaller(larger(x, low), high); }

// The nearest whole number, to even where two are as near, for |x| < 2^51: adding 1.5·2^52 rounds, as the default mode does.
template <class V> ALWAYS_INLINE V rounded(V x) {
  const double shift = 6755399441055744.0;
  V y = x + shift;
  return y - shift;
}
ALWAYS_INLINE integer as_integer(double x) { return (integer)x; }
ALWAYS_INLINE pack_mask as_integer(pack x) { return __builtin_convertvector(x, pack_mask); }
ALWAYS_INLINE integer bit_mask(integer x, integer bit) { return -(integer)((x & bit) != 0); }
ALWAYS_INLINE pack_mask bit_mask(pack_mask x, integer bit) { return (x & bit) != 0; }

// Uninitialised memory on the heap for numbers or packs; it spares the runtime library of C++.
template <class T> struct Buffer {
  T *const at;
  explicit Buffer(integer count) : at((T *)aligned_alloc(64, (count * (integer)sizeof(T) / 64 + 1) * 64)) { if (!at) abort(); }
  ~Buffer() { free(at); }
  Buffer(const Buffer &) = delete;
  T &operator[](integer i) { return at[i]; }
};

constexpr double FARTHEST_ANGLE = 1e6;
// sin x and cos x within 1 unit in the last place for |x| < FARTHEST_ANGLE: Taylor series on ±π/4 after an exact reduction by π/2 in
// three parts (Cody and Waite, Software Manual for the Elementary Functions, 1980).
template <class V> ALWAYS_INLINE void sine_cosine(V x, V &sine, V &cosine) {
  V k = rounded(x * 0.63661977236758134308);
  V r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) - k * 2.02226624879595063154e-21;
  V z = r * r;
  V s = r + r * z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 +
        z * (1.0 / 6227020800.0 + z * (-1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0))))))));
  V c = 1.0 - (0.5 * z - z * z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800 +
        z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0 + z * (1.0 / 20922789888000.0))))))));
  auto quarter = as_integer(k);
  auto swapped = bit_mask(quarter, 1);
  V a = select(swapped, c, s), b = select(swapped, s, c);
  sine = select(bit_mask(quarter, 2), -a, a);
  cosine = select(bit_mask(quarter + 1, 2), -b, b);
}
