// Contact of a point of the arm with walls over one step: what simulation/arm/contact.py explains, with its names. Walls are met
// rarely: the lanes of a pack that meet one are solved one by one, as numbers.
#pragma once
#include "friction.hpp"

constexpr int MOST_WALLS = 4;

// A wall as the rollouts of a pack have it; `axes`: its normal and two directions along it.
template <class V> struct Wall {
  const Arm<double> *arm;
  int body;
  const double *offset;
  Mask<V> stands;
  V point[3], axes[9], stiffness, damping, roughness;
};
template <class V> struct Walls { int count; Wall<V> at[MOST_WALLS]; };
// Gaps at the beginning of a step, and the Jacobian of the point along the axes of each wall at one place of it.
template <int N, class V> struct Met { V gap[MOST_WALLS], jacobian[MOST_WALLS][3][room<N>()]; };

template <int N, class V>
static NOINLINE void measure_walls(int joints, const Walls<V> &walls, const V *q, const Mask<V> *held, bool gaps, Met<N, V> &met) {
  const int n = size<N>(joints);
  Body<V> bodies[room<N>()];
  for (int w = 0; w < walls.count; w++) {
    const Wall<V> &wall = walls.at[w];
    place<N>(*wall.arm, q, bodies);
    for (int r = 0; r < 3; r++) {
      point_force_torque<N>(*wall.arm, bodies, wall.body, wall.offset, wall.axes + 3 * r, met.jacobian[w][r]);
      for (int i = 0; held && i < n; i++) met.jacobian[w][r][i] = select(held[i], V{}, met.jacobian[w][r][i]);
    }
    if (!gaps) continue;
    V x[3], y[3];
    for (int k = 0; k < 3; k++) x[k] = number<V>(wall.offset[k]);
    for (int i = wall.body; i >= 0; i = wall.arm->parent[i]) {
      rotate(bodies[i].R, x, y);
      for (int k = 0; k < 3; k++) x[k] = y[k] + bodies[i].p[k];
    }
    met.gap[w] = (x[0] - wall.point[0]) * wall.axes[0] + (x[1] - wall.point[1]) * wall.axes[1] + (x[2] - wall.point[2]) * wall.axes[2];
  }
}

// --- one rollout ------------------------------------------------------------------------------------------------------
template <int N> struct ContactProblem { int n; double M[room<N>()][room<N>()], p[room<N>()], low[room<N>()], high[room<N>()]; };
template <int N> struct Touch { double row[3][room<N>()], a, beta, friction, hold; };

ALWAYS_INLINE double multiply_rows(int n, const double *a, const double *b) {
  double sum = 0.0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}
template <int N> static double mobility(const ContactProblem<N> &problem, const double *row) {
  const int n = size<N>(problem.n);
  double M[room<N>()][room<N>()], x[room<N>()];
  Factors<N, double> factors;
  memcpy(M, problem.M, sizeof M);
  factorise<N>(n, M, factors), solve<N>(n, factors, row, x);
  return multiply_rows(n, row, x);
}
template <int N> ALWAYS_INLINE double push_of(int n, const Touch<N> &touch, const double *v) {
  return touch.beta - touch.a * multiply_rows(n, touch.row[0], v);
}
template <int N> ALWAYS_INLINE double slip_of(int n, const Touch<N> &touch, const double *v) {
  const double x = multiply_rows(n, touch.row[1], v), y = multiply_rows(n, touch.row[2], v);
  return sqrt(x * x + y * y);
}
// v⁺ under the walls that push, and with the weights c of friction along them.
template <int N> static void solve_weighted(const ContactProblem<N> &problem, int count, const Touch<N> *touches, const double *c, const bool *pushed, double *v) {
  const int n = size<N>(problem.n);
  double M[room<N>()][room<N>()], p[room<N>()], sign[room<N>()];
  memcpy(M, problem.M, sizeof M);
  for (int i = 0; i < n; i++) p[i] = problem.p[i];
  for (int w = 0; w < count; w++) {
    if (!pushed[w]) continue;
    for (int r = 0; r < (c[w] > 0 ? 3 : 1); r++) {
      const double *row = touches[w].row[r], weight = r ? c[w] : touches[w].a, impulse = r ? 0.0 : touches[w].beta;
      for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) M[i][j] += weight * (row[i] * row[j]);
        p[i] += impulse * row[i];
      }
    }
  }
  for (int i = 0; i < n; i++) sign[i] = (double)((p[i] > 0) - (p[i] < 0));
  stick_slip<N>(n, M, p, problem.low, problem.high, sign, v);
}
// c with c |J_t v⁺| = μλ of each wall, through c, |J_t v⁺| and λ before and now where `known`.
template <int N> static void weigh(int n, int count, const Touch<N> *touches, const double *v, bool known, double *c0, double *s0, double *p0, double *c) {
  for (int w = 0; w < count; w++) {
    const double slip = slip_of<N>(n, touches[w], v), push = push_of<N>(n, touches[w], v), friction = touches[w].friction, hold = touches[w].hold;
    const double c1 = c[w];
    double bound = friction * push;
    c[w] = slip > 0 ? bound / slip : hold;
    if (known) {
      const double change = c1 * slip - c0[w] * s0[w];
      if ((s0[w] - slip) * change > 0) {
        const double mobile = (s0[w] - slip) / change, lift = friction * (p0[w] - push) / change;
        if (lift > -1.0) bound = (bound + lift * c1 * slip) / (1.0 + lift);
        const double rest = slip + (c1 * slip - bound) * mobile;
        c[w] = rest > 0 ? bound / rest : hold;
      }
      c0[w] = c1, s0[w] = slip, p0[w] = push;
    }
    c[w] = hold < c[w] ? hold : c[w] > 0 ? c[w] : 0.0;
  }
}
template <int N>
static void iterate_contact(const ContactProblem<N> &problem, int count, const Touch<N> *touches, double *v, double *c, const bool *begin, int most, bool slips) {
  constexpr double CLOSE = 1e-11;
  const int n = size<N>(problem.n);
  bool pushed[MOST_WALLS];
  double c0[MOST_WALLS], s0[MOST_WALLS], p0[MOST_WALLS];
  for (int w = 0; w < count; w++) pushed[w] = begin[w], c0[w] = 0.0, s0[w] = slip_of<N>(n, touches[w], v), p0[w] = push_of<N>(n, touches[w], v);
  for (int k = 0; k < most; k++) {
    double last[room<N>()], change = 0.0, largest = 0.0;
    for (int i = 0; i < n; i++) last[i] = v[i];
    solve_weighted<N>(problem, count, touches, c, pushed, v);
    bool same = true;
    for (int w = 0; w < count; w++) {
      const bool now = push_of<N>(n, touches[w], v) > 0 || (pushed[w] && c[w] > 0);
      same &= now == pushed[w], pushed[w] = now;
    }
    for (int i = 0; i < n; i++) change = fmax(change, fabs(v[i] - last[i])), largest = fmax(largest, fabs(v[i]));
    if (same && (!slips || change <= CLOSE * largest)) return;
    if (slips) weigh<N>(n, count, touches, v, true, c0, s0, p0, c);
    for (int w = 0; slips && k >= most - 3 - 2 * count && w < count; w++) c[w] = p0[w] > 0 ? c0[w] : 0.0;  // at the end no wall pulls
  }
}
// v⁺ with walls, from the solution v without them.
template <int N> static NOINLINE void solve_contact(const ContactProblem<N> &problem, int count, const Touch<N> *touches, double *v) {
  constexpr int MOST = 60;
  const int n = size<N>(problem.n), few = 2 * count + 2;
  bool pushed[MOST_WALLS], some = false, grips = false, holds = true;
  double c[MOST_WALLS], stuck[room<N>()];
  for (int w = 0; w < count; w++) {
    pushed[w] = push_of<N>(n, touches[w], v) > 0, c[w] = 0.0;
    some |= pushed[w], grips |= touches[w].friction > 0 && touches[w].hold > 0;
  }
  if (!some) return;
  iterate_contact<N>(problem, count, touches, v, c, pushed, few, false);
  if (!grips) return;
  for (int w = 0; w < count; w++) pushed[w] = push_of<N>(n, touches[w], v) > 0, c[w] = touches[w].friction > 0 ? touches[w].hold : 0.0;
  for (int i = 0; i < n; i++) stuck[i] = v[i];
  iterate_contact<N>(problem, count, touches, stuck, c, pushed, few, false);
  for (int w = 0; w < count; w++) holds &= c[w] * slip_of<N>(n, touches[w], stuck) <= touches[w].friction * push_of<N>(n, touches[w], stuck);
  if (holds) {
    for (int i = 0; i < n; i++) v[i] = stuck[i];
    return;
  }
  weigh<N>(n, count, touches, v, false, nullptr, nullptr, nullptr, c);
  iterate_contact<N>(problem, count, touches, v, c, pushed, MOST, true);
}
// A wall with what holds the point on it.
template <int N, class V>
static void set_touch(const ContactProblem<N> &problem, const Wall<V> &wall, int lane, double hard, double a, double beta, double smallest, Touch<N> &touch) {
  touch.a = a, touch.beta = beta, touch.friction = lane_of(wall.roughness, lane);
  const double w = touch.friction > 0 ? mobility<N>(problem, touch.row[1]) + mobility<N>(problem, touch.row[2]) : 0.0;
  touch.hold = w >= smallest ? hard / w : 0.0;
}
// The walls of one lane: those that take away an approach `at_once`, or those in a part t of the step h; return their number.
template <int N, class V>
static int find_touches(const ContactProblem<N> &problem, const Walls<V> &walls, const Met<N, V> &met, int lane, bool at_once, const double *start, double t, double h, Touch<N> *touches) {
  constexpr double HARD = 1e6, SMALLEST = 1e-9;
  const int n = size<N>(problem.n);
  int count = 0;
  for (int k = 0; k < walls.count; k++) {
    const Wall<V> &wall = walls.at[k];
    if (!lane_of(wall.stands, lane)) continue;
    Touch<N> &touch = touches[count];
    for (int r = 0; r < 3; r++)
      for (int i = 0; i < n; i++) touch.row[r][i] = lane_of(met.jacobian[k][r][i], lane);
    const double w = mobility<N>(problem, touch.row[0]), gap = lane_of(met.gap[k], lane), ahead = gap > 0 ? gap : 0.0;
    const double stiffness = lane_of(wall.stiffness, lane), speed = multiply_rows(n, touch.row[0], start), hard = HARD / w;
    if (!(w >= SMALLEST)) continue;
    if (at_once) {
      const double goal = -2.0 * ahead / h, resolved = h * h * stiffness * w;
      if (speed >= goal) continue;
      set_touch<N>(problem, wall, lane, HARD, hard, hard * (goal + 1.0 / (1.0 + resolved * resolved) * (speed - goal)), SMALLEST, touch);
    } else {
      const bool inside = gap <= 0;
      const double eta = inside ? 1.0 - 0.5 / (1.0 + h * h * stiffness * w) : 1.0;
      const double a = 0.5 * t * (t * stiffness * eta + (inside ? lane_of(wall.damping, lane) : 0.0));
      if (a > hard)
        set_touch<N>(problem, wall, lane, HARD, hard, -hard * (2.0 * ahead / t + speed), SMALLEST, touch);
      else
        set_touch<N>(problem, wall, lane, HARD, a, -t * stiffness * gap - a * speed, SMALLEST, touch);
    }
    count++;
  }
  return count;
}

// --- the rollouts of a pack -------------------------------------------------------------------------------------------
// The lanes that are beyond a wall or will be, a time t after `start` with the velocity v at its end.
template <int N, class V>
static Mask<V> find_near(int joints, const Walls<V> &walls, const Met<N, V> &met, const V *start, const V *v, double t) {
  const int n = size<N>(joints);
  Mask<V> near{};
  for (int w = 0; w < walls.count; w++) {
    V sum = V{};
    for (int i = 0; i < n; i++) sum += met.jacobian[w][0][i] * (start[i] + v[i]);
    near |= walls.at[w].stands & (less_equal(met.gap[w], V{}) | less_equal(V(met.gap[w] + 0.5 * t * sum), V{}));
  }
  for (int i = 0; i < n; i++) near &= less(absolute(v[i]), number<V>(INFINITY));
  return near;
}
// Change v to what walls leave of it, from the momentum p without dry friction on.
template <int N, class V>
static NOINLINE void meet_walls(int joints, const Walls<V> &walls, const Met<N, V> &met, Mask<V> near, bool at_once, V (*M)[room<N>()], const V *p, const V *low, const V *high, const V *start, double t, double h, V *v) {
  const int n = size<N>(joints);
  for (int lane = 0; lane < Lanes<V>::count; lane++) {
    if (!lane_of(near, lane)) continue;
    ContactProblem<N> problem;
    Touch<N> touches[MOST_WALLS];
    double own_start[room<N>()], own_v[room<N>()];
    problem.n = n;
    for (int i = 0; i < n; i++) {
      problem.p[i] = lane_of(p[i], lane), problem.low[i] = lane_of(low[i], lane), problem.high[i] = lane_of(high[i], lane);
      own_start[i] = lane_of(start[i], lane), own_v[i] = lane_of(v[i], lane);
      for (int j = 0; j < n; j++) problem.M[i][j] = lane_of(M[i][j], lane);
    }
    const int count = find_touches<N>(problem, walls, met, lane, at_once, own_start, t, h, touches);
    solve_contact<N>(problem, count, touches, own_v);
    for (int i = 0; i < n; i++) set_lane(v[i], lane, own_v[i]);
  }
}
