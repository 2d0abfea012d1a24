// What disturbances do at a time: torques, joints that are held, torque limits, walls; see simulation/arm.
#pragma once
#include "place.hpp"
#include "plant.hpp"

// Whether a disturbance with a beginning and a duration acts at time t.
template <class V> static Mask<V> acts(const Place<V> &place, const Disturbance &one, double t) {
  V start, duration;
  load(place, one.start, 1, &start), load(place, one.duration, 1, &duration);
  const V since = t - start;
  return less_equal(V{}, since) & less(since, duration);
}
// The joints that are held at time t; return whether there are any.
template <class V> static NOINLINE bool find_held(const Setup &setup, const Place<V> &place, double t, Mask<V> *held) {
  Mask<V> some{};
  for (int i = 0; i < setup.joints; i++) held[i] = Mask<V>{};
  for (int d = 0; d < setup.disturbances; d++) {
    const Disturbance &one = setup.disturbance[d];
    if (one.kind != JAMMED_JOINT) continue;
    const Mask<V> now = acts(place, one, t);
    V joint[MOST_JOINTS];
    load(place, one.magnitude, setup.joints, joint);
    for (int i = 0; i < setup.joints; i++) held[i] |= now & less(V{}, joint[i]), some |= held[i];
  }
  return any(some);
}

// What disturbances leave of the torque limits at time t.
template <class V> static NOINLINE void weaken(const Setup &setup, const Place<V> &place, double t, V *limit) {
  for (int d = 0; d < setup.disturbances; d++) {
    const Disturbance &one = setup.disturbance[d];
    if (one.kind != TORQUE_LIMIT_DROP) continue;
    const Mask<V> now = acts(place, one, t);
    V share[MOST_JOINTS];
    load(place, one.magnitude, setup.joints, share);
    for (int i = 0; i < setup.joints; i++) limit[i] = select(now, limit[i] * share[i], limit[i]);
  }
}

// The walls that stand at time t; return whether there are any.
template <class V> static NOINLINE bool find_walls(const Setup &setup, const Place<V> &place, double t, Walls<V> &walls) {
  Mask<V> some{};
  walls.count = 0;
  for (int d = 0; d < setup.disturbances; d++) {
    const Disturbance &one = setup.disturbance[d];
    if (one.kind != WALL) continue;
    Wall<V> &wall = walls.at[walls.count++];
    wall.arm = one.arm, wall.body = one.body, wall.offset = one.offset, wall.stands = acts(place, one, t), some |= wall.stands;
    load(place, one.magnitude, 3, wall.point), load(place, one.axes, 9, wall.axes);
    load(place, one.stiffness, 1, &wall.stiffness), load(place, one.damping, 1, &wall.damping), load(place, one.roughness, 1, &wall.roughness);
  }
  return any(some);
}

// Torques of the disturbances at time t, added to `tau`.
template <int N, class V> static NOINLINE void add_disturbances(const Setup &setup, const Place<V> &place_, const V *q, double t, V *tau) {
  const int n = size<N>(setup.joints);
  for (int d = 0; d < setup.disturbances; d++) {
    const Disturbance &one = setup.disturbance[d];
    if (one.kind > FRAME_FORCE) continue;  // it adds no torque
    V magnitude[MOST_JOINTS], frequency, phase, share = number<V>(1.0);
    load(place_, one.magnitude, one.kind == FRAME_FORCE ? 3 : n, magnitude);
    if (one.kind == HARMONIC) {
      V cosine;
      load(place_, one.frequency, 1, &frequency), load(place_, one.phase, 1, &phase);
      sine_cosine(V(2 * M_PI * frequency * t + phase), share, cosine);
    } else {
      share = select(acts(place_, one, t), share, V{});
    }
    if (one.kind != FRAME_FORCE) {
      for (int i = 0; i < n; i++) tau[i] += share * magnitude[i];
      continue;
    }
    if (!any(less(V{}, share))) continue;
    Body<V> bodies[room<N>()];
    V force[3], torque[MOST_JOINTS];
    for (int k = 0; k < 3; k++) force[k] = share * magnitude[k];
    place<N>(*one.arm, q, bodies);
    point_force_torque<N>(*one.arm, bodies, one.body, one.offset, force, torque);
    for (int i = 0; i < n; i++) tau[i] += torque[i];
  }
}
