"""Warnings of periods that are too long for the gains of a law, and of steps that are too long for the arm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.adaptive_slotine_li import AdaptiveSlotineLi
from pathcontrol.control.base import Controller
from pathcontrol.control.motion_control import PDPlus, SlotineLi
from pathcontrol.control.plan_feedback import PlanFeedback
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import PathControlWarning, warn
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import viscous_of
from pathcontrol.simulation.arm.disturbance import Disturbance
from pathcontrol.simulation.checks.adaptation import check_adaptation
from pathcontrol.simulation.checks.extreme_arms import arm_of, find_extreme_arms
from pathcontrol.simulation.checks.fast_modes import (
    DampedArm,
    add_damping,
    rate_of_arm,
    rate_of_friction,
    rates_of_disturbance,
)
from pathcontrol.simulation.checks.held_gains import linearize_law, longest_period
from pathcontrol.simulation.checks.own_rates import check_own_rates, check_pace
from pathcontrol.simulation.checks.plan_gain import check_plan_gain
from pathcontrol.simulation.checks.too_fast import TooFast, gather_paths, select_worst
from pathcontrol.simulation.loops import MOST_SUBSTEPS, Arm, ContinuousTime, SampledLoop
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

_SAMPLES, _FINE = 9, 65  # samples of a path for the arm and for the plan
_MOST, _FEWEST = 1 << 16, 3  # samples of all tasks of a batch together, and of each at least
# gains that are no part of the linearised feedback
_NO_FEEDBACK = ("k", "adaptation", "recharge", "energy", "approach", "k_s")
_SLOW = 1.0  # h times a rate of growth or decay up to which a step resolves it
_OSCILLATION = 0.3  # h ω up to which the midpoint rule resolves an oscillation, to 1.5 % of ω
_SPRING = 0.05  # h ω advised for a spring that is held over a step: holding it adds energy at the rate hω²/4


class StepWarning(PathControlWarning):
    """The warning of a period or a step that is too long."""


def warn_of_steps(
    controllers: Sequence[Controller],
    loop: SampledLoop | ContinuousTime,
    robot: Arm,
    q: Array,
    qd: Array,
    disturbance: Disturbance | None,
    duration: float,
) -> str:
    """Warn of a period that is too long for the gains, and of steps too long for the fast modes of the plant.

    It is an estimate of linear systems at some postures, for exact sensors without a delay and no limits of torque.

    Args:
        controllers: the laws, one after the other.
        loop: how the loop is closed; continuous time finds its steps itself.
        robot: the arm, or one for each rollout, of which those most sensitive to a step are checked.
        q: joint positions at the start [rad], (N, n).
        qd: joint velocities at the start [rad/s], (N, n).
        disturbance: the disturbance of the arm.
        duration: simulated time [s].

    Returns:
        The warnings in one text, or an empty text; if the arm diverges, they are the likely cause.
    """
    sentences = find_steps_too_long(controllers, loop, robot, q, qd, disturbance, duration)
    for sentence in sentences:
        warn(sentence, StepWarning)
    return "; ".join(sentences)


def find_steps_too_long(
    controllers: Sequence[Controller],
    loop: SampledLoop | ContinuousTime,
    robot: Arm,
    q: Array,
    qd: Array,
    disturbance: Disturbance | None,
    duration: float,
) -> list[str]:
    """Return the sentences that :func:`warn_of_steps` warns with."""
    if not isinstance(loop, SampledLoop):
        return []
    if not (robot.robots[0] if isinstance(robot, RobotBatch) else robot).has_mass:
        return []
    try:
        return list(dict.fromkeys(_find_warnings(controllers, loop, robot, q, qd, disturbance, duration)))
    except np.linalg.LinAlgError:  # M is singular up to rounding, so that no estimate can be made
        return []


def _find_warnings(
    controllers: Sequence[Controller],
    loop: SampledLoop,
    robot: Arm,
    q: Array,
    qd: Array,
    disturbance: Disturbance | None,
    duration: float,
) -> Iterator[str]:
    """Yield the warnings of all laws, of the arm and of the disturbance."""
    rows = find_extreme_arms(robot, q[:1])
    felt = {row: add_damping(arm_of(robot, row), loop.period / loop.substeps) for row in rows}
    yield from gather_paths([list(_check_law(law, loop, robot, felt, q, qd)) for law in controllers])
    if disturbance is not None:
        found = (one for arm in felt.values() for one in _check_disturbance(disturbance, loop, arm, q, qd, duration))
        yield from (one.sentence for one in select_worst(found))


def _check_law(
    law: Controller, loop: SampledLoop, robot: Arm, felt: Mapping[int, DampedArm], q: Array, qd: Array
) -> Iterator[TooFast]:
    """Yield what is too fast of a law, and of the arms on its path."""
    yield from check_pace(law, loop.period)
    law = unwrap(law)
    postures, speeds = _sample_states(law.task, q, qd)
    yield from _check_gains(law, loop.period, robot, list(felt), postures)
    yield from _check_plan(law, loop)
    yield from check_adaptation(law, loop.period, q, qd)
    yield from check_own_rates(law, loop.period)
    yield from select_worst(one for arm in felt.values() for one in _check_arm(loop, arm, postures, speeds))


def _sample_states(task: PathTask, q: Array, qd: Array) -> tuple[Array, Array]:
    """Return the first start and states on the path, for a batch on its fastest paths, (k, n) each."""
    n = q.shape[-1]
    if not isinstance(task, TaskBatch):
        point = task.at(np.linspace(*task.sampled_interval, _SAMPLES))
        return np.concatenate([q[:1], point.q_d]), np.concatenate([qd[:1], point.velocity])
    point = task.at(_sample_paths(task, _SAMPLES))
    rows = np.unique(np.abs(point.velocity).max(0).argmax(0))
    postures, speeds = (np.reshape(part[:, rows], (-1, n)) for part in (point.q_d, point.velocity))
    return np.concatenate([q[:1], postures]), np.concatenate([qd[:1], speeds])


def _sample_paths(task: TaskBatch, samples: int) -> Array:
    """Return parameters of all tasks of a batch, (samples, N); fewer samples of each, the more tasks there are."""
    lower, upper = (np.broadcast_to(end, len(task)) for end in task.sampled_interval)
    count = int(np.clip(_MOST // len(task), _FEWEST, samples))
    return lower + np.linspace(0.0, 1.0, count)[:, None] * (upper - lower)


def _check_gains(law: Controller, period: float, robot: Arm, rows: list[int], q: Array) -> Iterator[TooFast]:
    """Yield the warning of a period that is too long for the gains."""
    compensated, longest, worst = np.atleast_2d(law.compensated), np.inf, 0
    for one in linearize_law(law, q, rows if isinstance(robot, RobotBatch) else ()):
        arm = arm_of(robot, one.rollout)
        left = np.atleast_2d(viscous_of(arm.friction))[0] - compensated[one.rollout % len(compensated)]
        if (found := longest_period(one, arm, left, q, period)) < longest:
            longest, worst = found, one.rollout
    if period < longest:
        return
    several = any(np.ndim(getattr(law, name)) > 1 and len(getattr(law, name)) > 1 for name in law.gains)
    where = f" (rollout {worst})" if several or isinstance(robot, RobotBatch) else ""
    gains = " and ".join(
        f"{name} up to {np.max(getattr(law, name)):g}" for name in law.gains if name not in _NO_FEEDBACK
    )
    torques = isinstance(law, PDPlus | SlotineLi | AdaptiveSlotineLi)
    remedy = "K over inertia times h is below 2" if torques else "K_v h < 2 and K_p h < 2 K_v"
    yield TooFast(
        f"gains of {type(law).__name__}",
        period / longest,
        f"gains {gains} of {type(law).__name__} need a period below {longest:.3g} s{where}, the loop has {period:g} s "
        f"and is likely to be unstable; shorten the period (more substeps do not help), or lower the gains so that "
        f"{remedy}",
    )


def _check_plan(law: Controller, loop: SampledLoop) -> Iterator[TooFast]:
    """Yield the warning of a gain k of the plan that is beyond what the loop bears."""
    if isinstance(law, PlanFeedback):
        task = law.task
        s = _sample_paths(task, _FINE) if isinstance(task, TaskBatch) else np.linspace(*task.sampled_interval, _FINE)
        yield from check_plan_gain(law, loop, s)


def _check_arm(loop: SampledLoop, damped: DampedArm, q: Array, qd: Array) -> Iterator[TooFast]:
    """Yield the warnings of a step that is too long for the arm itself."""
    rate = rate_of_arm(damped, q, qd)
    yield from _check_rate(loop, rate, _OSCILLATION, "the arm under gravity at the speed of the task")
    rate, joint = rate_of_friction(damped, q)
    name = damped.arm.joint_names[joint]
    yield from _check_rate(loop, rate, _SLOW, f"the Stribeck friction of {name}, which falls so fast")


def _check_disturbance(
    disturbance: Disturbance, loop: SampledLoop, damped: DampedArm, q: Array, qd: Array, duration: float
) -> Iterator[TooFast]:
    """Yield the warnings of a step too long for a state-dependent disturbance that is held over it."""
    name = f"the disturbance {type(disturbance).__name__}".replace(" _Sum", "")
    damping, oscillation = rates_of_disturbance(disturbance, damped, q, qd, duration)
    yield from _check_rate(loop, damping, _SLOW, f"{name}, which damps the arm but is held over a step and so rings")
    if oscillation * loop.period / loop.substeps > _OSCILLATION:
        yield from _check_rate(loop, oscillation, _SPRING, f"{name}, a spring that is held over a step")


def _check_rate(loop: SampledLoop, rate: float, bound: float, what: str) -> Iterator[TooFast]:
    """Yield the warning that a step is too long for a ``rate`` [1/s], with the substeps that would suffice."""
    step = loop.period / loop.substeps
    if rate * step <= bound:
        return
    substeps = ceil(loop.period * rate / bound)
    remedy = f"take substeps={substeps}" if substeps <= MOST_SUBSTEPS else "make it less stiff, or shorten the period"
    yield TooFast(
        what,
        rate,
        f"steps of {1e3 * step:.3g} ms are too long for {what}: its fastest mode has {rate:.3g} 1/s; {remedy} "
        f"(SampledLoop has {loop.substeps} in a period of {loop.period:g} s)",
    )
