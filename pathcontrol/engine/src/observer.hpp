// The momentum observer in the loop; see control/observer.py. Its memory is r₁, r, p and τ + c/2 of the tick before, n numbers each, and
// the time of that tick.
#pragma once
#include "law.hpp"

// What an observer sees: p = M(q)q̇, c = C(q,q̇)ᵀq̇ − g(q), and the disturbance torque behind one low pass and behind both.
template <class V> struct Observation { V momentum[MOST_JOINTS], rate[MOST_JOINTS], first[MOST_JOINTS], torque[MOST_JOINTS]; };

// The joints whose estimate stays what it was, see Controller.compensate: they rest, and are to rest.
template <class V> ALWAYS_INLINE Mask<V> is_kept(const Setup &setup, V qd, V e_v) {
  constexpr double RESTING = 1e-6;
  return setup.compensates ? equal(qd, V{}) & less(absolute(e_v), number<V>(RESTING)) : Mask<V>{};
}

template <int N, class V, class C>
static NOINLINE void observe(const Setup &setup, const Arm<C> &arm, const V *gain, double t, const V *qd, const V *memory, Body<V> *bodies,
                             const Output<V> &out, Observation<V> &seen) {
  constexpr double NEVER = -1e9;
  const int n = size<N>(setup.joints);
  const V *first = memory, *torque = memory + n, *before = memory + 2 * n, *known = memory + 3 * n, last = memory[4 * n];
  V none[MOST_JOINTS], gravity[MOST_JOINTS];
  for (int i = 0; i < n; i++) none[i] = V{};
  momentum<N>(arm, qd, bodies, seen.momentum, seen.rate);
  inverse_dynamics<N, WITHOUT_ACCELERATION>(arm, none, (const V *)nullptr, bodies, gravity);
  const V h = select(less(last, number<V>(0.5 * NEVER)), V{}, t - last);
  const Mask<V> goes_on = less(V{}, h);
  for (int i = 0; i < n; i++) {
    seen.rate[i] -= gravity[i];
    const V share = -exponential_minus_1(V(-gain[i] * h)), slope = select(goes_on, share / select(goes_on, h, number<V>(1.0)), gain[i]);
    const V passed = 1.0 - (1.0 - share) * gain[i] / slope;
    const V once = first[i] + slope * (seen.momentum[i] - before[i]) - share * (known[i] + 0.5 * seen.rate[i] + first[i]);
    const V twice = torque[i] + share * (first[i] - torque[i]) + passed * (once - first[i]);
    const Mask<V> kept = is_kept(setup, qd[i], out.e_v[i]);
    seen.first[i] = select(kept, first[i], once), seen.torque[i] = select(kept, torque[i], twice);
  }
}

// The memory at the next tick, up to which the torques `acting` act in the mean.
template <class V> static void advance_observer(int n, double t, const Observation<V> &seen, const V *acting, V *memory) {
  for (int i = 0; i < n; i++) {
    memory[i] = seen.first[i], memory[n + i] = seen.torque[i], memory[2 * n + i] = seen.momentum[i];
    memory[3 * n + i] = acting[i] + 0.5 * seen.rate[i];
  }
  memory[4 * n] = number<V>(t);
}
