"""The last step before the first tick, the same for one path and for a sequence: warnings, checks, the engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.errors import InputError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.simulation.arm.disturbance import Disturbance, check_disturbance, list_terms
from pathcontrol.simulation.arm.dropout import Dropout
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.checks.slips import warn_of_idle_changes, warn_of_slips, warn_of_walls
from pathcontrol.simulation.checks.too_long import warn_of_steps
from pathcontrol.simulation.engines import Engine, choose_engine
from pathcontrol.simulation.loops import Arm, Outside, SampledLoop
from pathcontrol.simulation.run_arguments import Loop
from pathcontrol.tasks.task import PathTask


class Prepared(NamedTuple):
    """A simulation that is ready to run.

    Attributes:
        arm: the simulated arm with its loop, in the engine that was chosen.
        engine: the entries of a run's configuration that say which engine it is, and why.
        advice: the likely reason, should a rollout diverge; empty where there is none.
    """

    arm: Any
    engine: dict[str, Any]
    advice: str


def prepare(
    controllers: Sequence[Controller],
    task: PathTask,
    robot: Arm,
    loop: Loop,
    q: Array,
    qd: Array,
    outside: Outside,
    duration: float,
    engine: Engine,
) -> Prepared:
    """Warn of likely slips, check the disturbance and choose the engine of a simulation.

    Args:
        controllers: the laws, one path after another; they have been asked once at the start.
        task: the whole that they follow.
        robot: the simulated arm, or arms.
        loop: how the loop is closed.
        q: initial joint positions [rad], (N, n).
        qd: initial joint velocities [rad/s], (N, n).
        outside: the disturbance and the number of the first rollout; of a later part of a larger batch warnings of
            steps have been given with the first.
        duration: the whole time [s].
        engine: the requested engine.

    Raises:
        EngineError: the engine is to be the compiled one, and something of the simulation is beyond it.
        InputError: the disturbance fails at the initial states, or does what the loop cannot do.
        UnknownNameError: it names a joint that the arm does not have.
    """
    disturbance, first = _find_names(outside.disturbance, robot), outside.first
    slip = warn_of_slips(robot, task, q, first)
    check_disturbance(disturbance, q, qd)
    _check_loop(disturbance, loop, q)
    warn_of_idle_changes(robot, disturbance)
    warn_of_walls(disturbance, q, first)
    arm, said = choose_engine(engine, controllers, loop, robot, q, qd, Outside(disturbance, first))
    slow = "" if first else warn_of_steps(controllers, loop, robot, q, qd, disturbance, duration)
    return Prepared(arm, said, slip or slow)


def _find_names(disturbance: Any, robot: Arm) -> Any:
    """Return the disturbance with the joints that it names found in the arm; what is none is left to the check."""
    arm = robot.robots[0] if isinstance(robot, RobotBatch) else robot
    return disturbance.find_names(arm) if isinstance(disturbance, Disturbance) else disturbance


def _check_loop(disturbance: Disturbance | None, loop: Loop, q: Array) -> None:
    """Check that the loop can do what a disturbance does beside pushing."""
    if disturbance is None:
        return
    if isinstance(loop, SampledLoop):
        if disturbance.torque_factor(0.0) is not None and loop.torque_limits is False:
            raise InputError("TorqueLimitDrop lowers torque limits, and the loop has none: give torque_limits=True")
        return
    for term in list_terms(disturbance):
        if what := _do_at_once(term, q):
            raise InputError(f"{what}, which continuous time cannot do; give loop=SampledLoop(...)")


def _do_at_once(term: Disturbance, q: Array) -> str:
    """Return in words what a disturbance does that only a sampled loop can do; an empty text if it only pushes."""
    if term.held_joints(0.0, q) is not None:
        return "a joint that jams stops at once"
    if term.torque_factor(0.0) is not None:
        return "torque limits drop at once"
    if isinstance(term, Dropout):
        return "a Dropout loses ticks or measurements"
    if isinstance(term, Wall):
        return "a Wall stops the arm at once"
    return f"{type(term).__name__} changes the arm at once" if term.arm_change_times.size else ""
