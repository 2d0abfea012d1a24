// Dry friction: its levels, and the velocity that it leaves after a time step.
#pragma once
#include "arm.hpp"

constexpr int MOST_STRIBECK = 4;

// Friction of the joints, f = b q̇ + F(q̇) with levels F± = level± + Σ_j fall_j exp(−(q̇/v_j)²); all per joint.
template <class V> struct Friction {
  V viscous[MOST_JOINTS], forward[MOST_JOINTS], backward[MOST_JOINTS];  // backward ≥ 0 holds against q̇ < 0
  int stribeck;                                                         // number of terms that fall with velocity
  V fall[MOST_STRIBECK][MOST_JOINTS], velocity[MOST_STRIBECK][MOST_JOINTS];
};

// Levels at q̇ of one joint: F⁺ and −F⁻.
template <class V> ALWAYS_INLINE void friction_levels(const Friction<V> &law, int joint, V qd, V &forward, V &backward) {
  V fall = V{};
  for (int j = 0; j < law.stribeck; j++) {
    V x = qd / law.velocity[j][joint];
    fall += law.fall[j][joint] * small_exponential(-(x * x));
  }
  forward = law.forward[joint] + fall, backward = -(law.backward[joint] + fall);
}

// v⁺ of M v⁺ + λ = p, λ_i = high_i if v⁺_i > 0, low_i if v⁺_i < 0, in [low_i, high_i] if v⁺_i = 0.
//
// The solution is unique. It is found by block principal pivoting on which joints stick, with single exchanges by Murty's
// least-index rule where blocks make no progress (Júdice and Pires, Computers & Operations Research 21, 1994), as
// simulation/arm/dry_friction.py does. `sign` is a guess of the signs of v⁺, 0 for joints that may stick, and is changed.
// Lanes in which M is not positive definite end in NaN.
template <int N, class V>
static NOINLINE void stick_slip(int joints, V (*M)[room<N>()], const V *p, const V *low, const V *high, V *sign, V *v) {
  constexpr double EPSILON = 2.220446049250313e-16, ROUNDING = 1e-12, PATIENCE = 3.0;
  constexpr int MOST_EXCHANGES = 10000;
  const int n = size<N>(joints);
  const V one = number<V>(1.0), zero = V{};
  Mask<V> smooth[room<N>()];  // joints without dry friction never stick
  V largest = zero, fewest = number<V>(n + 1.0), patience = number<V>(PATIENCE);
  for (int i = 0; i < n; i++) {
    smooth[i] = equal(low[i], zero) & equal(high[i], zero);
    sign[i] = select(smooth[i], one, sign[i]);
    largest = larger(largest, absolute(p[i]));
  }
  for (int exchange = 0; exchange < MOST_EXCHANGES; exchange++) {
    V U[room<N>()][room<N>()], b[room<N>()], slips[room<N>()], inverse[room<N>()];
    for (int i = 0; i < n; i++) {
      b[i] = p[i] - select(less(zero, sign[i]), high[i], low[i]);
      slips[i] = select(equal(sign[i], zero), zero, one);
      for (int j = 0; j < n; j++) U[i][j] = M[i][j];
    }
    for (int k = 0; k < n; k++) {
      inverse[k] = 1.0 / U[k][k];
      for (int i = k + 1; i < n; i++) {
        V share = U[k][i] * inverse[k] * slips[i] * slips[k];
        for (int j = i; j < n; j++) U[i][j] -= share * U[k][j];  // the upper triangle, which is all that is read
        b[i] -= share * b[k];
      }
    }
    for (int k = n - 1; k >= 0; k--) {
      v[k] = select(equal(sign[k], zero), zero, b[k] * inverse[k]);
      for (int i = 0; i < k; i++) b[i] -= U[i][k] * v[k];
    }
    V terms = zero, needed[room<N>()], wanted[room<N>()], count = zero;
    for (int i = 0; i < n; i++) {
      V sum = M[i][0] * v[0], magnitude = absolute(sum);
      for (int j = 1; j < n; j++) {
        V term = M[i][j] * v[j];
        sum += term, magnitude += absolute(term);
      }
      terms = larger(terms, magnitude), needed[i] = p[i] - sum;
    }
    // p − Mv may be a small difference of large terms: allow for their rounding, and not for more
    const V margin = ROUNDING * largest + 8.0 * n * EPSILON * terms;
    Mask<V> wrong[room<N>()], some = Mask<V>{};
    for (int i = 0; i < n; i++) {
      V released = select(less(high[i] + margin, needed[i]), one, zero) - select(less(needed[i], low[i] - margin), one, zero);
      V moving = select(less(v[i] * sign[i], zero), zero, sign[i]);
      wanted[i] = select(smooth[i], sign[i], select(equal(sign[i], zero), released, moving));
      wrong[i] = ~equal(wanted[i], sign[i]), some |= wrong[i];
      count += select(wrong[i], one, zero);
    }
    if (!any(some)) return;
    Mask<V> better = less(count, fewest);
    fewest = select(better, count, fewest), patience = select(better, number<V>(PATIENCE), patience - 1.0);
    Mask<V> single = less(patience, zero), later = Mask<V>{};
    for (int i = n - 1; i >= 0; i--) {
      Mask<V> exchanged = wrong[i] & (~later | ~single);
      later |= wrong[i], sign[i] = select(exchanged, wanted[i], sign[i]);
    }
  }
  for (int i = 0; i < n; i++) v[i] = number<V>(NAN);
}
