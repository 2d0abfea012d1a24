// One step of the simulated arm: the scheme that simulation/arm/plant.py and simulation/arm/damping.py explain, with their names.
#pragma once
#include "wall.hpp"

// C(q,u)u + g(q), M(q), and the levels of dry friction at u with that in the direction of u, at one place of a step.
template <int N, class V> struct Dynamics {
  V M[room<N>()][room<N>()], load[room<N>()], forward[room<N>()], backward[room<N>()], dry[room<N>()];
};

template <int N, class V, class C>
static NOINLINE void dynamics_at(const Arm<C> &arm, const Friction<V> &law, const V *q, const V *u, Dynamics<N, V> &at) {
  const int n = size<N>(arm.joints);
  Body<V> bodies[room<N>()];
  place<N>(arm, q, bodies);
  mass_matrix<N>(arm, bodies, at.M);
  inverse_dynamics<N, WITHOUT_ACCELERATION>(arm, u, (const V *)nullptr, bodies, at.load);
  for (int i = 0; i < n; i++) {
    friction_levels(law, i, u[i], at.forward[i], at.backward[i]);
    at.dry[i] = select(less(V{}, u[i]), at.forward[i], at.backward[i]);
  }
}

// A⁻¹ = L⁻ᵀD⁻¹L⁻¹ of a symmetric positive definite matrix.
template <int N, class V> static NOINLINE void invert(int joints, V (*A)[room<N>()], V (*inverse)[room<N>()]) {
  const int n = size<N>(joints);
  Factors<N, V> factors;
  V K[room<N>()][room<N>()];  // L⁻¹ below its unit diagonal
  factorise<N>(n, A, factors);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) {
      V sum = factors.L[i][j];
      for (int k = j + 1; k < i; k++) sum += factors.L[i][k] * K[k][j];
      K[i][j] = -sum;
    }
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      V sum = i == j ? factors.inverse[i] : factors.inverse[i] * K[i][j];
      for (int k = i + 1; k < n; k++) sum += factors.inverse[k] * K[k][i] * K[k][j];
      inverse[i][j] = inverse[j][i] = sum;
    }
}

// Viscous friction of a step h condensed into M̃ = M + h/2 B + BXB, and XB/h; joints that do not move each for itself.
template <int N, class V>
static NOINLINE void condense(int joints, V (*M)[room<N>()], const V *viscous, double h, const Mask<V> *moving, V (*inertia)[room<N>()], V (*travel)[room<N>()]) {
  const int n = size<N>(joints);
  V eighth[room<N>()], E[room<N>()][room<N>()], A[room<N>()][room<N>()], first[room<N>()][room<N>()], second[room<N>()][room<N>()], third[room<N>()][room<N>()];
  for (int i = 0; i < n; i++) eighth[i] = 0.125 * h * viscous[i];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      E[i][j] = i == j ? M[i][j] : select(moving[i] & moving[j], M[i][j], V{});
      A[i][j] = 3.0 * E[i][j];
      if (i == j) A[i][j] += eighth[i];
    }
  invert<N>(n, A, first);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) E[i][j] += eighth[i] * eighth[j] * first[i][j];
  invert<N>(n, E, second);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) A[i][j] = E[i][j] + eighth[i] * eighth[j] * second[i][j];
  invert<N>(n, A, third);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      const V X = first[i][j] + second[i][j] + 4.0 * third[i][j];  // X of h/8 rather than of 1
      inertia[i][j] = M[i][j] + eighth[i] * eighth[j] * X;
      if (i == j) inertia[i][j] += 4.0 * eighth[i];
      travel[i][j] = 0.125 * eighth[j] * X;
    }
}

// Stop joints of v that dry friction does not let turn since u, over a duration t with the inertia M.
template <int N, class V>
static NOINLINE void hinder(int joints, V (*M)[room<N>()], const Dynamics<N, V> &at, const V *u, double t, V *v) {
  const int n = size<N>(joints);
  Mask<V> some{}, turned[room<N>()];
  for (int i = 0; i < n; i++) {
    // a diverged arm must not be taken for one that sticks
    turned[i] = less_equal(v[i] * u[i], V{}) & less(absolute(v[i]), number<V>(INFINITY)) & less(at.backward[i], at.forward[i]);
    some |= turned[i];
  }
  if (!any(some)) return;
  V momentum[room<N>()], low[room<N>()], high[room<N>()], sign[room<N>()], stuck[room<N>()];
  for (int i = 0; i < n; i++) {
    V sum = M[i][0] * v[0];
    for (int j = 1; j < n; j++) sum += M[i][j] * v[j];
    momentum[i] = sum + t * at.dry[i];  // undo the friction that a joint at rest was given
    low[i] = t * at.backward[i], high[i] = t * at.forward[i];
    const V direction = select(less(V{}, u[i]), number<V>(1.0), select(less(u[i], V{}), number<V>(-1.0), V{}));
    sign[i] = select(turned[i], V{}, direction);
  }
  stick_slip<N>(n, M, momentum, low, high, sign, stuck);
  for (int i = 0; i < n; i++) v[i] = select(some, stuck[i], v[i]);
}

// --- joints that are held still, see simulation/arm/jam.py: null where there are none -----------------------------------
template <int N, class V> ALWAYS_INLINE void decouple(int n, const Mask<V> *held, V (*M)[room<N>()]) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      if (i != j) M[i][j] = select(held[i] | held[j], V{}, M[i][j]);
}
// Take away what moves held joints: their coupling to others, their load and their friction.
template <int N, class V> static NOINLINE void hold(int n, const Mask<V> *held, Dynamics<N, V> &at) {
  decouple<N>(n, held, at.M);
  for (int i = 0; i < n; i++) {
    at.load[i] = select(held[i], V{}, at.load[i]), at.dry[i] = select(held[i], V{}, at.dry[i]);
    at.forward[i] = select(held[i], V{}, at.forward[i]), at.backward[i] = select(held[i], V{}, at.backward[i]);
  }
}
// Stop held joints at once, which leaves (M v)_i of all others; return whether any moved.
template <int N, class V> static NOINLINE bool stop(int n, const Mask<V> *held, V (*M)[room<N>()], V *v) {
  Mask<V> moves{};
  for (int i = 0; i < n; i++) moves |= held[i] & ~equal(v[i], V{});
  if (!any(moves)) return false;
  V momentum[room<N>()], still[room<N>()];
  Factors<N, V> factors;
  for (int i = 0; i < n; i++) {
    V sum = M[i][0] * v[0];
    for (int j = 1; j < n; j++) sum += M[i][j] * v[j];
    momentum[i] = select(held[i], V{}, sum);
  }
  decouple<N>(n, held, M);
  factorise<N>(n, M, factors), solve<N>(n, factors, momentum, still);
  for (int i = 0; i < n; i++) v[i] = select(moves, still[i], v[i]);
  return true;
}

// Stop at once the approach to walls that the step h is too long for; return whether any lane did.
template <int N, class V>
static NOINLINE bool stop_at_walls(int joints, const Walls<V> &walls, const Met<N, V> &met, V (*M)[room<N>()], double h, V *v) {
  const int n = size<N>(joints);
  const Mask<V> near = find_near<N>(n, walls, met, v, v, h);
  if (!any(near)) return false;
  V momentum[room<N>()], none[room<N>()], start[room<N>()];
  for (int i = 0; i < n; i++) {
    momentum[i] = M[i][0] * v[0], none[i] = V{}, start[i] = v[i];
    for (int j = 1; j < n; j++) momentum[i] += M[i][j] * v[j];
  }
  meet_walls<N>(n, walls, met, near, true, M, momentum, none, none, start, h, h, v);
  return true;
}

// v = start + t M⁻¹(drive − dry friction − C u − g), with dry friction that holds and, where there are some, walls that a part t of
// the step h meets; M is the inertia of the step.
template <int N, class V>
static void step_velocity(int joints, V (*M)[room<N>()], const Dynamics<N, V> &at, const V *u, const V *start, const V *drive, double t, V *v, const Walls<V> *walls, const Met<N, V> &met, double h) {
  const int n = size<N>(joints);
  V force[room<N>()], acceleration[room<N>()];
  Factors<N, V> factors;
  for (int i = 0; i < n; i++) force[i] = drive[i] - at.dry[i] - at.load[i];
  factorise<N>(n, M, factors), solve<N>(n, factors, force, acceleration);
  for (int i = 0; i < n; i++) v[i] = start[i] + t * acceleration[i];
  if (!walls) return hinder<N>(n, M, at, u, t, v);
  V momentum[room<N>()], low[room<N>()], high[room<N>()];
  for (int i = 0; i < n; i++) {
    V sum = M[i][0] * v[0];
    for (int j = 1; j < n; j++) sum += M[i][j] * v[j];
    momentum[i] = sum + t * at.dry[i], low[i] = t * at.backward[i], high[i] = t * at.forward[i];
  }
  hinder<N>(n, M, at, u, t, v);
  const Mask<V> near = find_near<N>(n, *walls, met, start, v, t);
  if (any(near)) meet_walls<N>(n, *walls, met, near, false, M, momentum, low, high, start, t, h, v);
}

// (q, q̇) one step h later under the constant torque `tau`. `damped`: lanes whose viscous friction is condensed; `held`: joints.
template <int N, class V, class C>
static NOINLINE void advance_plant(const Arm<C> &arm, const Friction<V> &law, Mask<V> damped, double h, V *q, V *qd, const V *tau, const Mask<V> *held, const Walls<V> *walls) {
  const int n = size<N>(arm.joints);
  V drive[room<N>()], middle_q[room<N>()], middle_qd[room<N>()], next[room<N>()], travel[room<N>()][room<N>()];
  V inertia[room<N>()][room<N>()];
  Dynamics<N, V> at;
  dynamics_at<N>(arm, law, q, qd, at);
  if (held && stop<N>(n, held, at.M, qd)) dynamics_at<N>(arm, law, q, qd, at);
  if (held) hold<N>(n, held, at);
  Met<N, V> met;
  if (walls) {
    measure_walls<N>(n, *walls, q, held, true, met);
    if (stop_at_walls<N>(n, *walls, met, at.M, h, qd)) {
      dynamics_at<N>(arm, law, q, qd, at);
      if (held) hold<N>(n, held, at);
    }
  }
  for (int i = 0; i < n; i++) {
    drive[i] = tau[i] - law.viscous[i] * qd[i];
    if (held) drive[i] = select(held[i], V{}, drive[i]);
    at.M[i][i] += 0.5 * h * law.viscous[i];
  }
  step_velocity<N>(n, at.M, at, qd, qd, drive, 0.5 * h, middle_qd, walls, met, h);
  for (int i = 0; i < n; i++) middle_q[i] = q[i] + 0.25 * h * (qd[i] + middle_qd[i]);
  dynamics_at<N>(arm, law, middle_q, middle_qd, at);
  if (held) hold<N>(n, held, at);
  if (walls) measure_walls<N>(n, *walls, middle_q, held, false, met);
  if (any(damped)) {
    Mask<V> moving[room<N>()];
    for (int i = 0; i < n; i++) moving[i] = ~equal(qd[i], V{}) | ~equal(middle_qd[i], V{}) | less_equal(at.forward[i], at.backward[i]);
    condense<N>(n, at.M, law.viscous, h, moving, inertia, travel);
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) {
        const V plain = i == j ? V(at.M[i][i] + 0.5 * h * law.viscous[i]) : at.M[i][j];
        at.M[i][j] = select(damped, inertia[i][j], plain), travel[i][j] = select(damped, travel[i][j], V{});
      }
  } else {
    for (int i = 0; i < n; i++) at.M[i][i] += 0.5 * h * law.viscous[i];
  }
  step_velocity<N>(n, at.M, at, middle_qd, qd, drive, h, next, walls, met, h);
  for (int i = 0; i < n; i++) q[i] += 0.5 * h * (qd[i] + next[i]);
  if (any(damped)) {
    for (int i = 0; i < n; i++) {
      V surplus = travel[i][0] * (next[0] - qd[0]);
      for (int j = 1; j < n; j++) surplus += travel[i][j] * (next[j] - qd[j]);
      q[i] = select(damped, q[i] + h * surplus, q[i]);
    }
  }
  for (int i = 0; i < n; i++) qd[i] = next[i];
}
