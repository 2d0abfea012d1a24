// The path of a task: quintic pieces of q_d(s) and ϑ(s), and the point of it that is nearest to an arm.
#pragma once
#include "arm.hpp"

// A table that is made once of any task; see engine/path_table.py. All parameters s are those of the task.
struct Path {
  int joints, cells, buckets, closed, brakes;
  double s0, s_end, period;          // s_end is that of the first lap of a closed path
  double braking, begin;             // the ending of an open path, and that of a plan that goes back: see control/ending.py
  double braking_back, begin_back;
  double arrival;                    // the s from which on an arm has arrived
  double buckets_per_s;
  const double *knots;               // (cells + 1,)
  const int *bucket;                 // (buckets,), the cell in which each of equal parts of the domain begins
  const double *coefficients;        // (cells, 6, joints + 1): from the fifth power of s − knot down; ϑ comes last
  const double *centre, *radius;     // (cells, joints) and (cells,): a ball around the points of each cell
};

// A task at one path parameter. `profile` and its slope are ϑ and ϑ' of the task itself, `full` is ϑ where the plan goes at a factor of it
// and 0 where it is braked; they are known where evaluate() was given a factor.
template <class V> struct Point { V q_d[MOST_JOINTS], dq_d[MOST_JOINTS], ddq_d[MOST_JOINTS], theta, dtheta, profile, profile_slope, full; };

// s in the first lap of a closed path.
static inline double in_first_lap(const Path &path, double s) {
  double lap = (s - path.s0) / path.period;
  return path.s0 + (lap - floor(lap)) * path.period;
}
// The cell that holds s, which is in the domain.
static inline int cell_of(const Path &path, double s) {
  double place = (s - path.s0) * path.buckets_per_s;
  int k = place > 0 ? (place < path.buckets - 1 ? (int)place : path.buckets - 1) : 0, cell = path.bucket[k];  // NaN: 0
  while (cell + 1 < path.cells && s >= path.knots[cell + 1]) cell++;
  while (cell > 0 && s < path.knots[cell]) cell--;
  return cell;
}
// q_d, q_d', q_d'', ϑ and ϑ' of one lane at s, which open paths bound to their domain.
template <int N, class V> static inline void evaluate_lane(const Path &path, double s, int lane, Point<V> &out) {
  const int n = size<N>(path.joints), columns = n + 1;
  s = path.closed ? in_first_lap(path, s) : s < path.s0 ? path.s0 : s > path.s_end ? path.s_end : s;
  const int cell = cell_of(path, s);
  const double x = s - path.knots[cell], *c = path.coefficients + (integer)cell * 6 * columns;
  double value[room<N>() + 1], slope[room<N>() + 1], bend[room<N>() + 1];
  for (int k = 0; k < columns; k++) {
    double c5 = c[k], c4 = c[columns + k], c3 = c[2 * columns + k], c2 = c[3 * columns + k], c1 = c[4 * columns + k];
    value[k] = ((((c5 * x + c4) * x + c3) * x + c2) * x + c1) * x + c[5 * columns + k];
    slope[k] = (((5 * c5 * x + 4 * c4) * x + 3 * c3) * x + 2 * c2) * x + c1;
    bend[k] = ((20 * c5 * x + 12 * c4) * x + 6 * c3) * x + 2 * c2;
  }
  for (int k = 0; k < n; k++) set_lane(out.q_d[k], lane, value[k]), set_lane(out.dq_d[k], lane, slope[k]), set_lane(out.ddq_d[k], lane, bend[k]);
  set_lane(out.theta, lane, value[n]), set_lane(out.dtheta, lane, slope[n]);
}

// ϑ and ϑ' of one lane as laws see them that go at the factor w: on open paths the plan comes to rest at the end that it goes to.
template <class V> static inline void brake_lane(const Path &path, double s, double w, int lane, Point<V> &out) {
  const double theta = lane_of(out.theta, lane), slope = lane_of(out.dtheta, lane);
  const double left = (path.s_end - s) / path.braking, back = (s - path.s0) / path.braking_back;
  const double least = back > 0 ? -back : 0.0, most = left > 0 ? left : 0.0;
  double share = w < least ? least : w;
  share = share > most ? most : share;
  const double bend = left < w ? -1.0 / path.braking : -back > w ? -1.0 / path.braking_back : 0.0;
  set_lane(out.theta, lane, theta * share), set_lane(out.dtheta, lane, slope * share + theta * bend);
  if (left < w || -back > w) set_lane(out.full, lane, 0.0);
}

// The task at s as laws see it, at factors of its speed or, where `speed` is null, at 1.
template <int N, class V> static NOINLINE void evaluate(const Path *const *paths, V s, const V *speed, Point<V> &out) {
  for (int lane = 0; lane < Lanes<V>::count; lane++) evaluate_lane<N>(*paths[lane], lane_of(s, lane), lane, out);
  if (speed) out.profile = out.full = out.theta, out.profile_slope = out.dtheta;
  for (int lane = 0; lane < Lanes<V>::count; lane++) {
    const double w = speed ? lane_of(*speed, lane) : 1.0;
    if (paths[lane]->brakes) brake_lane(*paths[lane], lane_of(s, lane), w, lane, out);
    else if (speed) set_lane(out.theta, lane, w * lane_of(out.theta, lane)), set_lane(out.dtheta, lane, w * lane_of(out.dtheta, lane));
  }
}

// ϑ of one lane at s and its slope, of the task itself.
static inline void evaluate_rate(const Path &path, double s, double &theta, double &slope) {
  const int columns = path.joints + 1;
  s = path.closed ? in_first_lap(path, s) : s < path.s0 ? path.s0 : s > path.s_end ? path.s_end : s;
  const int cell = cell_of(path, s);
  const double x = s - path.knots[cell], *c = path.coefficients + (integer)cell * 6 * columns + path.joints;
  theta = c[0], slope = 0;
  for (int power = 1; power < 6; power++) slope = slope * x + theta, theta = theta * x + c[power * columns];
}

// --- the nearest point ------------------------------------------------------------------------------------------------
// The squared distance ½‖q_d(s) − q‖² about s: its slope g = (q_d − q)ᵀq_d', g' = ‖q_d'‖² + (q_d − q)ᵀq_d'', and ‖q_d'‖², ‖q_d''‖².
struct Distance { double square, slope, curvature, gradient, bend; };

static inline Distance distance_at(const Path &path, double s, const double *q) {
  Point<double> point;
  evaluate_lane<0>(path, s, 0, point);
  Distance d = {0, 0, 0, 0, 0};
  for (int k = 0; k < path.joints; k++) {
    double away = point.q_d[k] - q[k];
    d.square += away * away, d.slope += away * point.dq_d[k], d.curvature += away * point.ddq_d[k];
    d.gradient += point.dq_d[k] * point.dq_d[k], d.bend += point.ddq_d[k] * point.ddq_d[k];
  }
  d.curvature += d.gradient;
  return d;
}
static inline double bounded(const Path &path, double s) {
  return path.closed ? s : s < path.s0 ? path.s0 : s > path.s_end ? path.s_end : s;
}
// The root of g between low, where g < 0, and high, where g > 0: Newton's method, and halving where it leaves the bracket.
static inline double root_of_slope(const Path &path, const double *q, double low, double high) {
  double s = 0.5 * (low + high);
  for (int step = 0; step < 100; step++) {
    Distance d = distance_at(path, s, q);
    (d.slope > 0 ? high : low) = s;
    double next = d.curvature > 0 ? s - d.slope / d.curvature : low - 1.0;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (fabs(next - s) <= 1e-15 * (1 + fabs(s)) || next == low || next == high) return next;
    s = next;
  }
  return s;
}
// The global nearest point in [s0, s_end]: roots of g in the cells whose ball may hold it. NaN where q is not finite.
static NOINLINE double nearest_point(const Path &path, const double *q) {
  double best = INFINITY, found = NAN;
  const int pieces = 8, n = path.joints;
  double bound = INFINITY;  // the nearest point is no farther than the middle of any ball plus its radius
  for (int cell = 0; cell < path.cells; cell++) {
    double square = 0;
    for (int k = 0; k < n; k++) { double x = path.centre[cell * n + k] - q[k]; square += x * x; }
    double farthest = sqrt(square) + path.radius[cell];
    if (farthest < bound) bound = farthest;
  }
  for (int cell = 0; cell < path.cells; cell++) {
    double square = 0;
    for (int k = 0; k < n; k++) { double x = path.centre[cell * n + k] - q[k]; square += x * x; }
    if (sqrt(square) - path.radius[cell] > bound * (1 + 1e-12)) continue;
    double low = path.knots[cell], width = (path.knots[cell + 1] - low) / pieces;
    Distance before = distance_at(path, low, q);
    for (int piece = 1; piece <= pieces; piece++) {
      double s = piece == pieces ? path.knots[cell + 1] : path.knots[cell] + piece * width;
      Distance here = distance_at(path, s, q);
      double candidates[3] = {low, s, NAN};
      if (before.slope < 0 && here.slope > 0) candidates[2] = root_of_slope(path, q, low, s);
      for (double candidate : candidates) {
        if (candidate != candidate) continue;
        double square_there = candidate == low ? before.square : candidate == s ? here.square : distance_at(path, candidate, q).square;
        if (square_there < best) best = square_there, found = candidate;
      }
      low = s, before = here;
    }
  }
  return path.closed ? in_first_lap(path, found) : found;
}
// s in the lap in which it is nearest to `near`.
static inline double in_lap_of(const Path &path, double s, double near) {
  return path.closed ? s + path.period * nearbyint((near - s) / path.period) : s;
}
// The first local minimum downhill from `near`, piece by piece, or NaN where a lap holds none.
static NOINLINE double downhill_point(const Path &path, const double *q, double near) {
  const double direction = distance_at(path, near, q).slope > 0 ? -1.0 : 1.0, length = path.s_end - path.s0;
  double s = near, gone = 0;
  while (gone < length) {
    double inside = path.closed ? in_first_lap(path, s) : s;
    int cell = cell_of(path, inside);
    double step = (path.knots[cell + 1] - path.knots[cell]) / 8, next = bounded(path, s + direction * step);
    double slope = direction * distance_at(path, next, q).slope;
    if (slope > 0) return direction > 0 ? root_of_slope(path, q, s, next) : root_of_slope(path, q, next, s);
    if (next == s) return s;  // an end of an open path
    gone += fabs(next - s), s = next;
  }
  return NAN;
}
// The local minimum downhill from `near`, the previous nearest point; the global minimum only where `near` cannot have been a
// nearest point. As PathTask.sigma_bar(q, near): see geometry/closest_point/local_search.py for the bounds on a step.
static NOINLINE double followed_point(const Path &path, const double *q, double near) {
  constexpr double TURN = 0.5, WINDOW = 0.125, CONVERGED = 1e-9;
  const double length = path.s_end - path.s0;
  near = bounded(path, near);
  double s = near;
  Distance d = distance_at(path, s, q);
  bool convex = true;
  const double reach = fmin(WINDOW * length, M_PI * sqrt(d.square / d.gradient) + CONVERGED);
  for (int step = 0; step < 12; step++) {
    convex = convex && d.curvature > 0;
    double longest = fmin(reach, TURN * sqrt(d.gradient) / fmax(sqrt(d.bend), 1e-300));
    double change = -d.slope / fmax(d.curvature, 0.1 * d.gradient);
    double next = bounded(path, s + (change > longest ? longest : change < -longest ? -longest : change));
    bool arrived = !(fabs(next - s) > 1e-14 * (1 + fabs(next)));
    s = next;
    if (arrived) break;
    d = distance_at(path, s, q);
  }
  bool held = !path.closed && ((s <= path.s0 && d.slope > 0) || (s >= path.s_end && d.slope < 0));
  bool minimum = fabs(d.slope) <= CONVERGED * sqrt(d.gradient) && d.curvature > 0;
  if ((minimum || held) && convex && fabs(s - near) <= reach) return s;
  double below = downhill_point(path, q, near);
  if (fabs(below - near) <= WINDOW * length) return below;
  Distance at_near = distance_at(path, near, q);
  bool steady = fabs(at_near.slope) <= 0.5 * sqrt(at_near.square * at_near.gradient);
  if (steady && below == below) return below;
  return in_lap_of(path, nearest_point(path, q), near);
}
