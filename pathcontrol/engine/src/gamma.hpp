// The distance of states to the curve Γ of a task, [q_d(s); w q_d'(s)ϑ(s)], sample after sample of a run.
//
// The nearest point is the best of the cells of the table whose ball, a bound on where Γ is, may hold it. Γ's distance changes
// by no more than the state moves. So the cells that were too far by a margin stay too far until the state has moved by
// that margin, and only the others are looked at from sample to sample; then all are again.
#pragma once
#include "path.hpp"

struct Gamma {
  const Path *path;
  double weight;                  // w [s]
  int brakes;                     // take ϑ with the ending of the controllers' plan
  const double *centre, *radius;  // (cells, 2 joints) and (cells,): a ball around Γ in each cell
  const int *pieces;              // (cells,): parts of a cell over which Γ turns little
};

// Distance² of a state x = [q; w q̇] to Γ at s, and the slope of half of it.
struct GammaDistance { double square, slope; };

static inline GammaDistance gamma_distance(const Gamma &gamma, double s, const double *x) {
  const Path &path = *gamma.path;
  const int n = path.joints;
  Point<double> at;
  evaluate_lane(path, s, 0, at);
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
// Distances of states, (rows, 2 joints) each [q; w q̇], to Γ, and the parameters there; NaN where a state is not finite.
static void distances_to_gamma(const Gamma &gamma, integer rows, const double *states, double *distance, double *parameter) {
  const int m = 2 * gamma.path->joints, cells = gamma.path->cells;
  Buffer<double> bounds(cells);
  Buffer<int> near(cells);
  int nearest = 0;  // how many cells are near
  double margin_left = -1.0, step = 0.0;  // how far the state may still move before all cells are looked at again
  for (integer row = 0; row < rows; row++) {
    const double *x = states + row * m;
    double moved = 0;
    bool finite = true;
    for (int k = 0; k < m; k++) finite = finite && isfinite(x[k]);
    if (!finite) { distance[row] = parameter[row] = NAN, margin_left = -1.0; continue; }
    if (row && margin_left >= 0) {
      for (int k = 0; k < m; k++) { const double y = x[k] - x[k - m]; moved += y * y; }
      moved = sqrt(moved), step = moved, margin_left -= 2 * moved;  // both the nearest and the others may change by it
    }
    Nearest best = {INFINITY, NAN};
    if (margin_left < 0) {
      double bound = INFINITY;
      for (int cell = 0; cell < cells; cell++) {
        bounds[cell] = to_ball(gamma, cell, x);
        bound = fmin(bound, bounds[cell] + 2 * gamma.radius[cell]);
      }
      const double margin = fmax(40 * step, 0.02 * bound);
      nearest = 0;
      for (int cell = 0; cell < cells; cell++)
        if (bounds[cell] <= bound * (1 + 1e-12) + margin) near[nearest++] = cell;
      margin_left = margin;
    }
    for (int k = 0; k < nearest; k++)
      if (to_ball(gamma, near[k], x) <= sqrt(best.square)) search_cell(gamma, near[k], x, best);
    distance[row] = sqrt(best.square), parameter[row] = best.s;
  }
}
