// The distance of states to the curve Γ of a task, [q_d(s); w q_d'(s)ϑ(s)], sample after sample of a run.
//
// The global nearest point is searched for in the cells of the table whose ball, which encloses Γ, may hold it. From there
// it is followed from sample to sample by Newton's method within a *reach* of cells around it: over these the distance to the
// state is a convex function of s, so that they hold one minimum, and all others are farther than it by a gap. A distance
// changes by no more than the state moves, so both hold until the state has moved by that gap. Then the reach is laid anew
// around the point that was followed; only where that cannot be shown to be the nearest of all is it searched for again.
#pragma once
#include "path.hpp"

struct Gamma {
  const Path *path;
  double weight;                  // w [s]
  int brakes;                     // take ϑ with the ending of the controllers' plan
  const double *centre, *radius;  // (cells, 2 joints) and (cells,): a ball around Γ in each cell
  const int *pieces;              // (cells,): parts of a cell over which Γ turns little
  const double *length;           // (cells,): length of Γ in a cell
  const double *straight;         // (cells,): up to this distance from Γ, along a cell, the distance is convex
  const int *smooth;              // (cells,): 1 where Γ' is continuous at the beginning of the cell
};

// Distance² of a state x = [q; w q̇] to Γ at s, and the slope of half of it.
struct GammaDistance { double square, slope; };

static inline GammaDistance gamma_distance(const Gamma &gamma, double s, const double *x) {
  const Path &path = *gamma.path;
  const int n = path.joints;
  Point<double> at;
  evaluate_lane<0>(path, s, 0, at);
  if (gamma.brakes && path.brakes) {
    const double left = (path.s_end - s) / path.braking, share = left < 0 ? 0.0 : left > 1 ? 1.0 : left;
    at.dtheta = at.dtheta * share + at.theta * (left < 1 ? -1.0 / path.braking : 0.0), at.theta *= share;
  }
  GammaDistance d = {0, 0};
  for (int k = 0; k < n; k++) {
    const double q = at.q_d[k] - x[k], v = gamma.weight * at.dq_d[k] * at.theta - x[n + k];
    d.square += q * q + v * v;
    d.slope += q * at.dq_d[k] + v * gamma.weight * (at.ddq_d[k] * at.theta + at.dq_d[k] * at.dtheta);
  }
  return d;
}
// The root of the slope between low, where it is negative, and high: regula falsi with the Illinois rule, and halving.
static inline double gamma_root(const Gamma &gamma, const double *x, double low, double slope_low, double high, double slope_high) {
  for (int step = 0; step < 80 && high - low > 1e-14 * (1 + fabs(low)); step++) {
    double s = step % 4 == 3 ? 0.5 * (low + high) : low - slope_low * (high - low) / (slope_high - slope_low);
    if (!(s > low && s < high)) s = 0.5 * (low + high);
    if (s <= low || s >= high) break;
    const double slope = gamma_distance(gamma, s, x).slope;
    if (slope == 0) return s;
    if (slope < 0) low = s, slope_low = slope, slope_high *= 0.5;
    else high = s, slope_high = slope, slope_low *= 0.5;
  }
  return 0.5 * (low + high);
}
struct Nearest { double square, s; };

static inline double to_ball(const Gamma &gamma, int cell, const double *x) {  // a lower bound on the distance to the cell
  const int m = 2 * gamma.path->joints;
  double square = 0;
  for (int k = 0; k < m; k++) { const double y = gamma.centre[(integer)cell * m + k] - x[k]; square += y * y; }
  return sqrt(square) - gamma.radius[cell];
}
static inline void search_cell(const Gamma &gamma, int cell, const double *x, Nearest &best) {
  const double *knots = gamma.path->knots;
  const int pieces = gamma.pieces[cell];
  const double begin = knots[cell], width = (knots[cell + 1] - begin) / pieces;
  double low = begin;
  GammaDistance before = gamma_distance(gamma, low, x);
  if (before.square < best.square) best = {before.square, low};
  for (int piece = 1; piece <= pieces; piece++) {
    // the end of a cell belongs to the next one, whose slope may be another: stay a hair inside
    const double s = piece == pieces ? knots[cell + 1] - 1e-13 * (knots[cell + 1] - begin) : begin + piece * width;
    const GammaDistance here = gamma_distance(gamma, s, x);
    if (here.square < best.square) best = {here.square, s};
    if (before.slope < 0 && here.slope > 0) {
      const double root = gamma_root(gamma, x, low, before.slope, s, here.slope);
      const double square = gamma_distance(gamma, root, x).square;
      if (square < best.square) best = {square, root};
    }
    low = s, before = here;
  }
}
// The global nearest point, searched for in the cells whose balls may hold it.
static inline Nearest search_all(const Gamma &gamma, const double *x, Buffer<double> &bounds) {
  const int cells = gamma.path->cells;
  double farthest = INFINITY;
  for (int cell = 0; cell < cells; cell++) {
    bounds[cell] = to_ball(gamma, cell, x);
    farthest = fmin(farthest, bounds[cell] + 2 * gamma.radius[cell]);
  }
  Nearest best = {INFINITY, NAN};
  for (int cell = 0; cell < cells; cell++)
    if (bounds[cell] <= fmin(farthest * (1 + 1e-12), sqrt(best.square))) search_cell(gamma, cell, x, best);
  return best;
}

// The reach within which the nearest point may be followed: s from `low` to `high`, counted on over laps. Γ outside it is at least
// as far away as `others`, which is negative where there is no reach.
struct Reach {
  double low, high, others;
  bool holds(const Path &path, double s) const {  // a minimum at an end of the reach is a minimum of Γ only at an end of Γ
    return (s > low || (s == low && !path.closed && low == path.s0)) && (s < high || (s == high && !path.closed && high == path.s_end));
  }
};

// Half of the squared distance at s: twice its value, its slope and its curvature.
struct GammaShape { double square, slope, curvature; };

template <int N> static inline GammaShape gamma_shape(const Gamma &gamma, double s, const double *x) {
  const Path &path = *gamma.path;
  const int n = size<N>(path.joints), columns = n + 1;
  const double inside = path.closed ? in_first_lap(path, s) : s < path.s0 ? path.s0 : s > path.s_end ? path.s_end : s;
  const int cell = cell_of(path, inside);
  const double y = inside - path.knots[cell], *c = path.coefficients + (integer)cell * 6 * columns;
  constexpr int wide = room<N>() + 1;
  double value[wide], first[wide], second[wide], third[wide];
  for (int k = 0; k < columns; k++) {
    const double c5 = c[k], c4 = c[columns + k], c3 = c[2 * columns + k], c2 = c[3 * columns + k], c1 = c[4 * columns + k];
    value[k] = ((((c5 * y + c4) * y + c3) * y + c2) * y + c1) * y + c[5 * columns + k];
    first[k] = (((5 * c5 * y + 4 * c4) * y + 3 * c3) * y + 2 * c2) * y + c1;
    second[k] = ((20 * c5 * y + 12 * c4) * y + 6 * c3) * y + 2 * c2;
    third[k] = (60 * c5 * y + 24 * c4) * y + 6 * c3;
  }
  double theta = value[n], dtheta = first[n], ddtheta = second[n];
  if (gamma.brakes && path.brakes) {
    const double left = (path.s_end - inside) / path.braking, share = left < 0 ? 0.0 : left > 1 ? 1.0 : left;
    const double slope = left < 1 ? -1.0 / path.braking : 0.0;
    ddtheta = ddtheta * share + 2 * dtheta * slope, dtheta = dtheta * share + theta * slope, theta *= share;
  }
  GammaShape d = {0, 0, 0};
  for (int k = 0; k < n; k++) {
    const double v1 = gamma.weight * (second[k] * theta + first[k] * dtheta);
    const double v2 = gamma.weight * (third[k] * theta + 2 * second[k] * dtheta + first[k] * ddtheta);
    const double q = value[k] - x[k], v = gamma.weight * first[k] * theta - x[n + k];
    d.square += q * q + v * v;
    d.slope += q * first[k] + v * v1;
    d.curvature += first[k] * first[k] + v1 * v1 + q * second[k] + v * v2;
  }
  return d;
}
// Cells around `best` over which the distance is convex, valid until the state has moved by the gap to all other cells.
static inline Reach reach_around(const Gamma &gamma, const double *x, const Nearest &best, Buffer<double> &bounds) {
  const Path &path = *gamma.path;
  const int cells = path.cells, here = cell_of(path, path.closed ? in_first_lap(path, best.s) : best.s);
  const double away = sqrt(best.square);
  int before = 0, after = 0;  // number of cells on either side
  double behind = gamma.length[here], ahead = gamma.length[here], straight = gamma.straight[here];
  // a point of the reach is no farther from a state than that may be when it leaves the reach, plus the way along the reach
  if (!(away + 3 * gamma.length[here] < straight)) return {0, 0, -1};
  auto grows = [&](int cell, int knot) {
    if ((!path.closed && (cell < 0 || cell >= cells)) || before + after + 2 > cells) return false;
    const int there = (cell + cells) % cells;
    if (!gamma.smooth[(knot + cells) % cells]) return false;
    const double least = fmin(straight, gamma.straight[there]);
    if (!(away + fmin(behind, ahead) + behind + ahead + 2 * gamma.length[there] < least)) return false;
    straight = least;
    return true;
  };
  bool left = true, right = true;
  while (left || right) {
    if (left && (left = grows(here - before - 1, here - before))) before++, behind += gamma.length[(here - before + cells) % cells];
    if (right && (right = grows(here + after + 1, here + after + 1))) after++, ahead += gamma.length[(here + after) % cells];
  }
  double others = INFINITY;
  for (int k = after + 1; k < cells - before; k++) others = fmin(others, bounds[(here + k + cells) % cells]);
  const double lap = path.closed ? path.period * floor((best.s - path.s0) / path.period) : 0.0;
  auto knot = [&](int k) {  // in the lap of the point, or the one beside it
    const int turns = k < 0 ? -1 : k > cells ? 1 : 0;
    return path.knots[k - turns * cells] + (turns ? turns * path.period : 0.0) + lap;
  };
  return {knot(here - before), knot(here + after + 1), away < others ? others : -1};
}
// The minimum in a reach by Newton's method from a guess; NaN where the method does not converge.
template <int N> static inline Nearest follow(const Gamma &gamma, const double *x, const Reach &reach, double guess) {
  double s = guess < reach.low ? reach.low : guess > reach.high ? reach.high : guess;
  for (int step = 0; step < 8; step++) {
    const GammaShape d = gamma_shape<N>(gamma, s, x);
    if (!(d.curvature > 0)) return {INFINITY, NAN};
    double next = s - d.slope / d.curvature;
    next = next < reach.low ? reach.low : next > reach.high ? reach.high : next;
    const double change = next - s, scale = 1e-14 * (1 + fabs(s));
    // Newton's method converges quadratically: the error after a step is about the square of the step
    if (change * change * d.curvature <= 1e-16 * d.square || fabs(change) <= scale)
      return {fmax(d.square + change * (2 * d.slope + change * d.curvature), 0.0), next};
    s = next;
  }
  return {INFINITY, NAN};
}
// Distances of states, q and q̇ (rows, joints) each, to Γ, and the parameters there; NaN where squares are not finite.
constexpr double FARTHEST = 1e150;  // as in geometry/closest_point/global_search.py
template <int N>
static void distances_to_gamma(const Gamma &gamma, integer rows, const double *q, const double *qd, double *distance, double *parameter) {
  const Path &path = *gamma.path;
  const int n = size<N>(path.joints), m = 2 * n, cells = path.cells;
  double x[2 * room<N>()], last[2 * room<N>()];  // the state [q; w q̇] and the one before
  Buffer<double> bounds(cells);
  Reach reach = {0, 0, -1};
  double moved = 0, s = 0, step = 0;  // how far the state has moved in this reach, and s from sample to sample
  for (integer row = 0; row < rows; row++) {
    for (int k = 0; k < n; k++) x[k] = q[row * n + k], x[n + k] = gamma.weight * qd[row * n + k];
    bool finite = true;
    for (int k = 0; k < m; k++) finite = finite && fabs(x[k]) < FARTHEST;
    if (!finite) { distance[row] = parameter[row] = NAN, reach.others = -1; continue; }
    Nearest best = {INFINITY, NAN};
    if (reach.others > 0) {
      double square = 0;
      for (int k = 0; k < m; k++) { const double y = x[k] - last[k]; square += y * y; }
      moved += sqrt(square);
      best = follow<N>(gamma, x, reach, s + step);
    }
    const bool followed = reach.others > 0 && reach.holds(path, best.s);
    if (!followed || sqrt(best.square) + moved >= reach.others) {
      moved = 0, reach.others = -1;
      if (followed) {
        for (int cell = 0; cell < cells; cell++) bounds[cell] = to_ball(gamma, cell, x);
        reach = reach_around(gamma, x, best, bounds);
      }
      if (reach.others < 0) best = search_all(gamma, x, bounds), reach = reach_around(gamma, x, best, bounds);
    }
    for (int k = 0; k < m; k++) last[k] = x[k];
    step = followed ? best.s - s : 0.0, s = best.s;
    distance[row] = sqrt(best.square), parameter[row] = path.closed ? in_first_lap(path, s) : s;
  }
}
