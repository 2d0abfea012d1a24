// Laws that go along their path at a factor w of its speed, chosen by rules; see control/wrappers. A rule's state begins with the w that
// it takes: (w, ẇ) of an override, (w, ẇ, c) of a contact, c the time for which the plan is still halted, and (w) of a pace.
#pragma once
#include "observer.hpp"
#include "place.hpp"

constexpr int MOST_RULES = 8, MOST_MEMORY = 4 * MOST_JOINTS + 1 + 3 * MOST_RULES;

// A factor of the speed along the path, and its rate.
template <class V> struct Speed { V factor, rate; };

// What rules choose from: the law's output with ẇ = 0, the torque ∂τ/∂ẇ, and what the law has observed.
template <class V> struct Moment { Output<V> out; Point<V> at; V gradient[MOST_JOINTS]; Observation<V> seen; };

// The limits of each rollout at which a rule halts its plan.
template <class V> struct Thresholds { V of[MOST_RULES][MOST_JOINTS]; };

// The rates of the rules at a tick: ẇ of each, and that of an override or a contact ẅ, and of a contact ċ.
template <class V> struct RuleRates { V speed[MOST_RULES], bend[MOST_RULES], left[MOST_RULES]; };

// --- overrides and contacts -------------------------------------------------------------------------------------------
constexpr double SMOOTHING = 0.02;  // s, T: the time constant of ẇ

// ẅ of Tẅ = clip((u − w)/4T, ±a) − ẇ.
template <class V> ALWAYS_INLINE V bend_of(V u, const V *x, double most) {
  const V wanted = clamped(V((u - x[0]) / (4 * SMOOTHING)), number<V>(-most), number<V>(most));
  return (wanted - x[1]) / SMOOTHING;
}

// (w, ẇ) a period on, by the closed forms of OverrideRule.advance.
template <class V> static void advance_ramp(V *x, V bend, double most, double period) {
  constexpr double ARRIVED = 1e-9;
  const double pole = 0.5 / SMOOTHING, slow = 1 + expm1(-period / SMOOTHING), decay = 1 + expm1(-pole * period), time = fmin(period, 4 * SMOOTHING);
  const V v = x[1], wanted = v + SMOOTHING * bend, gap = 4 * SMOOTHING * wanted;
  const Mask<V> bounded = less_equal(number<V>(most * (1 - 1e-12)), absolute(wanted));
  const Mask<V> arrived = ~bounded & less(larger(absolute(gap), V(SMOOTHING * absolute(v))), number<V>(ARRIVED));
  const V ramp = wanted * time + (v - wanted) * SMOOTHING * (1 - slow), rising = wanted + (v - wanted) * slow;
  const V slope = v - pole * gap, step = decay * (slope * period - gap) + gap, falling = decay * (v - pole * period * slope);
  x[0] += select(arrived, gap, select(bounded, ramp, step));
  x[1] = select(arrived, V{}, select(bounded, rising, falling));
}

// Where the contact torque |r + b q̇| − F of a joint is beyond its threshold or, in a plan that is halted, beyond half of it.
template <class V> static Mask<V> find_contact(int n, const Friction<V> &friction, const V *qd, const V *seen, const V *threshold, Mask<V> halted) {
  V most = number<V>(-INFINITY);
  for (int i = 0; i < n; i++) {
    V forward, backward;
    friction_levels(friction, i, qd[i], forward, backward);
    most = larger(most, (absolute(seen[i] + friction.viscous[i] * qd[i]) - larger(forward, V(-backward))) / threshold[i]);
  }
  return less(select(halted, number<V>(0.5), number<V>(1.0)), most);
}

// ċ: wound up in contact within 5 ms, and else passing 0 at the rate −1.
template <class V> static V winding(Mask<V> contact, V left, double pause) {
  constexpr double ALERT = 5e-3;
  return select(contact, (pause - left) / ALERT, -smaller(number<V>(1.0), V((left + pause) / ALERT)));
}

// --- the pace ---------------------------------------------------------------------------------------------------------
constexpr double APPROACH = 0.02;  // s, time constant with which w comes to what it is to be

// The largest factor with which the rest of the path can be passed, and its slope in s; `way` is −1 for a plan that goes back.
template <class V> static Speed<V> largest_factor(const Setup &setup, const Path *fastest, const Path *const *paths, const Point<V> &at, V s, double way) {
  Speed<V> found;
  for (int lane = 0; lane < Lanes<V>::count; lane++) {
    const Path &path = *paths[lane];
    const double here = lane_of(s, lane), mirror = path.closed ? 2 * path.s0 : path.s0 + path.s_end, profile = lane_of(at.profile, lane);
    double theta, slope;
    evaluate_rate(fastest[paths[lane] - setup.paths], way > 0 ? here : mirror - here, theta, slope);
    set_lane(found.factor, lane, theta / profile);
    set_lane(found.rate, lane, (way * slope - theta / profile * lane_of(at.profile_slope, lane)) / profile);
  }
  return found;
}
// The ẇ with which w comes to the speed that is asked for, or to the largest one in its direction if that takes less.
template <class V> static V wanted_rate(const Setup &setup, const Rule &rule, const Path *const *paths, const Moment<V> &moment, const Speed<V> &asked, V w) {
  const Output<V> &out = moment.out;
  const V wanted = asked.rate + (asked.factor - w) / APPROACH;
  Speed<V> largest = largest_factor(setup, rule.fastest, paths, moment.at, out.s, 1.0);
  const V forward = smaller(wanted, V(largest.rate * larger(out.sdot, V{}) + (largest.factor - w) / APPROACH));
  const Mask<V> goes_back = less(asked.factor, V{});
  if (!rule.fastest_back || !any(goes_back)) return forward;
  largest = largest_factor(setup, rule.fastest_back, paths, moment.at, out.s, -1.0);
  return select(goes_back, larger(wanted, V(-largest.rate * smaller(out.sdot, V{}) - (largest.factor + w) / APPROACH)), forward);
}
// The least and the largest rate x for which |τ + x ∂τ/∂x| is within torque limits; joints that hardly depend on it are left out.
template <class V> static void rate_bounds(int n, const V *tau, const V *gradient, const double *torque, V &least, V &most) {
  constexpr double FLAT = 1e-9;
  V share[MOST_JOINTS], steepest = V{};
  for (int i = 0; i < n; i++) share[i] = absolute(gradient[i]) / torque[i], steepest = larger(steepest, share[i]);
  least = number<V>(-INFINITY), most = number<V>(INFINITY);
  for (int i = 0; i < n; i++) {
    const Mask<V> flat = less_equal(share[i], FLAT * steepest);
    const V slope = select(flat, number<V>(1.0), gradient[i]), one = (-torque[i] - tau[i]) / slope, other = (torque[i] - tau[i]) / slope;
    least = larger(least, select(flat, number<V>(-INFINITY), smaller(one, other)));
    most = smaller(most, select(flat, number<V>(INFINITY), larger(one, other)));
  }
}
// ẇ of a pace at w: a plan that goes back does what one that goes forward does, mirrored.
template <class V> static V pace_rate(const Setup &setup, const Rule &rule, const Path *const *paths, const Moment<V> &moment, const Speed<V> &asked, V w) {
  const V way = select(less(w, V{}), number<V>(-1.0), number<V>(1.0));
  const V wanted = way * wanted_rate(setup, rule, paths, moment, asked, w), rest = -way * w / APPROACH;
  V mirrored[MOST_JOINTS], least, most;
  for (int i = 0; i < setup.joints; i++) mirrored[i] = way * moment.gradient[i];
  rate_bounds(setup.joints, moment.out.tau, mirrored, rule.torque, least, most);
  const Mask<V> kept = less_equal(least, most), turns = less(V(way * asked.factor), V{});
  // where nothing keeps all limits, slower is better; but no pace turns round unasked, it only comes to rest
  V rate = select(kept, smaller(larger(wanted, least), most), most);
  rate = select(kept & ~turns, rate, smaller(rate, V{}));
  return way * larger(rate, select(kept, smaller(wanted, rest), rest));
}

// --- the law ----------------------------------------------------------------------------------------------------------
// The factor at which the law inside goes, 0 where it is held.
template <class V> ALWAYS_INLINE V factor_in_use(const Setup &setup, const V *memory) {
  constexpr double HELD = 1e-6;
  const V w = memory[setup.rule[setup.rules - 1].first];
  return select(less(absolute(w), number<V>(HELD)), V{}, w);
}

// The rates of all rules, with `inputs` u of the overrides for each rollout, `rollouts` apart; torque and drift get their terms of ẇ.
template <int N, class V, class C>
static NOINLINE void follow_rules(const Setup &setup, const Place<V> &place, const Arm<C> &arm, const Friction<V> &friction, const Path *const *paths,
                                  const Thresholds<V> &thresholds, const double *inputs, integer rollouts, const V *qd, V last, const V *speed,
                                  const V *memory, Body<V> *bodies, Moment<V> &moment, RuleRates<V> &rates) {
  const int n = size<N>(setup.joints);
  V full[MOST_JOINTS], none[MOST_JOINTS];
  for (int i = 0; i < n; i++) full[i] = moment.at.dq_d[i] * moment.at.full;
  momentum<N>(arm, full, bodies, moment.gradient, none);
  Speed<V> asked = {number<V>(1.0), V{}};
  for (int k = 0; k < setup.rules; k++) {
    const Rule &rule = setup.rule[k];
    const V *x = memory + rule.first;
    rates.speed[k] = rule.kind == PACE ? pace_rate(setup, rule, paths, moment, asked, x[0]) : x[1];
    if (rule.kind == SPEED_OVERRIDE) {
      V u;
      load(place, inputs + rule.input * rollouts, 1, 1, &u);
      rates.bend[k] = bend_of(V(asked.factor * u), x, rule.acceleration);
    } else if (rule.kind == CONTACT) {
      const Mask<V> halted = less(V{}, x[2]), contact = find_contact(n, friction, qd, moment.seen.torque, thresholds.of[k], halted);
      rates.left[k] = winding(contact, x[2], rule.pause);
      rates.bend[k] = bend_of(select(contact | halted, V{}, asked.factor), x, rule.acceleration);
    }
    asked = {x[0], rates.speed[k]};
  }
  for (int i = 0; i < n; i++) moment.out.tau[i] += asked.rate * moment.gradient[i];
  // ∂ṡ/∂w of a plan is ϑ, but of a projection only where it is timed
  const V response = setup.law == PROJECTION ? select(timed_lanes(paths, last, speed), moment.at.full, V{}) : moment.at.full;
  moment.out.drift += asked.rate * response;
}

// The states of all rules a period on.
template <class V> static void advance_rules(const Setup &setup, const RuleRates<V> &rates, V *memory) {
  for (int k = 0; k < setup.rules; k++) {
    const Rule &rule = setup.rule[k];
    V *x = memory + rule.first;
    if (rule.kind == PACE) x[0] += setup.period * rates.speed[k];
    else advance_ramp(x, rates.bend[k], rule.acceleration, setup.period);
    if (rule.kind == CONTACT) x[2] = clamped(V(x[2] + setup.period * rates.left[k]), number<V>(-rule.pause), number<V>(rule.pause));
  }
}

// What the law of a run says at time t for the measured q, q̇ and its state, the path parameter `last` and its memory.
template <int N, class V, class C>
static NOINLINE void decide(const Setup &setup, const Place<V> &place, const Arm<C> &arm, const Friction<V> &friction, const Gains<V> &gains,
                            const Thresholds<V> &thresholds, const Path *const *paths, double t, const double *inputs, integer rollouts,
                            const V *q, const V *qd, V last, const V *memory, Moment<V> &moment, RuleRates<V> &rates) {
  Body<V> bodies[room<N>()];
  V factor;
  const V *speed = nullptr;
  if (setup.rules) factor = factor_in_use(setup, memory), speed = &factor;
  control<N>(setup, arm, friction, gains, paths, q, qd, last, speed, moment.at, bodies, moment.out);
  if (setup.observes) observe<N>(setup, arm, gains.observer, t, qd, memory, bodies, moment.out, moment.seen);
  if (setup.compensates)
    for (int i = 0; i < setup.joints; i++) moment.out.tau[i] -= moment.seen.torque[i];
  if (setup.rules) follow_rules<N>(setup, place, arm, friction, paths, thresholds, inputs, rollouts, qd, last, speed, memory, bodies, moment, rates);
}

// The memory of a law a period after its tick at time t, with the torques that act in the parts of the period.
template <class V> static void advance_memory(const Setup &setup, double t, const Moment<V> &moment, const RuleRates<V> &rates, const V *acting, V *memory) {
  if (setup.observes) advance_observer(setup.joints, t, moment.seen, acting, memory);
  advance_rules(setup, rates, memory);
}
template <class V> static void load_thresholds(const Setup &setup, const Place<V> &place, Thresholds<V> &thresholds) {
  for (int k = 0; k < setup.rules; k++) load(place, setup.rule[k].threshold, setup.joints, thresholds.of[k]);
}
