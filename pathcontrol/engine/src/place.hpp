// From arrays of rollouts to the lanes of a pack, and back.
#pragma once
#include "setup.hpp"

template <class V> struct Place { integer first, live; };  // rollouts first, first + 1, …; lanes beyond `live` repeat the first

template <class V> ALWAYS_INLINE integer rollout_of(const Place<V> &place, int lane) { return place.first + (lane < place.live ? lane : 0); }
template <class V> static void load(const Place<V> &place, const double *from, integer stride, int count, V *to) {
  for (int lane = 0; lane < Lanes<V>::count; lane++)
    for (int i = 0; i < count; i++) set_lane(to[i], lane, from[rollout_of(place, lane) * stride + i]);
}
template <class V> static void load(const Place<V> &place, const Rows &rows, int count, V *to) {
  if (rows.data) load(place, rows.data, rows.stride, count, to);
}
template <class V> static Mask<V> load_mask(const Place<V> &place, const Rows &rows) {
  V flag;
  load(place, rows, 1, &flag);
  return less(V{}, flag);
}
template <class V> ALWAYS_INLINE void store(const Place<V> &place, const V *from, int count, double *to) {
  for (int lane = 0; lane < place.live; lane++)
    for (int i = 0; i < count; i++) to[(place.first + lane) * count + i] = lane_of(from[i], lane);
}
template <class V> static void load_friction(const Place<V> &place, const FrictionRows &rows, int n, Friction<V> &law) {
  load(place, rows.viscous, n, law.viscous), load(place, rows.forward, n, law.forward), load(place, rows.backward, n, law.backward);
  law.stribeck = (int)rows.stribeck;
  for (int j = 0; j < law.stribeck; j++) load(place, rows.fall[j], n, law.fall[j]), load(place, rows.velocity[j], n, law.velocity[j]);
}
template <class V> static void load_arm(const Place<V> &place, const Arms &arms, Arm<V> &to) {
  const Arm<double> &one = arms.arms[0];
  to.joints = one.joints;
  for (int i = 0; i < one.joints; i++) to.parent[i] = one.parent[i], to.slides[i] = one.slides[i];
  for (int k = 0; k < 3; k++) to.gravity[k] = one.gravity[k];
  for (int lane = 0; lane < Lanes<V>::count; lane++) {
    const Arm<double> &arm = arms.arms[arms.index ? arms.index[rollout_of(place, lane)] : 0];
    for (int i = 0; i < one.joints; i++) {
      for (int k = 0; k < 9; k++) set_lane(to.rotation[i][k], lane, arm.rotation[i][k]);
      for (int k = 0; k < 6; k++) set_lane(to.inertia[i][k], lane, arm.inertia[i][k]);
      for (int k = 0; k < 3; k++) set_lane(to.origin[i][k], lane, arm.origin[i][k]), set_lane(to.moment[i][k], lane, arm.moment[i][k]);
      set_lane(to.mass[i], lane, arm.mass[i]), set_lane(to.armature[i], lane, arm.armature[i]);
    }
  }
}
// The arm of all lanes: the shared one itself, or a copy with one in each lane.
template <class V, class C> struct ArmOf {
  Arm<C> own;
  const Arm<C> &operator()(const Place<V> &place, const Arms &arms) { return load_arm(place, arms, own), own; }
};
template <class V> struct ArmOf<V, double> {
  Arm<double> own;
  const Arm<double> &operator()(const Place<V> &place, const Arms &arms) { return arms.arms[arms.index ? arms.index[place.first] : 0]; }
};
