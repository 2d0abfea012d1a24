// The functions that Python calls.
#include "gamma.hpp"
#include "loop.hpp"

#define EXPORT extern "C" __attribute__((visibility("default")))

// Choose a kernel whose size the compiler knows, for common arms. ONE_SIZE leaves these out, to compile fast.
template <class V, class C>
static integer run_sized(const Setup &setup, const State &state, const Record &record, const double *noise, const Span &span, integer begin, integer end) {
  switch (setup.joints) {
#ifndef ONE_SIZE
    case 2: return run_packs<2, V, C>(setup, state, record, noise, span, begin, end);
    case 6: return run_packs<6, V, C>(setup, state, record, noise, span, begin, end);
    case 7: return run_packs<7, V, C>(setup, state, record, noise, span, begin, end);
#endif
    default: return run_packs<0, V, C>(setup, state, record, noise, span, begin, end);
  }
}

// Run rollouts begin … end over a span of ticks; return the number of samples recorded by the last pack.
EXPORT integer pathcontrol_run(const Setup *setup, const State *state, const Record *record, const double *noise, const Span *span, integer begin, integer end) {
  if (end - begin == 1) return run_sized<double, double>(*setup, *state, *record, noise, *span, begin, end);
  if (setup->law_arms.index || setup->plant_arms.index) return run_sized<pack, pack>(*setup, *state, *record, noise, *span, begin, end);
  return run_sized<pack, double>(*setup, *state, *record, noise, *span, begin, end);
}

// One step of the plant alone, of rollouts begin … end.
EXPORT void pathcontrol_advance(const Setup *setup, double step, double *q, double *qd, const double *tau, const double *held, integer begin, integer end) {
  if (end - begin == 1) return advance_packs<0, double, double>(*setup, step, q, qd, tau, held, begin, end);
  if (setup->plant_arms.index) return advance_packs<0, pack, pack>(*setup, step, q, qd, tau, held, begin, end);
  return advance_packs<0, pack, double>(*setup, step, q, qd, tau, held, begin, end);
}

// --- for tests and checks, one configuration after the other ----------------------------------------------------------
EXPORT void pathcontrol_inverse_dynamics(const Arm<double> *arm, integer rows, const double *q, const double *qd, const double *qdd, double *tau) {
  Body<double> bodies[MOST_JOINTS];
  for (integer r = 0; r < rows; r++) {
    const integer at = r * arm->joints;
    place<0>(*arm, q + at, bodies);
    inverse_dynamics<0, ALL_TERMS>(*arm, qd + at, qdd + at, bodies, tau + at);
  }
}
EXPORT void pathcontrol_mass_matrix(const Arm<double> *arm, integer rows, const double *q, double *M) {
  const int n = arm->joints;
  Body<double> bodies[MOST_JOINTS];
  double own[MOST_JOINTS][MOST_JOINTS];
  for (integer r = 0; r < rows; r++) {
    place<0>(*arm, q + r * n, bodies);
    mass_matrix<0>(*arm, bodies, own);
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) M[(r * n + i) * n + j] = own[i][j];
  }
}
EXPORT void pathcontrol_momentum(const Arm<double> *arm, integer rows, const double *q, const double *qd, double *p, double *gradient) {
  Body<double> bodies[MOST_JOINTS];
  for (integer r = 0; r < rows; r++) {
    const integer at = r * arm->joints;
    place<0>(*arm, q + at, bodies);
    momentum<0>(*arm, qd + at, bodies, p + at, gradient + at);
  }
}
EXPORT void pathcontrol_stick_slip(int n, integer rows, const double *M, const double *p, const double *low, const double *high, const double *guess, double *v) {
  for (integer r = 0; r < rows; r++) {
    double own[MOST_JOINTS][MOST_JOINTS], sign[MOST_JOINTS];
    for (int i = 0; i < n; i++) {
      sign[i] = guess[r * n + i];
      for (int j = 0; j < n; j++) own[i][j] = M[(r * n + i) * n + j];
    }
    stick_slip<0>(n, own, p + r * n, low + r * n, high + r * n, sign, v + r * n);
  }
}
EXPORT void pathcontrol_evaluate(const Path *path, integer rows, const double *s, double *out) {
  const int n = path->joints;
  for (integer r = 0; r < rows; r++) {
    Point<double> at;
    evaluate<0>(&path, s[r], (const double *)nullptr, at);
    double *row = out + r * (3 * n + 2);
    for (int i = 0; i < n; i++) row[i] = at.q_d[i], row[n + i] = at.dq_d[i], row[2 * n + i] = at.ddq_d[i];
    row[3 * n] = at.theta, row[3 * n + 1] = at.dtheta;
  }
}
EXPORT void pathcontrol_nearest(const Path *path, integer rows, const double *q, const double *near, double *s) {
  for (integer r = 0; r < rows; r++) s[r] = near ? followed_point(*path, q + r * path->joints, near[r]) : nearest_point(*path, q + r * path->joints);
}

// Poses (rows, frames, 4, 4) of frames on bodies, each placed by R (row by row) and p in its body, and unless `jacobians` is null their
// Jacobians (rows, frames, 6, joints). Rows with a position beyond the range of sine_cosine are left out; return how many there are.
EXPORT integer pathcontrol_frames(const Arm<double> *arm, int frames, const int *carriers, const double *placements, integer rows, const double *q, double *poses, double *jacobians) {
  const int n = arm->joints;
  Body<double> bodies[MOST_JOINTS];
  integer left = 0;
  for (integer r = 0; r < rows; r++, q += n) {
    bool near = true;
    for (int i = 0; i < n; i++) near = near && fabs(q[i]) < FARTHEST_ANGLE;
    if (near) place<0>(*arm, q, bodies);
    for (int k = 0; k < frames; k++, poses += 16, jacobians += jacobians ? 6 * n : 0) {
      if (!near) continue;
      double R[9], p[3];
      frame_kinematics(*arm, bodies, carriers[k], placements + 12 * k, R, p, jacobians);
      for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) poses[4 * i + j] = R[3 * i + j];
        poses[4 * i + 3] = p[i], poses[12 + i] = 0;
      }
      poses[15] = 1;
    }
    left += !near;
  }
  return left;
}

// Distances to Γ of several series of states, q and q̇ (series, rows, joints) each.
EXPORT void pathcontrol_gamma(const Gamma *gamma, integer series, integer rows, const double *q, const double *qd, double *distance, double *parameter) {
  const int joints = gamma->path->joints;
  const auto one = joints == 2 ? distances_to_gamma<2> : joints == 6 ? distances_to_gamma<6> : joints == 7 ? distances_to_gamma<7> : distances_to_gamma<0>;
  for (integer k = 0; k < series; k++)
    one(*gamma, rows, q + k * rows * joints, qd + k * rows * joints, distance + k * rows, parameter + k * rows);
}

// A law for one arm: `io` holds q, q̇ and s, and then gets τ. `inputs` are u of its speed inputs at time t, and up to the next tick torques
// within ± `most` act.
struct Tick { const Setup *setup; double *io, *memory; const double *inputs, *most; double t; };

// One tick of the law alone; s and its memory are then those one period on.
EXPORT void pathcontrol_control_tick(const Tick *tick) {
  const Setup *setup = tick->setup;
  double *io = tick->io;
  const int n = setup->joints;
  const Place<double> place = {0, 1};
  const Path *path = setup->paths;
  Gains<double> gains;
  Friction<double> friction;
  load(place, setup->position_gain, n, gains.position), load(place, setup->velocity_gain, n, gains.velocity), load(place, setup->plan_gain, 1, &gains.plan);
  load(place, setup->observer_gain, n, gains.observer), load_friction(place, setup->law_friction, n, friction);
  Thresholds<double> thresholds;
  load_thresholds(*setup, place, thresholds);
  Moment<double> moment;
  RuleRates<double> rates;
  decide<0>(*setup, place, setup->law_arms.arms[0], friction, gains, thresholds, &path, tick->t, tick->inputs, 1, io, io + n, io[2 * n], tick->memory, moment, rates);
  double acting[MOST_JOINTS];
  for (int i = 0; i < n; i++) acting[i] = clamped(io[2 * n + 1 + i] = moment.out.tau[i], -tick->most[i], tick->most[i]);
  io[2 * n] = advance_parameter(*setup, &path, moment.out);
  advance_memory(*setup, tick->t, moment, rates, acting, tick->memory);
}

// Sizes of the structs and constants, compared with those of Python when the library is loaded.
EXPORT integer pathcontrol_layout(int which) {
  const integer sizes[] = {sizeof(Arm<double>), sizeof(Path), sizeof(Disturbance), sizeof(Rule), sizeof(Setup), sizeof(State), sizeof(Record), sizeof(Span), sizeof(Gamma), sizeof(Tick), MOST_JOINTS, MOST_STRIBECK, LANES};
  return which >= 0 && which < (int)(sizeof(sizes) / sizeof(sizes[0])) ? sizes[which] : -1;
}
// The instruction set of this processor: 2 for AVX-512, 1 for AVX2, else 0.
EXPORT int pathcontrol_instructions() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) return 2;
  if (__builtin_cpu_supports("avx2")) return 1;
#endif
  return 0;
}
