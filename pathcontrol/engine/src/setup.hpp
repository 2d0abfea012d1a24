// The structs that Python fills: the settings of a run, its state, and the addresses of its record. engine/structs.py has the same
// fields in the same order; sizes are compared when the library is loaded.
#pragma once
#include "friction.hpp"
#include "path.hpp"

// Values of each rollout, (rollouts, …) with `stride` from one to the next; stride 0: the same for all.
struct Rows { const double *data; integer stride; };

struct FrictionRows { Rows viscous, forward, backward; integer stribeck; Rows fall[MOST_STRIBECK], velocity[MOST_STRIBECK]; };

// Arms, and the index of each rollout's arm; no index: all have the first.
struct Arms { const Arm<double> *arms; const int *index; };

enum LawKind { COMPUTED_TORQUE, PD_PLUS, SLOTINE_LI, EXTENDED_MOTION_PLAN, PROJECTION };
enum Compensation { NO_FRICTION, VISCOUS_FRICTION, FULL_FRICTION };
enum Branch { FOLLOW, NEAREST, LOCAL };
enum FinishKind { NEVER, AT_END, AFTER_LAPS };
enum DisturbanceKind { PUSH, HARMONIC, FRAME_FORCE, JAMMED_JOINT, TORQUE_LIMIT_DROP, WALL };
enum Reason { SOUND, BEYOND_BOUNDS, NO_NUMBERS };

struct Disturbance {
  int kind, body;               // the body that carries the frame of a force or a wall
  double offset[3];             // of the frame's origin in it [m]
  const Arm<double> *arm;       // the arm whose kinematics the force acts through
  Rows magnitude;               // torque [N m], force [N], 1 for each joint that jams, shares of torque limits, or a point of a wall [m]
  Rows start, duration;         // [s]
  Rows frequency, phase;        // [Hz], [rad]
  Rows axes, stiffness, damping, roughness;  // of a wall: normal and directions along it, [N/m], [N s/m], coefficient of friction
};

enum RuleKind { SPEED_OVERRIDE, CONTACT, PACE };

// A rule for the speed along the path, see control/wrappers. Its state is in the memory of the law, from `first` on.
struct Rule {
  int kind, first, input;       // input: the number of the speed input of an override
  double acceleration, pause;   // largest |ẇ| [1/s]; for how long a plan stays halted after a contact [s]
  Rows threshold;               // contact torques at which a plan is halted [N m]
  const double *torque;         // limits that a pace keeps [N m]
  const Path *fastest, *fastest_back;  // the fastest plans along each path, and those of a plan that goes back, or null
};

struct Setup {
  int joints, law, compensation, branch, finish, ends_run, laps;
  int substeps, parts, delayed;       // parts of a period with torques of their own; periods that a torque waits
  int encoders, differentiates, filters, limited, disturbances;
  int memory, observes, compensates, rules, inputs;  // numbers of the law's state beside s; whether it has an observer, and uses it
  int jams, drops, walls;             // 1 where a disturbance holds joints, and where one lowers torque limits; number of walls
  double period, part[2], keep, capture;  // keep: share of the last velocity that the filter keeps
  Arms law_arms, plant_arms;
  const Path *paths;
  const int *path_index;              // none: all have the first
  Rows position_gain, velocity_gain, plan_gain, observer_gain, resolution, torque_limit;
  const Rule *rule;
  FrictionRows law_friction, plant_friction;
  Rows damped;                        // 1 for rollouts whose viscous friction is condensed, see plant.hpp
  const Disturbance *disturbance;
  const double *struck;               // velocities after an impulse at the first tick of a call, (rollouts, joints), or null
};

// (rollouts, joints) or (rollouts,) each; `queue` is (delayed, rollouts, joints). What was seen and said last is kept where
// ticks or measurements are lost, and null elsewhere.
struct State {
  double *q, *qd, *q_read, *qd_read, *home_q, *home_qd, *queue;
  double *s, *first_s, *rest_since, *lap_start, *finish_time, *diverged_time, *reason;
  double *memory, *first_memory;      // (rollouts, memory): the law's state beside s, and the first one
  double *q_seen, *qd_seen, *tau_said, *e_p_said, *e_v_said, *s_said, *sdot_said;
};

// (time, rollouts, joints) or (time, rollouts) each, from the first sample of this call on, `stride` bytes from one to the next.
struct Record {
  double *q, *qd, *q_measured, *qd_measured, *tau_demand, *tau, *s, *sdot, *e_p, *e_v;
  unsigned char *regular;
  integer stride;
};
