"""Disturbances: torques on the joints and forces on the frames of the arm, over time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import reduce
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array, check_finite, freeze
from pathcontrol._expect import expect
from pathcontrol.arguments import Form, Torques, Unit
from pathcontrol.errors import InputError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.summaries import summarize
from pathcontrol.tasks.profile import plain_attributes

Begin = Annotated[ArrayLike, Form.NUMBER, Unit("s")]
Span = Annotated[ArrayLike, Form.POSITIVE_OR_INF, Unit("s")]
Frequency = Annotated[ArrayLike, Form.NUMBER, Unit("Hz")]
Phase = Annotated[ArrayLike, Form.NUMBER, Unit("rad")]


class Disturbance(ABC):
    """Torques on the joints that no controller knows of; disturbances add up with ``+``.

    The sampled loop holds a disturbance over each step of the plant, at its value in the middle of the step; so a push
    is as long as the steps whose middle it covers. Torque limits are those of the motors and do not limit it. Before a
    run it is evaluated at some times and states, to check its shape and the length of the step.
    """

    @abstractmethod
    def torque(self, t: float, q: Array, qd: Array) -> Array:
        """Return the torques [N m] on the joints at t [s], with the arms at (q, q̇), (N, n); broadcasts to (N, n)."""

    @property
    def jumps(self) -> Array:
        """The times [s] at which it jumps, (k,); continuous time is integrated from one to the next."""
        return np.empty(0)

    def held_joints(self, t: float, q: Array) -> NDArray[np.bool_] | None:
        """Return which joints are held still at t [s], broadcasts to the shape of q (N, n); ``None`` for none."""
        return None

    def torque_factor(self, t: float) -> Array | None:
        """Return the share of its torque limit that each motor has at t [s], broadcasts to (N, n); ``None`` for all."""
        return None

    @property
    def arm_change_times(self) -> Array:
        """The times [s] at which it changes the arm itself, (k,), in any order; none by default."""
        return np.empty(0)

    def change_arm(self, t: float, arm: RobotModel | RobotBatch) -> RobotModel | RobotBatch:
        """Return what it makes of the arm, or of the arms of all rollouts, at t [s]; the arm itself by default."""
        return arm

    def strike(self, before: float, now: float, q: Array, qd: Array) -> Array | None:
        """Return the impulse [N m s] of a change of the arm between two times, (N, n); ``None`` where there is none."""
        return None

    def find_names(self, robot: RobotModel) -> Disturbance:
        """Return the disturbance with the joints and frames that it names found in an arm.

        Raises:
            UnknownNameError: the arm has no such joint or frame.
        """
        return self

    def __add__(self, other: Any) -> Disturbance:
        if not isinstance(other, Disturbance):
            return self.__radd__(other)
        return _Sum((*list_terms(self), *list_terms(other)))  # flat, however many are added one after another

    def __radd__(self, other: Any) -> Disturbance:  # sum(...) begins with 0
        return self if isinstance(other, int) and other == 0 else NotImplemented

    def __repr__(self) -> str:
        described = self.describe()
        known = (f"{name}={summarize(value)!r}" for name, value in described.items() if name != "disturbance")
        return f"{type(self).__name__}({', '.join(known)})"

    def describe(self) -> dict[str, Any]:
        """Return name and public parameters, for the configuration of a run."""
        return {"disturbance": type(self).__name__} | plain_attributes(self)


class _Sum(Disturbance):
    def __init__(self, terms: tuple[Disturbance, ...]) -> None:
        self.terms = terms

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        total = self.terms[0].torque(t, q, qd)
        for term in self.terms[1:]:
            total = total + term.torque(t, q, qd)
        return total

    @property
    def jumps(self) -> Array:
        return np.concatenate([jump_times(term) for term in self.terms])

    def held_joints(self, t: float, q: Array) -> NDArray[np.bool_] | None:
        masks = [mask for term in self.terms if (mask := term.held_joints(t, q)) is not None]
        return np.logical_or.reduce(np.broadcast_arrays(np.zeros(q.shape, dtype=bool), *masks)) if masks else None

    def torque_factor(self, t: float) -> Array | None:
        shares = [share for term in self.terms if (share := term.torque_factor(t)) is not None]
        return reduce(np.multiply, shares) if shares else None

    @property
    def arm_change_times(self) -> Array:
        return np.concatenate([term.arm_change_times for term in self.terms])

    def change_arm(self, t: float, arm: RobotModel | RobotBatch) -> RobotModel | RobotBatch:
        return reduce(lambda changed, term: term.change_arm(t, changed), self.terms, arm)

    def strike(self, before: float, now: float, q: Array, qd: Array) -> Array | None:
        impulses = [one for term in self.terms if (one := term.strike(before, now, q, qd)) is not None]
        return reduce(np.add, impulses) if impulses else None

    def __repr__(self) -> str:
        return " + ".join(map(repr, list_terms(self)))

    def find_names(self, robot: RobotModel) -> Disturbance:
        return _Sum(tuple(term.find_names(robot) for term in self.terms))

    def describe(self) -> dict[str, Any]:
        return {"disturbance": "sum", "terms": [term.describe() for term in self.terms]}


class TimedDisturbance(Disturbance):
    """A disturbance from ``start`` for ``duration`` [s], each a number or one for each rollout, (N,).

    Its argument for the start may have another ``name``.
    """

    def __init__(self, start: ArrayLike, duration: ArrayLike, name: str = "start") -> None:
        self.start, length = _check_each(name, start), as_array("duration", duration)
        if length.ndim > 1 or not (length > 0).all():
            raise InputError(
                f"duration = {length.tolist()}, expected times greater than 0 [s], one or (N,)",
                argument="duration",
                value=duration,
            )
        self.duration = freeze(length)
        check_rollouts(**{name: self.start.shape}, duration=length.shape)

    def share(self, t: float | Array) -> Array:
        """Return 1 while it acts and 0 else, (), or (N, 1); (k, 1 or N, 1) at times (k, 1)."""
        since = t - self.start
        acting = ((since >= 0) & (since < self.duration)).astype(np.float64)
        return acting[..., None] if acting.ndim else acting

    @property
    def jumps(self) -> Array:
        ends = np.concatenate([np.ravel(self.start), np.ravel(self.start + self.duration)])
        return np.unique(ends[np.isfinite(ends)])


class Push(TimedDisturbance):
    """A constant torque on the joints for a while.

    Args:
        magnitude: torque [N m], (n,), or for each rollout, (N, n).
        start: when it begins [s], or for each rollout, (N,).
        duration: how long it acts [s], or for each rollout, (N,).
    """

    def __init__(self, magnitude: Torques, start: Begin = 0.0, duration: Span = np.inf) -> None:
        super().__init__(start, duration)
        self.magnitude = freeze(check_finite("magnitude", as_array("magnitude", magnitude)))
        check_rollouts(start=self.start.shape, duration=self.duration.shape, magnitude=self.magnitude.shape[:-1])

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        return self.share(t) * self.magnitude


class Harmonic(Disturbance):
    """A sinusoidal torque on the joints, A sin(2πft + φ).

    Args:
        amplitude: A [N m], (n,), or for each rollout, (N, n).
        frequency: f [Hz], or for each rollout, (N,).
        phase: φ [rad], or for each rollout, (N,).
    """

    def __init__(self, amplitude: Torques, frequency: Frequency, phase: Phase = 0.0) -> None:
        self.amplitude = freeze(check_finite("amplitude", as_array("amplitude", amplitude)))
        self.frequency, self.phase = _check_each("frequency", frequency), _check_each("phase", phase)
        counts = {"frequency": self.frequency.shape, "phase": self.phase.shape}
        check_rollouts(amplitude=self.amplitude.shape[:-1], **counts)

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        wave = np.sin(2 * np.pi * self.frequency * t + self.phase)
        return (wave[..., None] if wave.ndim else wave) * self.amplitude


class FrameForce(TimedDisturbance):
    """A constant force on the origin of a frame, in axes of the base: τ = J(q)ᵀ f, J the Jacobian of that point.

    In the sampled loop J is that at the beginning of the step.

    Args:
        robot: the arm, for its kinematics.
        frame: name of the frame.
        force: f [N], (3,), or for each rollout, (N, 3).
        start: when it begins [s], or for each rollout, (N,).
        duration: how long it acts [s], or for each rollout, (N,).
    """

    def __init__(
        self,
        robot: RobotModel,
        frame: str,
        force: Annotated[ArrayLike, Form.NUMBERS, Unit("N")],
        start: Begin = 0.0,
        duration: Span = np.inf,
    ) -> None:
        super().__init__(start, duration)
        expect("robot", robot, RobotModel)
        robot.frame_pose(np.zeros(robot.n), frame)  # raises where there is no such frame
        self._robot, self.frame = robot, frame
        self.force = check_vectors("force", force)
        check_rollouts(start=self.start.shape, duration=self.duration.shape, force=self.force.shape[:-1])

    @property
    def robot(self) -> RobotModel:
        """The arm whose kinematics the force acts through."""
        return self._robot

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        share = self.share(t)
        if not share.any():
            return np.zeros_like(q)
        jacobian = self._robot.frame_jacobian(q, self.frame)[..., :3, :]
        return (jacobian * (share * self.force)[..., None]).sum(-2)

    def describe(self) -> dict[str, Any]:
        """Return name and public parameters, and the name of the arm."""
        return super().describe() | {"robot": self._robot.name}


def list_terms(disturbance: Disturbance | None) -> tuple[Disturbance, ...]:
    """Return the terms of a sum of disturbances, or the single one."""
    if disturbance is None:
        return ()
    if isinstance(disturbance, _Sum):
        return tuple(part for term in disturbance.terms for part in list_terms(term))
    return (disturbance,)


def check_disturbance(disturbance: Any, q: Array, qd: Array) -> None:
    """Check that a disturbance, if there is one, gives torques for the rollouts at (q, q̇), (N, n) each.

    Raises:
        InputError: it is none, or its torques do not fit.
    """
    if disturbance is None:
        return
    if not isinstance(disturbance, Disturbance):
        raise InputError(
            f"disturbance = {disturbance!r}, expected a Disturbance, such as Push(...) or a sum of them",
            argument="disturbance",
            value=disturbance,
        )
    terms = list_terms(disturbance)
    torques = [_first_torque(term, q, qd) for term in terms]
    counts = {
        f"{type(term).__name__} (term {i})": one.shape[:-1]
        for i, (term, one) in enumerate(zip(terms, torques, strict=True))
    }
    check_rollouts(**counts)
    for term, torque in zip(terms, torques, strict=True):
        _check_term(term, torque, q)


def _first_torque(disturbance: Disturbance, q: Array, qd: Array) -> Array:
    """Return the torque of one disturbance at the start, of whatever shape."""
    name = type(disturbance).__name__
    return np.asarray(_try(name, "torque", q, lambda: np.array(disturbance.torque(0.0, q, qd), dtype=np.float64)))


def _check_term(disturbance: Disturbance, torque: Array, q: Array) -> None:
    """Check the first torque of one disturbance, what it holds, and its jumps."""
    name = type(disturbance).__name__
    if torque.shape not in ((), q.shape[1:], (1, q.shape[1]), q.shape):
        fits = torque.shape[-1] == q.shape[1]
        what = (
            f"one value for all rollouts, or one for each of {len(q)}"
            if fits
            else f"a value for each of {q.shape[1]} joints"
        )
        raise InputError(
            f"{name}.torque has shape {torque.shape}, expected {q.shape}: rollouts and joints; give {what}",
            value=torque.shape,
        )
    held = _try(name, "held_joints", q, lambda: disturbance.held_joints(0.0, q))
    if held is not None and np.shape(held) not in (q.shape[1:], (1, q.shape[1]), q.shape):
        raise InputError(
            f"{name}.held_joints has shape {np.shape(held)}, expected {q.shape}: rollouts and joints",
            value=np.shape(held),
        )
    factor = _try(name, "torque_factor", q, lambda: disturbance.torque_factor(0.0))
    share = 1.0 if factor is None else _try(name, "torque_factor", q, lambda: np.broadcast_to(factor, q.shape))
    if not np.all((np.asarray(share) >= 0) & (np.asarray(share) <= 1)):
        raise InputError(
            f"{name}.torque_factor gives {np.asarray(factor).tolist()} at the start, expected shares from 0 to 1",
            argument=name,
            value=factor,
            limit=(0.0, 1.0),
        )
    if not np.isfinite(torque).all():
        raise InputError(
            f"{name}.torque gives {torque.tolist()} at the start, expected numbers", argument=name, value=torque
        )
    jump_times(disturbance)


def _try(name: str, method: str, q: Array, call: Callable[[], Any]) -> Any:
    """Return what a method of a disturbance gives for the rollouts at q (N, n); raise where it fails."""
    try:
        return call()
    except (TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"{name}.{method} fails for {len(q)} rollouts of {q.shape[1]} joints: {error}",
            argument=name,
            value=list(q.shape),
        ) from error


def jump_times(disturbance: Disturbance) -> Array:
    """Return the times [s] at which a disturbance jumps, (k,), however its class says them.

    Raises:
        InputError: they are no numbers.
    """
    jumps = disturbance.jumps
    try:
        if callable(jumps):
            raise TypeError("it is a method: write @property before it")
        return np.atleast_1d(as_array("jumps", jumps)).ravel()
    except (TypeError, ValueError) as error:
        name = type(disturbance).__name__
        raise InputError(f"{name}.jumps cannot be used: {error}; expected times [s], (k,)", argument=name) from error


def check_rollouts(**axes: tuple[int, ...]) -> None:
    """Check that arguments with a value for each rollout have equally many.

    Args:
        axes: of each argument, by its name, the axes before those of joints or space, () or (N,).

    Raises:
        InputError: they have not.
    """
    several = {name: shape[0] for name, shape in axes.items() if shape and shape[0] != 1}
    for name, count in several.items():
        first = next(iter(several))
        if count != several[first]:
            raise InputError(
                f"{first} is for {several[first]} rollouts and {name} for {count}, expected as many of both, or one "
                "for all rollouts",
                argument=name,
                value=count,
                limit=several[first],
            )


def no_torques(q: Array, *parts: ArrayLike) -> Array:
    """Return zeros (N, n) for the rollouts that ``parts`` have rows for, and their joints, or those of q (…, n)."""
    shape = np.broadcast_shapes(*map(np.shape, parts))
    return np.zeros((*shape[:-1], q.shape[-1] if shape[-1:] in ((), (1,)) else shape[-1]))


def check_vectors(name: str, value: ArrayLike) -> Array:
    """Check vectors (3,) or (N, 3); return them read-only."""
    array = freeze(check_finite(name, as_array(name, value)))
    if array.shape[-1:] != (3,) or array.ndim > 2:
        raise InputError(
            f"{name} has shape {array.shape}, expected (3,), or (N, 3) for each rollout", argument=name, value=array
        )
    return array


def _check_each(name: str, value: ArrayLike) -> Array:
    """Check a number, or one for each rollout, (N,); return it read-only."""
    array = freeze(check_finite(name, as_array(name, value)))
    if array.ndim > 1:
        raise InputError(
            f"{name} has shape {array.shape}, expected a number, or one for each rollout, (N,)",
            argument=name,
            value=value,
        )
    return array
