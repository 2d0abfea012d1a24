"""The arguments of a simulation: checks and conversions before it starts."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array, check_finite
from pathcontrol._expect import expect
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.control.law_gains import count_gain_rows
from pathcontrol.control.wrappers.wrapper import LawWrapper, unwrap
from pathcontrol.errors import InputError, PathControlError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import levels_of, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Disturbance
from pathcontrol.simulation.checks.override_form import warn_of_override
from pathcontrol.simulation.loops import Arm, ContinuousTime, SampledLoop
from pathcontrol.simulation.summaries import summarize
from pathcontrol.simulation.variables import bytes_of_sample
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

Loop = SampledLoop | ContinuousTime


def check_loop(loop: Loop | None) -> Loop:
    """Check the kind of loop; return it, or ``SampledLoop()`` if it is None."""
    loop = SampledLoop() if loop is None else loop
    if not isinstance(loop, SampledLoop | ContinuousTime):
        raise InputError(
            f"loop = {loop!r}, expected SampledLoop(...) or ContinuousTime(...)", argument="loop", value=loop
        )
    return loop


def sample_period(loop: Loop, duration: float) -> float:
    """Return the time between samples [s]; ``duration`` [s] must hold at least one."""
    period = loop.period if isinstance(loop, SampledLoop) else loop.output_period
    if duration < period:
        raise InputError(
            f"duration = {duration:g} s is less than one period of {period:g} s; both are in seconds",
            argument="duration",
            value=duration,
            limit=period,
        )
    return period


def check_length(duration: float, loop: Loop, rollouts: int, joints: int, ends: bool) -> None:
    """Check that the record fits into memory, before room is made for it.

    A run that ``ends`` by itself in a sampled loop may be given any time that can be counted in periods.

    Raises:
        InputError: it does not.
    """
    sampled = isinstance(loop, SampledLoop)
    name, period = ("period", loop.period) if isinstance(loop, SampledLoop) else ("output_period", loop.output_period)
    if isinstance(loop, SampledLoop) and loop.delay > duration:
        raise InputError(
            f"delay = {loop.delay:g} s, expected at most duration = {duration:g} s; both are in seconds",
            argument="delay",
            value=loop.delay,
            limit=duration,
        )
    needed, most = duration / period * rollouts * bytes_of_sample(joints), _memory()
    if needed <= most or (ends and sampled and duration / period < 2**53):
        return
    raise InputError(
        f"duration = {duration:g} s with {name} = {period:g} s makes {duration / period:.3g} samples of {rollouts} "
        f"rollouts, {needed / 1e9:.3g} GB, but this machine has {most / 1e9:.3g} GB; shorten duration, lengthen {name}"
        + (", or take fewer rollouts at a time" if rollouts > 1 else ""),
        argument="duration",
        value=duration,
    )


def _memory() -> int:
    """Return the bytes of memory of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def make_plant(plant: RobotModel | Sequence[RobotModel] | None, controller: Controller) -> Arm:
    """Return the simulated arm: the given one, the controller's own, or a batch with one for each rollout."""
    if plant is not None and not isinstance(plant, Iterable):
        expect("plant", plant, RobotModel, also=", or one for each rollout")
    plants = [controller.robot] if plant is None else [plant] if isinstance(plant, RobotModel) else list(plant)
    for i, robot in enumerate(plants):
        if not isinstance(robot, RobotModel):
            raise InputError(
                f"plant[{i}] = {robot!r}, expected a RobotModel, or one for each rollout",
                argument=f"plant[{i}]",
                value=robot,
            )
    if not plants:
        raise InputError(
            "plant is an empty list, expected a RobotModel, or one for each rollout", argument="plant", value=[]
        )
    first = plants[0]
    rows = _count_friction_rows(first) if len(plants) == 1 else None
    if rows is not None:
        return RobotBatch([first] * rows, first.friction)
    return first if len(plants) == 1 else RobotBatch(plants)


def _count_friction_rows(robot: RobotModel) -> int | None:
    """Return the number of rollouts for which a robot has friction coefficients; ``None`` if all have the same."""
    law = robot.friction
    arrays = np.broadcast_arrays(viscous_of(law), *levels_of(law, np.zeros(robot.n)))
    return len(arrays[0]) if arrays[0].ndim > 1 else None


def check_joints(controller: Controller, robot: Arm) -> None:
    """Check that the controller has the joints of the plant."""
    if robot.joint_names != controller.robot.joint_names:
        raise InputError(
            f"the plant has the joints {robot.joint_names}, the controller's model {controller.robot.joint_names}",
            argument="plant",
            value=list(robot.joint_names),
        )


def initial_state(
    q: ArrayLike, qd: ArrayLike | None, joints: Sequence[str], rollouts: int | None = None
) -> tuple[Array, Array]:
    """Return q and q̇ as (N, n) each, broadcast against each other; one state serves all ``rollouts``."""
    n = len(joints)
    position = check_finite("q", as_joint_array("q", q, n, joints))
    if not position.size:
        raise InputError(f"q has shape {position.shape}, expected one initial state at least", argument="q", value=q)
    velocity = np.zeros(n) if qd is None else check_finite("qd", as_joint_array("qd", qd, n, joints))
    try:
        pair = np.broadcast_arrays(position, velocity)
    except ValueError as error:
        raise InputError(
            f"q has shape {position.shape} and qd {velocity.shape}, which do not fit together", argument="qd", value=qd
        ) from error
    q0, qd0 = (np.array(a).reshape(-1, n) for a in pair)
    if rollouts is not None and len(q0) == 1:
        return q0.repeat(rollouts, axis=0), qd0.repeat(rollouts, axis=0)
    return q0, qd0


def broadcast_states(q: ArrayLike, qd: ArrayLike | None, robot: Arm, task: PathTask) -> tuple[Array, Array]:
    """Return q and q̇ as (N, n) each, one state serving all rollouts; N is also that of arms and tasks.

    Raises:
        InputError: there are not as many of each.
    """
    counts = {"plant has {} arms": len(robot)} if isinstance(robot, RobotBatch) else {}
    if isinstance(task, TaskBatch):
        counts["the controller's TaskBatch has {} tasks"] = len(task)
    _check_equal(counts)
    q0, qd0 = initial_state(q, qd, robot.joint_names, next(iter(counts.values()), None))
    _check_equal(counts | {"q and qd are {} initial states": len(q0)})
    return q0, qd0


def _check_equal(counts: Mapping[str, int]) -> None:
    """Check that all counts are the same."""
    if len(set(counts.values())) > 1:
        raise InputError(
            ", ".join(said.format(count) for said, count in counts.items()) + "; expected as many",
            value=list(counts.values()),
        )


def start_law(
    controller: Controller, q: Array, qd: Array, disturbance: Disturbance | None
) -> tuple[Array, Array, Array]:
    """Return q, q̇ and the law's state z at the start, (N, …) each.

    One initial state is repeated for each row of gains or of the disturbance.

    Raises:
        InputError: the law fails there, or does not give what :class:`ControlOutput` says.
    """
    q, qd, z = _start_rows(controller, q, qd)
    if len(q) == 1 and len(z) > 1:  # an observer or a wrapper with rows
        if disturbance is None or _count_rows(_first_torque(disturbance, q, qd)) == 1:
            warn_of_override(controller)
        q, qd = q.repeat(len(z), axis=0), qd.repeat(len(z), axis=0)
    out = _call_law(controller, q, controller.law, 0.0, q, qd, z)
    if len(q) == 1:
        pushed = None if disturbance is None else _first_torque(disturbance, q, qd)
        rows = max(_count_rows(getattr(out, "tau", None)), _count_rows(pushed))
        q, qd = q.repeat(rows, axis=0), qd.repeat(rows, axis=0)
        z = z if len(z) == rows else np.repeat(z, rows, axis=0)
        out = out if rows == 1 else _call_law(controller, q, controller.law, 0.0, q, qd, z)
    _check_output(controller, out, q, z)
    return q, qd, z


def _start_rows(controller: Controller, q: Array, qd: Array) -> tuple[Array, Array, Array]:
    """Return q, q̇ and the law's state z at the start, for each row of gains where the law takes no other number."""
    try:
        z = _call_law(controller, q, controller.start, q, qd)
        rows = len(z) if len(q) == 1 and np.ndim(z) == 2 else 1  # those of an observer or a wrapper
        _call_law(controller, q, controller.law, 0.0, q.repeat(rows, axis=0), qd.repeat(rows, axis=0), z)
    except InputError:
        counts = set(count_gain_rows(controller).values())
        if len(q) > 1 or len(counts) != 1:
            raise
        (several,) = counts
        q, qd = q.repeat(several, axis=0), qd.repeat(several, axis=0)
        z = _call_law(controller, q, controller.start, q, qd)
    return q, qd, z


def _first_torque(disturbance: Any, q: Array, qd: Array) -> Any:
    """Return the torque of a disturbance at the start, or None where it fails; a later check reports the failure."""
    try:
        return disturbance.torque(0.0, q, qd)
    except Exception:  # code of the user
        return None


def _count_rows(torque: Any) -> int:
    """Return the number of rows of a torque (N, n), or 1 where it is something else, which later checks report."""
    try:
        shape = np.shape(torque)
    except ValueError:  # lists of different lengths
        return 1
    return max(1, shape[0]) if len(shape) == 2 else 1


def check_law(controller: Controller, q: Array, qd: Array) -> None:
    """Check what the law returns at the initial states, (N, n) each, of as many rollouts.

    Raises:
        InputError: the law fails there, or does not give what :class:`ControlOutput` says.
    """
    z = _call_law(controller, q, controller.start, q, qd)
    _check_output(controller, _call_law(controller, q, controller.law, 0.0, q, qd, z), q, z)


def _check_output(controller: Controller, out: Any, q: Array, z: Array) -> None:
    """Check that a law returned a :class:`ControlOutput` whose shapes fit the initial states, with finite numbers."""
    name = _name_law(controller)
    if not isinstance(out, ControlOutput):
        raise InputError(f"{name}.law returns {type(out).__name__}, expected a ControlOutput", value=out)
    if controller.observer is not None and out.observation is None:
        raise InputError(
            f"{type(unwrap(controller)).__name__}.law does not compensate what its observer estimates; end it with "
            "return self.compensate(t, q, qd, z, ControlOutput(...))"
        )
    wanted = {"tau": q.shape, "e_p": q.shape, "e_v": q.shape, "zdot": np.shape(z)}
    for field in ControlOutput._fields[:-1]:
        shape, value = wanted.get(field, q.shape[:1]), getattr(out, field)
        if np.shape(value) != shape:
            raise InputError(
                _explain_rows(controller, len(q))
                or f"{name}.law gives {field} of shape {np.shape(value)} for initial states of shape {q.shape}, "
                f"expected {shape}",
                value=value,
            )
        sound = np.isfinite(np.reshape(value, (len(q), -1))).all(-1)
        if not sound.any():  # if only some are not finite, those rollouts diverge
            raise InputError(
                f"{name}.law gives {field} = {np.asarray(value).tolist()} at the start, expected numbers", value=value
            )


def _call_law(controller: Controller, q: Array, function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a method of the law at the initial states; turn its failure into an InputError."""
    try:
        return function(*arguments)
    except (ValueError, IndexError, TypeError) as error:
        if isinstance(error, PathControlError):
            raise
        raise InputError(_explain_rows(controller, len(q)) or _explain(controller, q, error)) from error


def _explain(controller: Controller, q: Array, error: Exception) -> str:
    """Return what an error says of a law that fails."""
    return f"{_name_law(controller)}.law fails at the initial states, of shape {q.shape}: {error}"


def _explain_rows(controller: Controller, rollouts: int) -> str:
    """Return what an error says of gains that have rows for another number of rollouts; empty if all fit."""
    wrong = {name: rows for name, rows in count_gain_rows(controller).items() if rows != rollouts}
    if not wrong:
        return ""
    shapes = " and ".join(f"{name} of shape {np.shape(getattr(unwrap(controller), name))}" for name in wrong)
    counts = list(dict.fromkeys(wrong.values()))
    expected = f"a row for each of {rollouts} rollouts" if rollouts > 1 else "the gains of one rollout"
    expected = expected if len(counts) == 1 else "as many rows of each"
    more = f"; give {counts[0]} initial states, or one" if rollouts > 1 and len(counts) == 1 else ""
    return f"{_name_law(controller)} has {shapes}, expected {expected}, or one value for all{more}"


def _name_law(controller: Controller) -> str:
    """Return the class of a law, of a wrapper with those inside: ``SpeedOverride(Projection)``."""
    name = type(controller).__name__
    return f"{name}({_name_law(controller.wrapped)})" if isinstance(controller, LawWrapper) else name


def make_config(
    controller: Mapping[str, Any], robot: Arm, loop: Loop, disturbance: Disturbance | None, **settings: Any
) -> dict[str, Any]:
    """Return the configuration of a run; large arrays are given by shape and range."""
    plant = {"robot": robot.name, "friction": summarize(robot.friction.describe())}
    if isinstance(robot, RobotBatch):
        plant |= {"arms": len(robot), "rigid_bodies": len(robot.bodies)}
    whole = ("task", "sequence")
    return {
        "controller": {name: value if name in whole else summarize(value) for name, value in controller.items()},
        "plant": plant,
        "loop": summarize(loop.describe()),
        **({} if disturbance is None else {"disturbance": summarize(disturbance.describe())}),
        **settings,
        "versions": name_versions(),
    }


def name_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results depend on, for the configuration of a run."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results depend on; reading them takes milliseconds."""
    packages = ("pathcontrol", "pin", "numpy", "scipy")
    return {"python": platform.python_version()} | {name: version(name) for name in packages}


def map_position_units(robot: Arm) -> dict[str, str]:
    """Return the unit of each joint's position by the joint's name."""
    return dict(zip(robot.joint_names, robot.position_units, strict=True))
