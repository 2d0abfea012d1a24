"""Periods that are too long for the gains of a law, and steps that are too long for the arm: told before a run."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from math import ceil

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.motion import PDPlus, SlotineLi
from pathcontrol.errors import PathControlWarning
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.disturbance import Disturbance
from pathcontrol.simulation.fast_modes import rate_of_arm, rate_of_friction, rates_of_disturbance, with_damping
from pathcontrol.simulation.held_gains import feedbacks, longest_period, plan_kick
from pathcontrol.simulation.modes import MOST_SUBSTEPS, Arm, ContinuousTime, SampledLoop
from pathcontrol.tasks.base import PathTask
from pathcontrol.tasks.batch import TaskBatch

_SAMPLES, _FINE = 9, 65  # of a path, where the arm and where the plan is looked at
_TASKS = 4  # of a batch that are looked at
_SLOW = 1.0  # h times a rate of growth or decay up to which a step resolves it
_OSCILLATION = 0.3  # h ω up to which the midpoint rule resolves an oscillation, to 1.5 % of ω
_SPRING = 0.05  # h ω that is advised for a spring that is held over a step, which feeds it with energy at hω²/4


def warn_of_steps(
    controllers: Sequence[Controller],
    loop: SampledLoop | ContinuousTime,
    robot: Arm,
    q: Array,
    qd: Array,
    disturbance: Disturbance | None,
    duration: float,
) -> str:
    """Warn of a period that is too long for the gains, and of steps of the plant that are too long for what is fast.

    It is an estimate of linear systems at some postures, for exact sensors without a delay and no limits of torque.

    Args:
        controllers: the laws, one after the other.
        loop: how the loop is closed; continuous time finds its steps itself.
        robot: the arm, or one for each rollout, of which the first is looked at.
        q: joint positions at the start [rad], (N, n).
        qd: joint velocities at the start [rad/s], (N, n).
        disturbance: what else pushes the arm.
        duration: how long [s].

    Returns:
        What was told, or nothing: if the arm diverges, that is why.
    """
    if not isinstance(loop, SampledLoop):
        return ""
    arm = robot.robots[0] if isinstance(robot, RobotBatch) else robot
    if not arm.has_mass:
        return ""
    told = list(dict.fromkeys(_all(controllers, loop, arm, q, qd, disturbance, duration)))
    for sentence in told:
        warnings.warn(sentence, PathControlWarning, stacklevel=3)
    return "; ".join(told)


def _all(
    controllers: Sequence[Controller],
    loop: SampledLoop,
    arm: RobotModel,
    q: Array,
    qd: Array,
    disturbance: Disturbance | None,
    duration: float,
) -> Iterator[str]:
    felt = with_damping(arm, loop.period / loop.substeps)
    for law in controllers:
        postures, speeds = _states(law.task, q, qd)
        yield from _of_gains(law, loop.period, arm, postures)
        yield from _of_plan(law, loop.period)
        yield from _of_arm(loop, felt, postures, speeds)
    if disturbance is not None:
        yield from _of_disturbance(disturbance, loop, felt, q, qd, duration)


def _states(task: PathTask, q: Array, qd: Array) -> tuple[Array, Array]:
    """The first start and some states on the path, (k, n) each."""
    states = [(q[:1], qd[:1])]
    for one in _some(task):
        point = one.at(np.linspace(*one.sampled_interval, _SAMPLES))
        states.append((point.q_d, point.velocity))
    postures, speeds = zip(*states, strict=True)
    return np.concatenate(postures), np.concatenate(speeds)


def _some(task: PathTask) -> Iterable[PathTask]:
    return list(task)[:_TASKS] if isinstance(task, TaskBatch) else [task]


def _of_gains(law: Controller, period: float, arm: RobotModel, q: Array) -> Iterator[str]:
    """The period is too long for the gains."""
    left = np.atleast_2d(arm.friction.viscous)[0] - np.atleast_2d(law.compensated)[0]
    longest = min((longest_period(one, arm, left, q, period) for one in feedbacks(law, q)), default=np.inf)
    if period < longest:
        return
    gains = " and ".join(f"{name} up to {np.max(getattr(law, name)):g}" for name in law.gains if name != "k")
    torques = isinstance(law, PDPlus | SlotineLi)
    remedy = "K over inertia times h is below 2" if torques else "K_v h < 2 and K_p h < 2 K_v"
    yield (
        f"gains {gains} of {type(law).__name__} need a period below {longest:.3g} s, the loop has {period:g} s and is "
        f"likely to be unstable; shorten the period (more substeps do not help), or lower the gains so that {remedy}"
    )


def _of_plan(law: Controller, period: float) -> Iterator[str]:
    """The period is too long for the gain k of the plan."""
    if not isinstance(law, ExtendedMotionPlan):
        return
    kick = max(plan_kick(one, np.linspace(*one.sampled_interval, _FINE)) for one in _some(law.task)) * float(
        law.k.max()
    )
    if kick * period**2 >= 1:
        k = float(np.max(law.k))
        yield (
            f"k = {k:g} needs a period below {kick**-0.5:.3g} s, the loop has {period:g} s and is probably unstable "
            f"without torque limits; take k below {k / (kick * period**2):.3g}, or Projection, which is k → ∞, or "
            "shorten the period (more substeps do not help)"
        )


def _of_arm(loop: SampledLoop, arm: RobotModel, q: Array, qd: Array) -> Iterator[str]:
    """The step is too long for the arm itself."""
    rate = rate_of_arm(arm, q, qd)
    yield from _too_long(loop, rate, _OSCILLATION, "the arm under gravity at the speed of the task")
    rate, joint = rate_of_friction(arm, q)
    yield from _too_long(loop, rate, _SLOW, f"the Stribeck friction of {arm.joint_names[joint]}, which falls so fast")


def _of_disturbance(
    disturbance: Disturbance, loop: SampledLoop, arm: RobotModel, q: Array, qd: Array, duration: float
) -> Iterator[str]:
    """The step is too long for a disturbance that depends on the state, and is held over it."""
    name = f"the disturbance {type(disturbance).__name__}".replace(" _Sum", "")
    damping, oscillation = rates_of_disturbance(disturbance, arm, q, qd, duration)
    yield from _too_long(loop, damping, _SLOW, f"{name}, which damps the arm but is held over a step and so rings")
    if oscillation * loop.period / loop.substeps > _OSCILLATION:
        yield from _too_long(loop, oscillation, _SPRING, f"{name}, a spring that is held over a step")


def _too_long(loop: SampledLoop, rate: float, bound: float, what: str) -> Iterator[str]:
    """The sentence that a step is too long for a ``rate`` [1/s], with how many would do."""
    step = loop.period / loop.substeps
    if rate * step <= bound:
        return
    substeps = ceil(loop.period * rate / bound)
    remedy = f"take substeps={substeps}" if substeps <= MOST_SUBSTEPS else "make it less stiff, or shorten the period"
    yield (
        f"steps of {1e3 * step:.3g} ms are too long for {what}: its fastest mode has {rate:.3g} 1/s; {remedy} "
        f"(SampledLoop has {loop.substeps} in a period of {loop.period:g} s)"
    )
