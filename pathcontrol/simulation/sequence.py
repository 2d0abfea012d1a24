"""The simulation of several paths of one arm, one after another, as one :class:`Run`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_finite
from pathcontrol._expect import describe
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.acting_limits import record_limits
from pathcontrol.simulation.arm.disturbance import Disturbance
from pathcontrol.simulation.divergence import Divergence
from pathcontrol.simulation.engines import Engine, check_engine
from pathcontrol.simulation.finish import Finish, make_finish
from pathcontrol.simulation.loops import ContinuousTime, Outside, SampledLoop
from pathcontrol.simulation.prepare import prepare
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.run_arguments import (
    check_joints,
    check_law,
    check_length,
    check_loop,
    initial_state,
    make_config,
    make_plant,
    map_position_units,
    sample_period,
)
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.laps import Laps
from pathcontrol.tasks.task import PathTask


class _PathRecord(NamedTuple):
    """The record of one path.

    Attributes:
        arrays: its samples.
        finish_time: the time after its begin at which it finished [s].
        s0: its first s.
        length: the growth of s.
        said: what its law has to say of it, see :meth:`Controller.outcome`.
    """

    arrays: dict[str, Array]
    finish_time: float
    s0: float
    length: float
    said: dict[str, Array]


def simulate_sequence(
    controllers: Iterable[Controller],
    q: ArrayLike,
    qd: ArrayLike | None = None,
    *,
    duration: ArrayLike,
    laps: int = 1,
    gaps: bool = False,
    task: PathSequence | None = None,
    plant: RobotModel | None = None,
    loop: SampledLoop | ContinuousTime | None = None,
    disturbance: Disturbance | None = None,
    engine: Engine = "auto",
    progress: bool = True,
) -> Run:
    """Simulate several paths of one arm, each from where the arm is when the one before is finished.

    Finished is as for :func:`simulate`: an open path when the arm rests at its end, a closed one after ``laps``. Each
    path has a controller of its own, which is told the time since its begin; sensors, filters and delayed torques go
    on across the seams, and the sample at a seam belongs to the path that begins there. A path that is not finished
    within its duration ends the run.

    Its s goes on: path i begins at S_i, where the one before it ends, as in a :class:`PathSequence` of them.
    The run has the coordinates ``path_index`` (time), and ``path_status`` and ``path_finish_time`` (path);
    :meth:`Run.path` gives one path as a run of its own. Its rollout is finished when the last path is.

    Args:
        controllers: one controller for each path, in order, all for the joints of one arm.
        q: initial joint positions [rad], (n,): of one arm, not of a batch.
        qd: initial joint velocities [rad/s], (n,); default at rest.
        duration: longest time for each path [s]: one for all, or one for each, (paths,).
        laps: how many times each closed path is gone round.
        gaps: whether a path may begin elsewhere than where the one before it ends, so that the arm goes there as its
            law does from any start; without it such paths are refused.
        task: the whole that the controllers' tasks are the paths of, such as a :class:`ToolpathTask`: the run knows it
            then, with all that it says beside the paths; default a :class:`PathSequence` of these tasks.
        plant: the simulated arm; default the model of the first controller.
        loop: how the loop is closed, as for :func:`simulate`.
        disturbance: a disturbance of the arm, such as :class:`Push`, or a sum; its time counts from the start.
        engine: as for :func:`simulate`, one for all paths.
        progress: show a bar on standard error when it takes longer than two seconds.

    Raises:
        EngineError: the engine is to be the compiled one, and something of the run is beyond it.
        InputError: an argument has the wrong shape or value, a path neither ends nor repeats, or one does not begin
            where the one before it ends and ``gaps`` are not allowed.
        SimulationError: the arm diverged; ``run`` of the error holds what happened until then.
    """
    check_engine(engine)
    laws = _check_controllers(controllers)
    robot = make_plant(plant, laws[0])
    if not isinstance(robot, RobotModel):
        raise InputError(
            "plant is one arm for each rollout, expected one: a sequence has a single rollout",
            argument="plant",
            value=plant,
        )
    durations, loop = _check_durations(duration, len(laws)), check_loop(loop)
    q0, qd0 = _check_state(q, qd, robot.joint_names)
    period, ends = sample_period(loop, durations.min()), [_make_finish(law, laps) for law in laws]
    check_length(float(durations.sum()), loop, 1, robot.n, ends=True)
    whole = _make_sequence(laws, laps, gaps) if task is None else _check_sequence(task, laws, laps)
    for law in laws:
        check_joints(law, robot)
        check_law(law, q0, qd0)
    ready = prepare(laws, whole, robot, loop, q0, qd0, Outside(disturbance), float(durations.sum()), engine)
    arm, legs = ready.arm, []
    for law, longest, finish in zip(laws, durations, ends, strict=True):
        arrays = arm.run(law, longest, finish, progress)
        length = _length(law.task, laps)
        legs.append(_PathRecord(arrays, float(finish.time[0]), law.task.s0, length, arm.law_outcome))
        if arm.divergence.any or np.isnan(legs[-1].finish_time):
            break
    arm.divergence.explain(ready.advice)
    arrays, outcome = _join(legs, len(laws), period, arm.divergence)
    names = ", ".join(dict.fromkeys(type(law).__name__ for law in laws))
    paths = f"{len(laws)} path{'s' if len(laws) > 1 else ''}"
    described = {"controller": f"{paths} with {names}", "sequence": [law.describe() for law in laws]}
    config = make_config(described, robot, loop, disturbance, duration=durations.tolist(), laps=laps, **ready.engine)
    time = period * np.arange(arrays["s"].shape[1])
    arrays = arrays | record_limits(arrays, time, loop, robot, disturbance)
    run = Run.from_arrays(
        time, map_position_units(robot), arrays, config, outcome, robot=robot, task=whole, model=laws[0].robot
    )
    arm.divergence.check(run)
    return run


def _join(
    legs: Sequence[_PathRecord], paths: int, period: float, lost: Divergence
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Join the paths to one series of samples, (1, time, …), and its outcome."""
    kept = [leg.arrays["s"].shape[1] - 1 for leg in legs]
    kept[-1] += 1
    arrays = {
        name: np.concatenate([leg.arrays[name][:, :samples] for leg, samples in zip(legs, kept, strict=True)], axis=1)
        for name in legs[0].arrays
    }
    offsets = np.concatenate([[0.0], np.cumsum([leg.length for leg in legs])[:-1]]) - [leg.s0 for leg in legs]
    arrays["s"] = arrays["s"] + np.repeat(offsets, kept)
    begins = period * np.cumsum([0, *kept[:-1]])
    times, status = np.full(paths, np.nan), np.full(paths, "waiting", dtype="<U8")
    times[: len(legs)] = begins + [leg.finish_time for leg in legs]
    status[: len(legs)] = np.where(np.isnan(times[: len(legs)]), "running", "finished")
    lost.time += begins[-1]
    if lost.any:
        status[len(legs) - 1] = "diverged"
    return arrays, lost.outcome() | _join_outcomes(legs, begins) | {
        "finish_time": times[-1:],
        "path_index": np.repeat(np.arange(len(legs)), kept),
        "path_status": status,
        "path_finish_time": times,
        "path_offset": np.append(offsets, np.full(paths - len(legs), np.nan)),
    }


def _join_outcomes(legs: Sequence[_PathRecord], begins: Array) -> dict[str, Array]:
    """Return what the laws have to say of paths that begin at some times [s], as one outcome of the whole."""
    said = [(leg.said, begin) for leg, begin in zip(legs, begins, strict=True) if "forgotten" in leg.said]
    if not said:
        return {}
    times = np.array([one["forgotten_time"] + begin for one, begin in said])
    known = times[np.isfinite(times)]
    return {
        "forgotten": np.sum([one["forgotten"] for one, _ in said], axis=0),
        "forgotten_time": np.array([known.max() if known.size else np.nan]),
    }


def _length(task: PathTask, laps: int) -> float:
    """Return by how much s grows on a path."""
    return task.s_end - task.s0 if task.period is None else laps * task.period


def _check_controllers(controllers: Iterable[Controller]) -> list[Controller]:
    """Check that there is at least one controller, each with a single task; return them as a list."""
    laws = list(controllers) if isinstance(controllers, Iterable) else []
    if not laws or isinstance(controllers, str | PathTask):
        raise InputError(
            f"controllers {describe(controllers)}, expected a list with one controller for each path",
            argument="controllers",
            value=controllers,
        )
    for i, law in enumerate(laws):
        check_controller(f"controllers[{i}]", law)
        refuse_batch(f"the task of controllers[{i}]", law.task, f"controllers[{i}]")
    return laws


def _make_sequence(laws: Sequence[Controller], laps: int, gaps: bool) -> PathSequence:
    """Return the tasks in a sequence, as the run joins them."""
    return PathSequence([Laps(law.task, laps) if law.task.closed else law.task for law in laws], gaps=gaps)


def _check_sequence(task: PathSequence, laws: Sequence[Controller], laps: int) -> PathSequence:
    """Check that the paths of the given sequence are the tasks of the laws; return it."""
    if not isinstance(task, PathSequence) or len(task) != len(laws):
        raise InputError(
            f"task = {task!r}, expected a PathSequence, such as a ToolpathTask, of {len(laws)} paths",
            argument="task",
            value=task,
        )
    for i, (path, law) in enumerate(zip(task, laws, strict=True)):
        length = _length(law.task, laps)
        if path.s0 != law.task.s0 or not np.isclose(path.s_end - path.s0, length, rtol=1e-12, atol=0.0):
            raise InputError(
                f"the task of controllers[{i}] goes from s = {law.task.s0:g} on by {length:g}, path {i} of the whole "
                f"from {path.s0:g} by {path.s_end - path.s0:g}; give the task whose paths the controllers follow",
                argument=f"controllers[{i}]",
                value=law,
            )
    return task


def _make_finish(law: Controller, laps: int) -> Finish:
    """Return the rule by which the path of a law finishes."""
    finish = make_finish(law.task, laps if law.task.closed else None, "end", 1)
    if finish is None:
        raise InputError(
            f"{law.task!r} neither ends nor repeats, so no path can follow it; give it an s_end", value=law.task
        )
    return finish


def _check_durations(duration: ArrayLike, paths: int) -> Array:
    """Check the durations; return one for each path, (paths,)."""
    durations = check_finite("duration", as_array("duration", duration))
    if durations.shape not in ((), (paths,)):
        raise InputError(
            f"duration has shape {durations.shape}, expected one number or one for each of {paths} paths",
            argument="duration",
            value=duration,
        )
    if (durations <= 0).any():
        raise InputError(
            f"duration = {durations.tolist()}, expected numbers greater than 0",
            argument="duration",
            value=duration,
            limit=0.0,
        )
    return np.broadcast_to(durations, (paths,))


def _check_state(q: ArrayLike, qd: ArrayLike | None, joints: Sequence[str]) -> tuple[Array, Array]:
    """Check that there is one initial state; return it as (1, n) each."""
    q0, qd0 = initial_state(q, qd, joints)
    if len(q0) != 1:
        raise InputError(
            f"q and qd are {len(q0)} initial states, expected one: rollouts would not end their paths together; call "
            "simulate_sequence once for each",
            argument="q",
            value=q,
        )
    return q0, qd0
