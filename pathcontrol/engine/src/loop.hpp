// The sampled loop of simulation/sampled.py, for one rollout or a pack of them: measure, compute, hold.
#pragma once
#include "disturbances.hpp"
#include "speed.hpp"

// --- the rollouts of a pack -------------------------------------------------------------------------------------------
template <class V> struct Rollouts {
  V q[MOST_JOINTS], qd[MOST_JOINTS], q_read[MOST_JOINTS], qd_read[MOST_JOINTS], home_q[MOST_JOINTS], home_qd[MOST_JOINTS];
  V s, first_s, rest_since, lap_start, finish_time, diverged_time, reason, lost;  // lost: 1 where a rollout has diverged
};
template <class V> static void load_state(const Place<V> &place, const State &state, int n, Rollouts<V> &r) {
  const double *vectors[] = {state.q, state.qd, state.q_read, state.qd_read, state.home_q, state.home_qd};
  V *lanes[] = {r.q, r.qd, r.q_read, r.qd_read, r.home_q, r.home_qd};
  for (int k = 0; k < 6; k++) load(place, vectors[k], n, n, lanes[k]);
  const double *numbers[] = {state.s, state.first_s, state.rest_since, state.lap_start, state.finish_time, state.diverged_time, state.reason};
  V *single[] = {&r.s, &r.first_s, &r.rest_since, &r.lap_start, &r.finish_time, &r.diverged_time, &r.reason};
  for (int k = 0; k < 7; k++) load(place, numbers[k], 1, 1, single[k]);
  r.lost = select(equal(r.diverged_time, r.diverged_time), number<V>(1.0), V{});
}
template <class V> static void store_state(const Place<V> &place, const Rollouts<V> &r, int n, const State &state) {
  store(place, r.q, n, state.q), store(place, r.qd, n, state.qd), store(place, r.q_read, n, state.q_read), store(place, r.qd_read, n, state.qd_read);
  store(place, &r.s, 1, state.s), store(place, &r.rest_since, 1, state.rest_since), store(place, &r.lap_start, 1, state.lap_start);
  store(place, &r.finish_time, 1, state.finish_time), store(place, &r.diverged_time, 1, state.diverged_time), store(place, &r.reason, 1, state.reason);
}
template <class V> ALWAYS_INLINE Mask<V> lost_lanes(const Rollouts<V> &r) { return less(V{}, r.lost); }

// Mark lanes that have diverged now, at t.
template <class V> static void mark(Rollouts<V> &r, Mask<V> lanes, double t, Reason reason) {
  const Mask<V> news = lanes & ~lost_lanes(r);
  r.diverged_time = select(news, number<V>(t), r.diverged_time), r.reason = select(news, number<V>((double)reason), r.reason);
  r.lost = select(lanes, number<V>(1.0), r.lost);
}
// Put lost rollouts back to their initial states, at which their law is known to work, and hold them there.
template <class V> static void hold_lost(const Setup &setup, Rollouts<V> &r) {
  const Mask<V> lost = lost_lanes(r);
  for (int i = 0; i < setup.joints; i++) {
    r.q[i] = select(lost, r.home_q[i], r.q[i]), r.qd[i] = select(lost, r.home_qd[i], r.qd[i]);
    r.q_read[i] = select(lost, r.home_q[i], r.q_read[i]), r.qd_read[i] = select(lost, r.home_qd[i], r.qd_read[i]);
  }
  r.s = select(lost, r.first_s, r.s);
}
template <class V> static void look_at_state(const Setup &setup, Rollouts<V> &r, double t) {
  constexpr double ABSURD = 1e6;
  Mask<V> sound = ~Mask<V>{};
  for (int i = 0; i < setup.joints; i++)
    sound &= less(absolute(r.q[i]), number<V>(ABSURD)) & less(absolute(r.qd[i]), number<V>(ABSURD));
  if (any(~sound)) mark(r, ~sound, t, BEYOND_BOUNDS);
  if (any(lost_lanes(r))) hold_lost(setup, r);
}
template <class V> static void look_at_torque(const Setup &setup, Rollouts<V> &r, const V *tau, double t) {
  Mask<V> sound = ~Mask<V>{};
  for (int i = 0; i < setup.joints; i++) sound &= less(absolute(tau[i]), number<V>(INFINITY));
  if (any(~sound)) mark(r, ~sound, t, NO_NUMBERS);
}

// Record when lanes finish: at rest at the end of an open path for 50 ms, or after so many laps; see simulation/finish.py.
template <class V> static void look_at_finish(const Setup &setup, const Path *const *paths, Rollouts<V> &r, V s, double t) {
  constexpr double AT_REST = 1e-2, REST = 0.05 * (1 - 1e-9);
  if (setup.finish == NEVER) return;
  const V never = number<V>(NAN);
  V news;
  if (setup.finish == AT_END) {
    const Mask<V> arrived = lanes_where(paths, s, [](const Path &path, double x) { return x >= path.arrival; });
    if (!any(arrived)) { r.rest_since = number<V>(INFINITY); return; }
    const Mask<V> rests = arrived & less_equal(square_root(dot(setup.joints, r.qd, r.qd)), number<V>(AT_REST));
    r.rest_since = select(rests, smaller(r.rest_since, number<V>(t)), number<V>(INFINITY));
    news = select(less_equal(number<V>(REST), t - r.rest_since), r.rest_since, never);
  } else {
    r.lap_start = select(equal(r.lap_start, r.lap_start), r.lap_start, s);
    V laps = s - r.lap_start;
    for (int lane = 0; lane < Lanes<V>::count; lane++) set_lane(laps, lane, trunc(lane_of(laps, lane) / paths[lane]->period));
    news = select(less_equal(number<V>(setup.laps), laps), number<V>(t), never);
  }
  const Mask<V> open = ~equal(r.finish_time, r.finish_time) & ~lost_lanes(r);
  r.finish_time = select(open, news, r.finish_time);
}

// --- sensors and record ------------------------------------------------------------------------------------
template <class V> struct Senses { V resolution[MOST_JOINTS], limit[MOST_JOINTS]; };

// The next reading; `noise` holds this sample's noise of positions and velocities, or is null.
template <class V> static void read_sensors(const Setup &setup, const Senses<V> &senses, Rollouts<V> &r, const V *q_noise, const V *qd_noise) {
  for (int i = 0; i < setup.joints; i++) {
    V q = q_noise ? r.q[i] + q_noise[i] : r.q[i], qd = qd_noise ? r.qd[i] + qd_noise[i] : r.qd[i];
    if (setup.encoders) q = rounded(q / senses.resolution[i]) * senses.resolution[i];
    if (setup.differentiates) qd = (q - r.q_read[i]) / setup.period;
    if (setup.filters) qd = setup.keep * r.qd_read[i] + (1 - setup.keep) * qd;
    r.q_read[i] = q, r.qd_read[i] = qd;
  }
}

// Write one sample, `at` bytes from the beginning of the record, NaN for lost rollouts.
template <int N, class V>
ALWAYS_INLINE void record_vector(double *to, integer at, const Place<V> &place, int joints, const V *values, Mask<V> lost) {
  if (!to) return;
  const int n = size<N>(joints);
  double *row = (double *)((char *)to + at) + place.first * n, sound[room<N>()][Lanes<V>::count];
  for (int i = 0; i < n; i++) {
    const V value = select(lost, number<V>(NAN), values[i]);
    memcpy(sound[i], &value, sizeof value);
  }
  if (place.live == Lanes<V>::count) {  // a constant number of lanes, which compilers turn into shuffles
    for (int lane = 0; lane < Lanes<V>::count; lane++)
      for (int i = 0; i < n; i++) row[lane * n + i] = sound[i][lane];
  } else {
    for (int lane = 0; lane < place.live; lane++)
      for (int i = 0; i < n; i++) row[lane * n + i] = sound[i][lane];
  }
}
template <int N, class V>
static NOINLINE void write_sample(const Record &record, integer at, const Place<V> &place, int n, const Rollouts<V> &r, const V *q_seen, const V *qd_seen, const Output<V> &out, const V *acting) {
  const Mask<V> lost = lost_lanes(r);
  record_vector<N>(record.q, at, place, n, r.q, lost), record_vector<N>(record.qd, at, place, n, r.qd, lost);
  record_vector<N>(record.q_measured, at, place, n, q_seen, lost), record_vector<N>(record.qd_measured, at, place, n, qd_seen, lost);
  record_vector<N>(record.tau_demand, at, place, n, out.tau, lost), record_vector<N>(record.tau, at, place, n, acting, lost);
  record_vector<N>(record.e_p, at, place, n, out.e_p, lost), record_vector<N>(record.e_v, at, place, n, out.e_v, lost);
  record_vector<1>(record.s, at, place, 1, &out.s, lost), record_vector<1>(record.sdot, at, place, 1, &out.sdot, lost);
  if (record.regular)
    for (int lane = 0; lane < place.live; lane++) record.regular[at + place.first + lane] = !lane_of(lost, lane) && lane_of(out.regular, lane);
}

// --- ticks and measurements that are lost, see simulation/lossy_line.py ------------------------------------------------
// What a law saw and said last, and what is lost at this tick.
template <class V> struct Line {
  V q[MOST_JOINTS], qd[MOST_JOINTS], tau[MOST_JOINTS], e_p[MOST_JOINTS], e_v[MOST_JOINTS], s, sdot;
  Mask<V> missed, silent;
};
template <class V> static void load_line(const Place<V> &place, const State &state, int n, Line<V> &line) {
  const double *vectors[] = {state.q_seen, state.qd_seen, state.tau_said, state.e_p_said, state.e_v_said};
  V *lanes[] = {line.q, line.qd, line.tau, line.e_p, line.e_v};
  for (int k = 0; k < 5; k++) load(place, vectors[k], n, n, lanes[k]);
  load(place, state.s_said, 1, 1, &line.s), load(place, state.sdot_said, 1, 1, &line.sdot);
}
template <class V> static void store_line(const Place<V> &place, const Line<V> &line, int n, const State &state) {
  store(place, line.q, n, state.q_seen), store(place, line.qd, n, state.qd_seen), store(place, line.tau, n, state.tau_said);
  store(place, line.e_p, n, state.e_p_said), store(place, line.e_v, n, state.e_v_said);
  store(place, &line.s, 1, state.s_said), store(place, &line.sdot, 1, state.sdot_said);
}
// What the law sees at this tick: the reading, or the last one that came; lost rollouts have their initial states.
template <class V>
static NOINLINE void see(const Place<V> &place, int n, const Rollouts<V> &r, const unsigned char *missed, const unsigned char *stale, Line<V> &line) {
  Mask<V> away;
  for (int lane = 0; lane < Lanes<V>::count; lane++) {
    const integer row = rollout_of(place, lane);
    set_lane(line.missed, lane, missed[row] > 0), set_lane(line.silent, lane, missed[row] > 1), set_lane(away, lane, missed[row] || stale[row]);
  }
  away &= ~lost_lanes(r);
  for (int i = 0; i < n; i++) line.q[i] = select(away, line.q[i], r.q_read[i]), line.qd[i] = select(away, line.qd[i], r.qd_read[i]);
}
// The output in use: that of the law, or what was said last where it misses the tick; one that begins has said nothing before.
template <class V> static NOINLINE void say(int n, bool begins, Line<V> &line, Output<V> &out) {
  const Mask<V> kept = begins ? Mask<V>{} : line.missed;
  for (int i = 0; i < n; i++) {
    line.tau[i] = out.tau[i] = select(line.silent, V{}, select(line.missed, line.tau[i], out.tau[i]));
    line.e_p[i] = out.e_p[i] = select(kept, line.e_p[i], out.e_p[i]), line.e_v[i] = out.e_v[i] = select(kept, line.e_v[i], out.e_v[i]);
  }
  line.s = out.s = select(kept, line.s, out.s), line.sdot = out.sdot = select(kept, line.sdot, out.sdot);
  out.regular &= ~line.missed;
}

// --- the loop ---------------------------------------------------------------------------------------------------------
// The ticks that a call takes: `ticks` of them with a period after each and, at the end of the run, one `last` without.
// `missed`: (time, rollouts), 1 where the law misses its tick and its torque stays, 2 where none acts then; `stale`: 1 where no
// measurement comes. Both are null where nothing is lost. `inputs`: u of the speed inputs, (time, inputs, rollouts).
struct Span { integer law_tick, arm_tick, ticks, rollouts; int last, stops; const unsigned char *missed, *stale; const double *inputs; };

// The state of the law beside s, and the first one, to which lost rollouts go back.
template <class V> struct LawMemory { V now[MOST_MEMORY], first[MOST_MEMORY]; };
template <class V> static void load_memory(const Setup &setup, const Place<V> &place, const State &state, LawMemory<V> &memory) {
  if (!setup.memory) return;
  load(place, state.memory, setup.memory, setup.memory, memory.now), load(place, state.first_memory, setup.memory, setup.memory, memory.first);
}
// The mean over a period of the torques that act in its parts.
template <int N, class V> static void find_mean(const Setup &setup, const V (*acting)[room<N>()], V *mean) {
  const double *part = setup.part;
  for (int i = 0; i < setup.joints; i++)
    mean[i] = setup.parts == 1 ? acting[0][i] : (part[0] * acting[0][i] + part[1] * acting[1][i]) / (part[0] + part[1]);
}

// Run the rollouts of a pack; return the number of samples recorded.
template <int N, class V, class C>
static NOINLINE integer run_pack(const Setup &setup, const State &state, const Record &record, const double *noise, const Span &span, const Place<V> &place) {
  const int n = size<N>(setup.joints);
  ArmOf<V, C> law_copy, plant_copy;
  const Arm<C> &law_arm = law_copy(place, setup.law_arms), &plant_arm = plant_copy(place, setup.plant_arms);
  Gains<V> gains;
  Senses<V> senses;
  Friction<V> law_friction, plant_friction;
  Rollouts<V> r;
  const Path *paths[Lanes<V>::count];
  load(place, setup.position_gain, n, gains.position), load(place, setup.velocity_gain, n, gains.velocity), load(place, setup.plan_gain, 1, &gains.plan);
  load(place, setup.observer_gain, n, gains.observer), load(place, setup.resolution, n, senses.resolution), load(place, setup.torque_limit, n, senses.limit);
  load_friction(place, setup.law_friction, n, law_friction), load_friction(place, setup.plant_friction, n, plant_friction);
  const Mask<V> damped = load_mask<V>(place, setup.damped);
  load_state(place, state, n, r);
  LawMemory<V> memory;
  Thresholds<V> thresholds;
  load_memory(setup, place, state, memory), load_thresholds(setup, place, thresholds);
  Moment<V> moment;
  RuleRates<V> rates;
  Output<V> &out = moment.out;
  Line<V> line;
  const V *q_seen = span.missed ? line.q : r.q_read, *qd_seen = span.missed ? line.qd : r.qd_read;
  if (span.missed) load_line(place, state, n, line);
  for (int lane = 0; lane < Lanes<V>::count; lane++) paths[lane] = setup.paths + (setup.path_index ? setup.path_index[rollout_of(place, lane)] : 0);
  const integer waiting = setup.delayed * n;
  Buffer<V> queue(waiting);  // a ring of torques that wait, the oldest at `head`
  for (int k = 0; k < setup.delayed; k++) load(place, state.queue + k * span.rollouts * n, n, n, &queue[k * n]);
  integer head = 0, sample = 0;
  for (;; sample++) {
    const bool final = sample == span.ticks;
    if (final && !span.last) break;
    const double t = (span.law_tick + sample) * setup.period;
    look_at_state(setup, r, t);
    for (int k = 0; k < setup.memory; k++) memory.now[k] = select(lost_lanes(r), memory.first[k], memory.now[k]);
    V held[room<N>()], acting[2][room<N>()];
    if (span.missed) see(place, n, r, span.missed + sample * span.rollouts, span.stale + sample * span.rollouts, line);
    decide<N>(setup, place, law_arm, law_friction, gains, thresholds, paths, t, span.inputs + sample * setup.inputs * span.rollouts, span.rollouts,
              q_seen, qd_seen, r.s, memory.now, moment, rates);
    if (span.missed) say(n, span.law_tick + sample == 0, line, out);
    look_at_torque(setup, r, out.tau, t);
    const Mask<V> lost = lost_lanes(r);
    for (int i = 0; i < n; i++) {
      held[i] = setup.limited ? clamped(out.tau[i], V(-senses.limit[i]), senses.limit[i]) : out.tau[i];
      held[i] = select(lost, V{}, held[i]);
      for (int part = 0; part < setup.parts; part++) acting[part][i] = part < setup.delayed ? queue[(head + part) % setup.delayed * n + i] : held[i];
    }
    if (setup.drops && setup.limited) {
      V limit[MOST_JOINTS];
      for (int i = 0; i < n; i++) limit[i] = senses.limit[i];
      weaken(setup, place, (span.arm_tick + sample + 0.5) * setup.period, limit);
      for (int part = 0; part < setup.parts; part++)
        for (int i = 0; i < n; i++) acting[part][i] = clamped(acting[part][i], V(-limit[i]), limit[i]);
    }
    write_sample<N>(record, sample * record.stride, place, n, r, q_seen, qd_seen, out, acting[0]);
    look_at_finish(setup, paths, r, out.s, t);
    const Mask<V> going = ~lost & (setup.ends_run && setup.finish != NEVER ? ~equal(r.finish_time, r.finish_time) : ~Mask<V>{});
    if (final || (span.stops && !any(going))) { sample++; break; }
    const V next_s = advance_parameter(setup, paths, out);
    r.s = select(lost, r.first_s, span.missed ? select(line.missed, r.s, next_s) : next_s);
    if (setup.memory) {
      V mean[MOST_JOINTS], next[MOST_MEMORY];
      for (int k = 0; k < setup.memory; k++) next[k] = memory.now[k];
      find_mean<N>(setup, acting, mean);
      advance_memory(setup, t, moment, rates, mean, next);
      for (int k = 0; k < setup.memory; k++) memory.now[k] = span.missed ? select(line.missed, memory.now[k], next[k]) : next[k];
    }
    if (sample == 0 && setup.struck) {
      V struck[room<N>()];
      load(place, setup.struck, n, n, struck);
      for (int i = 0; i < n; i++) r.qd[i] = select(lost, r.qd[i], struck[i]);
    }
    double now = (span.arm_tick + sample) * setup.period;
    for (int part = 0; part < setup.parts; part++) {
      const double step = setup.part[part] / setup.substeps;
      for (int k = 0; k < setup.substeps; k++, now += step) {
        V pushed[room<N>()];
        for (int i = 0; i < n; i++) pushed[i] = acting[part][i];
        if (setup.disturbances) add_disturbances<N>(setup, place, r.q, now + 0.5 * step, pushed);
        Mask<V> held[room<N>()];
        const bool holds = setup.jams && find_held(setup, place, now + 0.5 * step, held);
        Walls<V> walls;
        const bool meets = setup.walls && find_walls(setup, place, now + 0.5 * step, walls);
        advance_plant<N>(plant_arm, plant_friction, damped, step, r.q, r.qd, pushed, holds ? held : nullptr, meets ? &walls : nullptr);
      }
    }
    if (setup.delayed) {
      for (int i = 0; i < n; i++) queue[head * n + i] = held[i];
      head = (head + 1) % setup.delayed;
    }
    V q_noise[room<N>()], qd_noise[room<N>()];
    if (noise) {
      load(place, noise + 2 * sample * span.rollouts * n, n, n, q_noise), load(place, noise + (2 * sample + 1) * span.rollouts * n, n, n, qd_noise);
    }
    read_sensors(setup, senses, r, noise ? q_noise : nullptr, noise ? qd_noise : nullptr);
  }
  store_state(place, r, n, state);
  if (setup.memory) store(place, memory.now, setup.memory, state.memory);
  if (span.missed) store_line(place, line, n, state);
  for (int k = 0; k < setup.delayed; k++) store(place, &queue[(head + k) % setup.delayed * n], n, state.queue + k * span.rollouts * n);
  return sample;
}

template <int N, class V, class C>
static integer run_packs(const Setup &setup, const State &state, const Record &record, const double *noise, const Span &span, integer begin, integer end) {
  integer samples = 0;
  for (integer first = begin; first < end; first += Lanes<V>::count) {
    const integer left = end - first;
    const Place<V> place = {first, left < Lanes<V>::count ? left : Lanes<V>::count};
    samples = run_pack<N, V, C>(setup, state, record, noise, span, place);
  }
  return samples;
}

// Take (q, q̇) of rollouts begin … end one step on under the torques `tau`, (rollouts, joints) each, for laws in Python; joints
// with `held` > 0 are held, none where it is null. Walls are those of the setup that stand at time 0.
template <int N, class V, class C>
static void advance_packs(const Setup &setup, double step, double *q, double *qd, const double *tau, const double *held, integer begin, integer end) {
  const int n = size<N>(setup.joints);
  for (integer first = begin; first < end; first += Lanes<V>::count) {
    const Place<V> place = {first, end - first < Lanes<V>::count ? end - first : Lanes<V>::count};
    ArmOf<V, C> copy;
    Friction<V> friction;
    V own_q[room<N>()], own_qd[room<N>()], own_tau[room<N>()];
    load_friction(place, setup.plant_friction, n, friction);
    load(place, q, n, n, own_q), load(place, qd, n, n, own_qd), load(place, tau, n, n, own_tau);
    V flag[room<N>()];
    Mask<V> own_held[room<N>()];
    if (held) load(place, held, n, n, flag);
    for (int i = 0; held && i < n; i++) own_held[i] = less(V{}, flag[i]);
    const Arm<C> &arm = copy(place, setup.plant_arms);
    Walls<V> walls;
    const bool meets = setup.walls && find_walls(setup, place, 0.0, walls);
    advance_plant<N>(arm, friction, load_mask<V>(place, setup.damped), step, own_q, own_qd, own_tau, held ? own_held : nullptr, meets ? &walls : nullptr);
    store(place, own_q, n, q), store(place, own_qd, n, qd);
  }
}
