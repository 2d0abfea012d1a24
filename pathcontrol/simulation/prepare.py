"""The last step before the first tick, the same for one path and for a sequence: warnings, checks, the engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.simulation.arm.disturbance import Disturbance, check_disturbance
from pathcontrol.simulation.checks.disturbance_loop import check_loop
from pathcontrol.simulation.checks.frames import check_frames, warn_of_fixed_frames
from pathcontrol.simulation.checks.friction_knowledge import warn_of_unknown_friction
from pathcontrol.simulation.checks.idle_times import warn_of_idle_times
from pathcontrol.simulation.checks.slips import warn_of_idle_changes, warn_of_slips, warn_of_walls
from pathcontrol.simulation.checks.too_long import warn_of_steps
from pathcontrol.simulation.engines import Engine, choose_engine
from pathcontrol.simulation.loops import Arm, Outside
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
        InputError: the disturbance fails at the initial states, does what the loop cannot do, or names a frame that is
            elsewhere on another arm.
        UnknownNameError: it names a joint or a frame that an arm does not have.
    """
    disturbance, first = _find_names(outside.disturbance, robot), outside.first
    slip = warn_of_slips(robot, task, q, first)
    check_disturbance(disturbance, q, qd)
    check_loop(disturbance, loop, q)
    warn_of_idle_changes(robot, loop, disturbance, first)
    warn_of_fixed_frames(disturbance, robot, first)
    warn_of_idle_times(disturbance, loop, duration, first)
    warn_of_walls(disturbance, q, first)
    warn_of_unknown_friction(controllers, robot, first)
    arm, said = choose_engine(engine, controllers, loop, robot, q, qd, Outside(disturbance, first))
    slow = "" if first else warn_of_steps(controllers, loop, robot, q, qd, disturbance, duration)
    return Prepared(arm, said, slip or slow)


def _find_names(disturbance: Any, robot: Arm) -> Any:
    """Return the disturbance with the joints that it names found in the arm; what is none is left to the check."""
    if not isinstance(disturbance, Disturbance):
        return disturbance
    found = disturbance.find_names(robot.robots[0] if isinstance(robot, RobotBatch) else robot)
    if isinstance(robot, RobotBatch):
        check_frames(found, robot)
    return found
