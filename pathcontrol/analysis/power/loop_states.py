"""The states of a run's closed loop, as the theorem of its law takes them."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.power.closed_loop_theorems import LoopState
from pathcontrol.analysis.power.law_of_run import LawRecord
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.maneuver_regulation import ManeuverRegulation
from pathcontrol.control.reference_law import ReferenceLaw
from pathcontrol.control.state_to_reference import StateToReferenceProjection
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.tasks.base import PathPoint


def states_of(controller: Controller, record: LawRecord, q: Array, qd: Array) -> tuple[LoopState, Array, Array]:
    """Return the true states of a loop, their path parameters σ and speed factors w, (k, N) each.

    Of a law whose σ is a function of the state it is that of the true one, and else the recorded one.

    Args:
        controller: the law.
        record: the law's part in the run.
        q: true joint positions [rad], (k, N, n).
        qd: true joint velocities [rad/s], (k, N, n).
    """
    law, task = unwrap(controller), controller.task
    w = _factor(task.at(_clip_to_path(law, record.s)), record.velocity)
    law = law.at_speed(w)
    s, reference = record.s, None
    if isinstance(law, ReferenceLaw):
        reference, timed = law.project(q, qd, record.s), law.timed(record.s)
        s = np.where(timed, record.s, reference.s)
    point = task.at(_clip_to_path(law, s))
    e_p, e_v = point.q_d - q, w[..., None] * point.velocity - qd
    rate, gain = w * point.theta, np.zeros(s.shape)
    if isinstance(law, ExtendedMotionPlan):
        gain = np.broadcast_to(law.plan_gain(s), s.shape)
        sdot = law.inside(s, rate - gain * np.vecdot(e_p, point.dq_d))
    elif isinstance(law, StateToReferenceProjection) and reference is not None:
        sdot = np.where(timed, rate, reference.rate(qd, law.K_v * e_v + law.K_p * e_p))
    elif isinstance(law, ManeuverRegulation) and reference is not None:
        qdd = w[..., None] * point.velocity_slope * rate[..., None] + law.K_v * e_v + law.K_p * e_p
        sdot = np.where(timed, rate, reference.rate_at(qd, qdd))
    else:
        sdot = rate
    slope = w[..., None] * point.velocity_slope
    return LoopState(q, qd, e_p, e_v, point.dq_d, point.velocity, slope, sdot, rate, gain), s, w


def _clip_to_path(law: Controller, s: Array) -> Array:
    """Return parameters within an open path."""
    return s if law.task.closed else np.clip(s, law.task.s0, law.task.s_end)


def _factor(point: PathPoint, velocity: Array) -> Array:
    """Return the factor w (k, N) of the desired velocity wr; 0 where the profile stands still."""
    r = point.velocity
    squared = np.vecdot(r, r)
    return np.divide(np.vecdot(r, velocity), squared, out=np.zeros_like(squared), where=squared > 0)
