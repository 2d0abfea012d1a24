// The five control laws, in the notation of control/.
#pragma once
#include "setup.hpp"

template <class V> struct Output { V tau[MOST_JOINTS], e_p[MOST_JOINTS], e_v[MOST_JOINTS], s, sdot, slope, drift; Mask<V> regular; };

// The parameters of the laws in the lanes of a pack.
template <class V> struct Gains { V position[MOST_JOINTS], velocity[MOST_JOINTS], plan, observer[MOST_JOINTS]; };

template <class V> ALWAYS_INLINE V dot(int n, const V *a, const V *b) {
  V sum = a[0] * b[0];
  for (int i = 1; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// The lanes in which the plan of an open path is timed, and those in which its parameter is at an end.
template <class V> ALWAYS_INLINE Mask<V> lanes_where(const Path *const *paths, V s, bool (*test)(const Path &, double)) {
  Mask<V> mask{};
  for (int lane = 0; lane < Lanes<V>::count; lane++) set_lane(mask, lane, test(*paths[lane], lane_of(s, lane)));
  return mask;
}
static bool is_at_end(const Path &path, double s) { return !path.closed && s >= path.s_end; }
static bool is_at_start(const Path &path, double s) { return !path.closed && s <= path.s0; }

// The lanes in which the plan follows σ̇ = ϑ(σ) without feedback: at the end that it goes to, and where it is held.
template <class V> ALWAYS_INLINE Mask<V> timed_lanes(const Path *const *paths, V s, const V *speed) {
  Mask<V> mask{};
  for (int lane = 0; lane < Lanes<V>::count; lane++) {
    const Path &path = *paths[lane];
    const double here = lane_of(s, lane), w = speed ? lane_of(*speed, lane) : 1.0;
    set_lane(mask, lane, (path.brakes && (here >= path.begin || (w < 0 && here <= path.begin_back))) || w == 0);
  }
  return mask;
}

// f̂(q̇): dry friction in the direction of motion, or where a joint rests in that of its desired velocity.
template <class V> static void add_compensation(const Setup &setup, const Friction<V> &law, const V *qd, const V *desired, V *tau) {
  if (setup.compensation == NO_FRICTION) return;
  for (int i = 0; i < setup.joints; i++) {
    tau[i] += law.viscous[i] * qd[i];
    if (setup.compensation == VISCOUS_FRICTION) continue;
    V forward, backward, direction = select(equal(qd[i], V{}), desired[i], qd[i]);
    friction_levels(law, i, qd[i], forward, backward);
    tau[i] += select(less(V{}, direction), forward, V{}) + select(less(direction, V{}), backward, V{});
  }
}

// Inverse dynamics with C(q,q̇)v: c(q,x) = C(q,x)x is quadratic, so C(q,q̇)v = c(q,(q̇+v)/2) − c(q,(q̇−v)/2).
template <int N, class V, class C>
static void passive_dynamics(const Arm<C> &arm, const V *qd, const V *velocity, const V *qdd, Body<V> *bodies, V *tau) {
  const int n = size<N>(arm.joints);
  V mean[MOST_JOINTS], half[MOST_JOINTS], surplus[MOST_JOINTS];
  for (int i = 0; i < n; i++) mean[i] = 0.5 * (qd[i] + velocity[i]), half[i] = 0.5 * (qd[i] - velocity[i]);
  inverse_dynamics<N, CENTRIPETAL_ONLY>(arm, half, (const V *)nullptr, bodies, surplus);
  inverse_dynamics<N, ALL_TERMS>(arm, mean, qdd, bodies, tau);
  for (int i = 0; i < n; i++) tau[i] -= surplus[i];
}

// Motion control on the timed trajectory of the plan σ̇ = ϑ(σ): eq. (16), PD+, Slotine–Li.
template <int N, class V, class C>
static void motion_law(const Setup &setup, const Arm<C> &arm, const Gains<V> &gains, const Point<V> &at, const V *qd, Body<V> *bodies, Output<V> &out) {
  const int n = size<N>(setup.joints);
  V velocity[MOST_JOINTS], acceleration[MOST_JOINTS];
  for (int i = 0; i < n; i++) {
    velocity[i] = at.dq_d[i] * at.theta;
    acceleration[i] = (at.ddq_d[i] * at.theta + at.dq_d[i] * at.dtheta) * at.theta;
  }
  out.sdot = at.theta, out.slope = at.dtheta, out.drift = V{}, out.regular = ~Mask<V>{};
  if (setup.law == COMPUTED_TORQUE) {
    for (int i = 0; i < n; i++) acceleration[i] += gains.velocity[i] * out.e_v[i] + gains.position[i] * out.e_p[i];
    return inverse_dynamics<N, ALL_TERMS>(arm, qd, acceleration, bodies, out.tau);
  }
  if (setup.law == PD_PLUS) {
    passive_dynamics<N>(arm, qd, velocity, acceleration, bodies, out.tau);
    for (int i = 0; i < n; i++) out.tau[i] += gains.velocity[i] * out.e_v[i] + gains.position[i] * out.e_p[i];
    return;
  }
  for (int i = 0; i < n; i++) {  // position gain: Λ, velocity gain: K_d
    velocity[i] += gains.position[i] * out.e_p[i], acceleration[i] += gains.position[i] * out.e_v[i];
  }
  passive_dynamics<N>(arm, qd, velocity, acceleration, bodies, out.tau);
  for (int i = 0; i < n; i++) out.tau[i] += gains.velocity[i] * (velocity[i] - qd[i]);
}

// σ̇ = ϑ − k e_pᵀq_d' of the extended motion plan, eq. (22); k is 0 where the plan of an open path is timed.
template <int N, class V>
static void extended_plan(const Setup &setup, const Path *const *paths, const Gains<V> &gains, const Point<V> &at, const V *qd, const V *speed, Output<V> &out) {
  const int n = size<N>(setup.joints);
  const V k = select(timed_lanes(paths, out.s, speed), V{}, gains.plan);
  const V free = at.theta - k * dot(n, out.e_p, at.dq_d);
  const V high = select(lanes_where(paths, out.s, is_at_end), smaller(free, V{}), free);
  out.sdot = select(lanes_where(paths, out.s, is_at_start), larger(high, V{}), high);
  const Mask<V> held = ~equal(out.sdot, free);
  const V bend = dot(n, at.dq_d, at.dq_d) + dot(n, out.e_p, at.ddq_d);
  out.slope = select(held, V{}, at.dtheta - k * bend), out.drift = select(held, V{}, k * dot(n, qd, at.dq_d));
  out.regular = equal(out.s, out.s);
}

// The nearest point of one lane by the rules of its branch policy; see control/branch.py.
static double projected(const Setup &setup, const Path &path, const double *q, double last) {
  const double found = setup.branch == NEAREST ? in_lap_of(path, nearest_point(path, q), last) : followed_point(path, q, last);
  if (setup.branch != FOLLOW || !(found == found)) return found;
  const double square = distance_at(path, found, q).square;
  if (!(square > setup.capture * setup.capture)) return found;
  const double other = nearest_point(path, q), distance = sqrt(square);
  const bool jumps = sqrt(distance_at(path, other, q).square) < 0.5 * distance;
  return jumps ? in_lap_of(path, other, found) : found;
}

// σ̄, dσ̄/dt and the task at σ̄, eqs. (29) and (39). Where σ̄ is not defined the last one is kept.
template <int N, class V>
static void project(const Setup &setup, const Path *const *paths, const V *q, const V *qd, V last, const V *speed, Point<V> &at, Output<V> &out) {
  constexpr double STEEPEST = 1e6;
  const int n = size<N>(setup.joints);
  for (int lane = 0; lane < Lanes<V>::count; lane++) {
    double own[MOST_JOINTS];
    for (int i = 0; i < n; i++) own[i] = lane_of(q[i], lane);
    const bool known = isfinite(lane_of(last, lane));
    set_lane(out.s, lane, known ? projected(setup, *paths[lane], own, lane_of(last, lane)) : NAN);
  }
  evaluate<N>(paths, out.s, speed, at);
  V away[MOST_JOINTS];
  for (int i = 0; i < n; i++) away[i] = at.q_d[i] - q[i];
  const V gradient = dot(n, at.dq_d, at.dq_d), denominator = gradient + dot(n, away, at.ddq_d);
  out.regular = less(gradient, denominator * STEEPEST);
  if (any(~out.regular)) {
    out.s = select(out.regular, out.s, last);
    evaluate<N>(paths, out.s, speed, at);
    for (int i = 0; i < n; i++) away[i] = at.q_d[i] - q[i];
  }
  const V beyond = dot(n, away, at.dq_d);  // > 0: the arm is behind the point
  const Mask<V> held = (lanes_where(paths, out.s, is_at_start) & less(V{}, beyond)) | (lanes_where(paths, out.s, is_at_end) & less(beyond, V{}));
  const Mask<V> moves = out.regular & ~held;
  out.sdot = select(moves, dot(n, at.dq_d, qd) / select(moves, denominator, number<V>(1.0)), V{});
  out.slope = out.drift = V{};
  const Mask<V> timed = timed_lanes(paths, last, speed);
  if (!any(timed)) return;
  out.s = select(timed, last, out.s), out.regular |= timed;
  evaluate<N>(paths, out.s, speed, at);
  out.sdot = select(timed, at.theta, out.sdot), out.slope = select(timed, at.dtheta, V{});
}

// Torques, rates and errors of the law of a run for the measured q, q̇ and the law's state, the path parameter `last`, at factors of the
// profile's speed or, where `speed` is null, at 1. `at` is then the task there, and `bodies` are placed at q.
template <int N, class V, class C>
static NOINLINE void control(const Setup &setup, const Arm<C> &arm, const Friction<V> &friction, const Gains<V> &gains, const Path *const *paths,
                             const V *q, const V *qd, V last, const V *speed, Point<V> &at, Body<V> *bodies, Output<V> &out) {
  const int n = size<N>(setup.joints);
  if (setup.law == PROJECTION) project<N>(setup, paths, q, qd, last, speed, at, out);
  else out.s = last, evaluate<N>(paths, last, speed, at);
  V desired[MOST_JOINTS];
  for (int i = 0; i < n; i++) {
    desired[i] = at.dq_d[i] * at.theta;
    out.e_p[i] = at.q_d[i] - q[i], out.e_v[i] = desired[i] - qd[i];
  }
  place<N>(arm, q, bodies);
  if (setup.law < EXTENDED_MOTION_PLAN) {
    motion_law<N>(setup, arm, gains, at, qd, bodies, out);
  } else {
    if (setup.law == EXTENDED_MOTION_PLAN) extended_plan<N>(setup, paths, gains, at, qd, speed, out);
    V qdd[MOST_JOINTS];
    for (int i = 0; i < n; i++)
      qdd[i] = (at.ddq_d[i] * at.theta + at.dq_d[i] * at.dtheta) * out.sdot + gains.velocity[i] * out.e_v[i] + gains.position[i] * out.e_p[i];
    inverse_dynamics<N, ALL_TERMS>(arm, qd, qdd, bodies, out.tau);
  }
  add_compensation(setup, friction, qd, desired, out.tau);
}

// φ₁(x) = (eˣ − 1)/x and φ₂(x) = (φ₁(x) − 1)/x, by their series where x is small.
template <class V> ALWAYS_INLINE void phi(V x, V &phi_1, V &phi_2) {
  const Mask<V> small = less(absolute(x), number<V>(1e-3));
  const V safe = select(small, number<V>(1.0), x);
  phi_1 = select(small, 1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0)), exponential_minus_1(safe) / safe);
  phi_2 = select(small, 0.5 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0))), (phi_1 - 1.0) / safe);
}

// The path parameter one period later, by the exponential Rosenbrock–Euler step of Controller.advance.
template <class V> static V advance_parameter(const Setup &setup, const Path *const *paths, const Output<V> &out) {
  V phi_1, phi_2;
  phi(smaller(setup.period * out.slope, number<V>(1.0)), phi_1, phi_2);
  V s = out.s + setup.period * (phi_1 * out.sdot + setup.period * phi_2 * out.drift);
  for (int lane = 0; lane < Lanes<V>::count; lane++) set_lane(s, lane, bounded(*paths[lane], lane_of(s, lane)));
  return s;
}
