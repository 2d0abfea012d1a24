"""The disturbance torque of a run, estimated from its motion by the momentum observer."""

from __future__ import annotations

from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array, average_neighbours
from pathcontrol._expect import expect, expect_choice
from pathcontrol.analysis.lost_samples import bridge, find_lost, hold_at_end, spread_over_gaps
from pathcontrol.control.base import KnownFriction
from pathcontrol.errors import InputError
from pathcontrol.robot.batch import select_friction
from pathcontrol.robot.friction import FrictionLaw, levels_of, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.config import table
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.sampled import split_delay


@np.errstate(over="ignore", invalid="ignore")  # numbers from a file may be huge
def momentum_observer(
    run: Run,
    robot: RobotModel | None = None,
    *,
    cutoff_hz: ArrayLike = 20.0,
    friction: KnownFriction = "none",
    measured: bool = True,
) -> Array:
    """Estimate the torque that acts on the joints beside the motors [N m], (rollout, time, n).

    With the momentum p = M(q)q̇ the observer

        r(t) = K (p(t) − p(0) − ∫₀ᵗ (τ + C(q,q̇)ᵀq̇ − g(q) + r) dt'),  K = 2π · ``cutoff_hz``

    is the disturbance torque d behind a first-order low-pass filter at each joint, ṙ = K (d − r) with r(0) = 0, and
    needs neither an acceleration nor the inverse of M (A. De Luca and R. Mattone, Sensorless robot collision
    detection and hybrid force/motion control, ICRA 2005; A. De Luca, A. Albu-Schäffer, S. Haddadin and G. Hirzinger,
    Collision detection and safe reaction with the DLR-III lightweight manipulator arm, IROS 2006). What the model
    leaves out is part of d: friction, with a minus, and errors of masses.

    From one sample to the next the mean of d follows from the change of p, the mean torque, and the trapezoidal rule
    for the rest; to this mean, held, the filter responds exactly. The error is of second order in the period.

    Over a ``Dropout``, at whose samples no new measurement came, the motion is a cubic between the measurements before
    and after it, and d is its mean over the gap; in a gap that lasts to the end of the run r stays as it is.

    Args:
        run: a run of any law and loop, or a log with q, q̇ and τ.
        robot: the arm's model; by default the one that the law computed with.
        cutoff_hz: corner frequency of the filter [Hz], a number or (n,); inf for the mean of d over each period.
        friction: what of the model's friction is known and so no part of d: ``"none"``, ``"viscous"``, or ``"full"``;
            of a joint that rests or turns round, dry friction explains what it can.
        measured: take q and q̇ as the loop measured them, with noise and encoders; False for the true ones. Velocities
            by difference are half a period old, and so is the estimate; a filter of the loop on them is undone.

    Returns:
        r, NaN where the rollout has diverged.

    Raises:
        InputError: the run does not know its robot, it has other joints, or the frequency is not above 0.
        UnknownNameError: the run has no torques, or there is no such ``friction``.
    """
    expect("run", run, Run)
    arm = _find_arm(run, robot)
    expect_choice("friction", friction, get_args(KnownFriction))
    rate = 2 * np.pi * _check_cutoff(cutoff_hz, arm)
    time, q, qd = motion_of(run, measured)
    known, dt = enumerate(zip(q, qd, _mean_torque(run, time), strict=True)), np.diff(time)[:, None]
    means = [_mean_disturbance(select_friction(arm, i), friction, dt, *rollout) for i, rollout in known]
    if measured:
        means = [spread_over_gaps(one, dt, lost) for one, lost in zip(means, _find_lost_samples(run), strict=True)]
    r = _low_pass(np.stack(means), np.diff(time), rate, np.where(np.isfinite(q[:, 0]), 0.0, np.nan))
    return hold_at_end(r, _find_lost_samples(run)) if measured else r


def _find_arm(run: Run, robot: RobotModel | None) -> RobotModel:
    """Return the model to observe with, after checking that it has the joints of the run."""
    arm = run.model if robot is None else robot
    expect("robot", arm, RobotModel)
    if arm.n != len(run.joints):
        raise InputError(
            f"{arm.name} has {arm.n} joints, the run {len(run.joints)}; expected as many",
            argument="robot",
            value=arm.n,
            limit=len(run.joints),
        )
    return arm


def _check_cutoff(cutoff_hz: ArrayLike, arm: RobotModel) -> Array:
    """Check the corner frequencies [Hz]; return them as (n,)."""
    cutoff = as_array("cutoff_hz", cutoff_hz)
    if cutoff.shape not in ((), (arm.n,)) or not (cutoff > 0).all():
        raise InputError(
            f"cutoff_hz = {cutoff.tolist()}, expected a frequency greater than 0 [Hz], or one for each of the "
            f"{arm.n} joints",
            argument="cutoff_hz",
            value=cutoff_hz,
        )
    return np.broadcast_to(cutoff, (arm.n,))


def loop_number(run: Run, name: str) -> float:
    """Return a number of the loop's settings that is not negative; 0 where there is none."""
    try:
        number = float(table(run.config, "loop").get(name, 0.0))
    except (TypeError, ValueError):
        return 0.0
    return number if 0.0 <= number < np.inf else 0.0


def split_loop_delay(run: Run) -> tuple[int, float]:
    """Return the whole periods of the delay of a loop, and the share of a period that is left."""
    period = loop_number(run, "period")
    whole, late = split_delay(loop_number(run, "delay"), period) if period else (0, 0.0)
    return whole, late / period if late else 0.0


def _velocity_age(run: Run) -> float:
    """Return how long ago [s] the arm had the velocity of a sample: half a period for a difference of positions."""
    by_difference = table(run.config, "loop").get("velocity") == "difference"
    return 0.5 * loop_number(run, "period") if by_difference else 0.0


def motion_of(run: Run, measured: bool) -> tuple[Array, Array, Array]:
    """Return the times (time,) at which the arm had its velocities, and positions and velocities at these times."""
    if not (measured and "qd_measured" in run):
        return run.time, run.array("q"), run.array("qd")
    qd, position = _unfiltered(run), run.array("q_measured" if "q_measured" in run else "q")
    age = np.full(len(run.time), _velocity_age(run))
    age[0] = 0.0  # the first velocity is that of the start
    time = run.time - age
    return time, *bridge(time, position - age[:, None] * qd, qd, _find_lost_samples(run))


def _find_lost_samples(run: Run) -> NDArray[np.bool_]:
    """Return the samples at which no new measurement came, (rollout, time)."""
    return find_lost(run, filtered=loop_number(run, "filter_hz") > 0)


def _unfiltered(run: Run) -> Array:
    """Return the measured velocities before the low-pass filter of the loop, (rollout, time, n)."""
    qd = run.array("qd_measured")
    new = -np.expm1(-2 * np.pi * loop_number(run, "filter_hz") * loop_number(run, "period"))
    if not new:
        return qd
    return np.concatenate([qd[:, :1], qd[:, :-1] + np.diff(qd, axis=1) / new], axis=1)


def _mean_torque(run: Run, time: Array) -> Array:
    """Return the mean torques τ of a run between some times (k,), (rollout, k − 1, n): differences of its impulse.

    A velocity by difference is the mean one of its period. So is the impulse then, as a torque that begins to act
    within a period, after a part of the delay, does not give the arm this velocity in the middle of it.
    """
    tau, begin = run.array("tau"), run.time - _torque_lead(run)
    begin[0] = run.time[0]
    dt = np.diff(begin)[:, None]
    impulse, area = np.zeros(tau.shape), np.zeros(tau.shape)  # ∫τdt, and ∫∫τdt dt
    np.cumsum(tau[:, :-1] * dt, axis=1, out=impulse[:, 1:])
    np.cumsum((impulse[:, :-1] + 0.5 * tau[:, :-1] * dt) * dt, axis=1, out=area[:, 1:])
    since = _find_held_torques(begin, time)
    until = impulse[:, since.held] + tau[:, since.held] * since.time
    if (late := time < run.time).any():
        now = _find_held_torques(begin, run.time)
        areas = area[:, now.held] + (impulse[:, now.held] + 0.5 * tau[:, now.held] * now.time) * now.time
        means = np.diff(areas, axis=1) / np.diff(run.time)[:, None]
        until[:, 1:] = np.where(late[1:, None], means, until[:, 1:])
    return np.diff(until, axis=1) / np.diff(time)[:, None]


class _HeldTorques(NamedTuple):
    """The torque, by its number, that is held at some times, (k,), and for how long it has been [s], (k, 1)."""

    held: NDArray[np.intp]
    time: Array


def _find_held_torques(begin: Array, time: Array) -> _HeldTorques:
    """Return which torque is held at some times, where each begins to act at ``begin``, and since when."""
    held = np.searchsorted(begin, time, side="right") - 1
    return _HeldTorques(held, (time - begin[held])[:, None])


def _torque_lead(run: Run) -> float:
    """Return how long before its sample [s] a torque began to act.

    That is after the sample before by the part of the delay that is no whole period. In continuous time, where torques
    change on the way, it is half a period: the trapezoidal rule.
    """
    if table(run.config, "loop").get("loop") == "continuous":
        return 0.5 * loop_number(run, "output_period")
    period = loop_number(run, "period")
    late = split_delay(loop_number(run, "delay"), period)[1] if period else 0.0
    return period - late if late else 0.0


def _mean_disturbance(arm: RobotModel, friction: KnownFriction, dt: Array, q: Array, qd: Array, tau: Array) -> Array:
    """Return the mean of d between the samples of one rollout, (time − 1, n)."""
    if friction == "full":
        return split_unexplained(arm, dt, q, qd, tau)[1]
    unexplained = _unexplained_torque(arm, dt, q, qd, tau)
    return unexplained if friction == "none" else unexplained + viscous_of(arm.friction) * average_neighbours(qd)


def split_unexplained(arm: RobotModel, dt: Array, q: Array, qd: Array, tau: Array) -> tuple[Array, Array]:
    """Return the mean dry friction and the mean of d between the samples of one rollout [N m], (time − 1, n) each.

    The motion is q [rad] and q̇ [rad/s], (time, n), under mean torques τ [N m], (time − 1, n), over dt [s].
    """
    smooth = _unexplained_torque(arm, dt, q, qd, tau) + viscous_of(arm.friction) * average_neighbours(qd)
    dry = _dry_friction(arm.friction, qd, -smooth)
    return dry, smooth + dry


def _unexplained_torque(arm: RobotModel, dt: Array, q: Array, qd: Array, tau: Array) -> Array:
    """Return what τ does not explain of Δp, over dt, (time − 1, n)."""
    rate = arm.momentum_rate(q, qd, np.zeros(arm.n))
    return np.diff(arm.momentum(q, qd), axis=0) / dt - tau - average_neighbours(rate)


def _dry_friction(law: FrictionLaw, qd: Array, wanted: Array) -> Array:
    """Return the mean dry friction between samples [N m], (time − 1, n).

    Of a joint that rests, or turns round, it is what explains the motion best within its levels: that nearest to
    ``wanted``.
    """
    plus, minus = (np.broadcast_to(level, qd.shape) for level in levels_of(law, qd))
    dry = np.where(qd > 0, plus, 0.0) - np.where(qd < 0, minus, 0.0)
    most, least = np.maximum(plus[1:], plus[:-1]), -np.maximum(minus[1:], minus[:-1])
    turns = np.sign(qd[1:]) * np.sign(qd[:-1]) <= 0
    return np.where(turns, np.clip(wanted, least, most), average_neighbours(dry))


def _low_pass(means: Array, dt: Array, rate: Array, start: Array) -> Array:
    """Return the response ṙ = K (d − r) from ``start`` (rollout, n) to means held for dt, (rollout, time, n)."""
    r = np.empty((len(means), len(dt) + 1, len(rate)))
    r[:, 0] = start
    gains = -np.expm1(-rate * dt[:, None])
    for k, gain in enumerate(gains):
        r[:, k + 1] = r[:, k] + gain * (means[:, k] - r[:, k])
    return r
