"""The interface of a control law: its state is handed in and handed back, and the law itself keeps none."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Annotated, Any, Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_joint_array, join_columns
from pathcontrol._expect import expect, expect_choice
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.ending import Ending
from pathcontrol.control.gains import diagonal_gain
from pathcontrol.control.observer import CUTOFF, MomentumObserver, Observation
from pathcontrol.errors import InputError, warn, warn_of_single
from pathcontrol.robot.friction import levels_of, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.task import PathTask
from pathcontrol.tasks.task_check import check_task

#: what may be known of the friction of a model
KnownFriction = Literal["none", "viscous", "full"]
FrictionCompensation = Literal["none", "viscous", "full", "observed"]
Start = Literal["s0", "nearest"]

_RESTING = 1e-6  # rad/s or m/s, the desired velocity below which a joint is to rest
_HELD = 1e-6  # factor of the speed below which a plan stands still


class ControlOutput(NamedTuple):
    """The values of a control law at one moment.

    Attributes:
        tau: torque demand τ [N m], (*batch, n).
        zdot: rate of the law's state, (*batch, m).
        s: path parameter in use, (*batch,).
        sdot: its rate [1/s], (*batch,).
        slope: ∂ṡ/∂s with the arm held still [1/s], (*batch,).
        drift: rate at which the arm's motion changes ṡ with s held still [1/s²], (*batch,).
        e_p: position error q_d(s) − q [rad], (*batch, n).
        e_v: velocity error q_d'(s)ϑ(s) − q̇ [rad/s], (*batch, n).
        regular: False where the path parameter is not defined by the law and the last one was kept, (*batch,).
        observation: the values of the law's momentum observer, or None where it has none.
    """

    tau: Array
    zdot: Array
    s: Array
    sdot: Array
    slope: Array
    drift: Array
    e_p: Array
    e_v: Array
    regular: Array
    observation: Observation | None = None


class Controller(ABC):
    """A control law for any arm and any task.

    :meth:`start` gives the state z, (*batch, m); :meth:`law` maps (t, q, q̇, z) to torques and ż and keeps nothing;
    :meth:`advance` takes z over one control period. The state of the controllers here is the path parameter, m = 1, and
    after it the memory of the momentum observer, where there is one.

    Args:
        robot: the model the law uses, which need not be the simulated arm.
        task: path and velocity profile, for as many joints; one of each rollout is a :class:`TaskBatch`.
        friction: what the torque compensates of ``robot.friction``: ``"none"``, ``"viscous"`` (as in the paper) or
            ``"full"``, which adds the Coulomb level in the direction of motion; of the desired one where a joint rests.
            ``"observed"`` takes nothing from it, but compensates what a :class:`MomentumObserver` estimates: the torque
            d that acts beside the motors, from all friction, loads and contacts.
        start: the first path parameter: ``"s0"`` of the task, or that of the ``"nearest"`` point of the path.
        observer_hz: corner frequency of both low passes of the observer [Hz], a number or (n,); (N, n) has a row for
            each rollout. By default 35 Hz. Of ``friction="observed"`` only.

    Where the torque compensates an estimate d̂, the terms of a law's theorem stay, and the rest d − d̂ acts on the arm as
    uncompensated friction does: V̇ has a term of e_v and M⁻¹(d − d̂) more, which falls with the corner frequency.
    """

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        friction: FrictionCompensation = "viscous",
        start: Start = "s0",
        observer_hz: Annotated[ArrayLike, Form.GAIN, Unit("Hz")] | None = None,
    ) -> None:
        expect_choice("friction", friction, get_args(FrictionCompensation))
        expect_choice("start", start, get_args(Start))
        expect("robot", robot, RobotModel)
        check_task(task, robot.n)
        self.robot, self.task, self.friction, self.start_at = robot, task, friction, start
        self.ending = Ending.of(task)
        self._viscous = viscous_of(robot.friction)
        if (cutoff := self._check_cutoff(observer_hz)) is not None:
            self.observer_hz, self.observer = cutoff, MomentumObserver(robot, cutoff)

    def __init_subclass__(cls, single: bool | None = None, **options: Any) -> None:
        super().__init_subclass__(**options)
        if single is not None:
            warn_of_single(cls.__name__)

    def _check_cutoff(self, observer_hz: ArrayLike | None) -> Array | None:
        """Check the corner frequency of the observer [Hz]; return it, or None for a law without one."""
        if self.friction == "observed":
            given = CUTOFF if observer_hz is None else observer_hz
            return diagonal_gain("observer_hz", given, self.robot.n, self.robot.joint_names)
        if observer_hz is not None:
            warn(f"observer_hz = {observer_hz}, but friction = {self.friction!r} has no observer; give 'observed'")
        return None

    @abstractmethod
    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        """Return the torques and rates for q [rad] and q̇ [rad/s], (*batch, n), at time t [s] and state z."""

    def start(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return the state z, (*batch, m), for an arm that starts at (q, q̇)."""
        q = as_joint_array("q", q, self.robot.n, self.robot.joint_names)
        qd = np.broadcast_to(as_joint_array("qd", qd, self.robot.n), q.shape)
        s = np.asarray(self.first_parameter(q, qd))[..., None]
        return s if self.observer is None else join_columns([s, self.observer.start(q, qd)])

    def first_parameter(self, q: Array, qd: Array) -> Array:
        """Return the path parameter, (*batch,), of an arm that starts at (q, q̇), (*batch, n) each."""
        return np.full(q.shape[:-1], self.task.s0) if self.start_at == "s0" else self.task.sigma_bar(q)

    def inherit(self, z: Array, before: Array, t: float) -> Array:
        """Return the first state z, in which the observer goes on from the state ``before`` of a law at its t [s]."""
        size = 0 if self.observer is None else self.observer.size
        memory = before[..., 1 : 1 + size].copy()
        memory[..., -1:] -= t  # its time, as this law's begins with 0
        return np.concatenate([z[..., :1], memory, z[..., 1 + size :]], axis=-1)

    def recollect(self, z: Array, before: Array) -> Array:
        """Return the first state z with what the law had learned in an earlier state ``before``, (m,) each."""
        return z

    def rate(self, out: ControlOutput) -> Array:
        """Return ż in continuous time, (*batch, m), where the torque that acts is ``out.tau``."""
        if self.observer is None or out.observation is None:
            return out.zdot
        memory, own = self.observer.rate(out.observation, out.tau), out.zdot[..., 1 + self.observer.size :]
        return join_columns([out.zdot[..., :1], memory, own])

    def advance(self, z: Array, out: ControlOutput, period: float) -> Array:
        """Return the state one control ``period`` [s] after z; ``out.tau`` is the mean of the torque that acts in it.

        ṡ = f(s, t), where t stands for the motion of the arm at its present velocity, is integrated by the exponential
        Rosenbrock–Euler step s + h φ₁(hf_s) f + h² φ₂(hf_s) f_t, φ₁(x) = (eˣ − 1)/x and φ₂(x) = (φ₁(x) − 1)/x: second
        order, exact where f is linear, and stable for any gain of the extended motion plan with the arm at rest. For
        k → ∞ it is a step of Newton's method for (29) from the present arm, plus hσ̄̇ for its motion.
        (Hochbruck and Ostermann, Acta Numerica 19, 2010.)
        """
        x = np.minimum(period * out.slope, 1.0)
        phi_1, phi_2 = _phi(x)
        s = out.s + period * (phi_1 * out.sdot + period * phi_2 * out.drift)
        s = (s if self.task.closed else np.minimum(np.maximum(s, self.task.s0), self.task.s_end))[..., None]
        if self.observer is None or out.observation is None:
            return s
        return np.concatenate([s, self.observer.advance(out.observation, out.tau)], axis=-1)

    def outcome(self, z: Array) -> dict[str, Array]:
        """Return what the law has to say of a run that ends in its state z, (N, m), as :data:`OUTCOMES`, (N,) each."""
        return {}

    def __repr__(self) -> str:
        gains = ", ".join(f"{name}={np.asarray(getattr(self, name)).tolist()}" for name in self.gains)
        return f"{type(self).__name__}({self.robot.name}, {self.task!r}, {gains})"

    def describe(self) -> dict[str, Any]:
        """Return name, gains and choices, for the configuration of a run."""
        gains = {name: np.asarray(getattr(self, name)).tolist() for name in self.gains}
        name = {"controller": type(self).__name__, "friction": self.friction, "start": self.start_at}
        if self.observer_hz is not None:
            name["observer_hz"] = self.observer_hz.tolist()
        return name | gains | {"robot": self.robot.name, "task": self.task.describe()}

    #: names of the attributes that hold gains
    gains: tuple[str, ...] = ()
    #: the momentum observer whose estimate the torque compensates, and its corner frequency [Hz]
    observer: MomentumObserver | None = None
    observer_hz: Array | None = None

    # --- for laws -------------------------------------------------------------------------------------------

    #: the factor w of ϑ that the plan goes at, (*batch,), set by :meth:`at_speed`; ``None`` for 1
    speed: Array | None = None
    #: the s that a law at a speed asked its task for last, and the answer
    _asked: tuple[Array, PathPoint] | None = None

    def at_speed(self, factor: Array) -> Self:
        """Return this law with the profile wϑ in place of ϑ, for a ``factor`` w (*batch,) that is constant.

        :meth:`point` and :meth:`timed` know it, and with them every law that asks them. Where w changes, the law's
        acceleration lacks ẇ q_d'ϑ, which :class:`LawWrapper` adds.
        """
        law = object.__new__(type(self))
        law.__dict__.update(self.__dict__)  # as copy() does, which takes six times as long at every tick
        law.speed, law._asked = np.where(np.abs(factor) < _HELD, 0.0, factor), None
        return law

    def point(self, s: Array) -> PathPoint:
        """Return the task at s; on an open path with ϑ and ϑ' of the plan that comes to rest, :meth:`Ending.brake`.

        Outside [s0, s_end] the point is the end that was passed.
        """
        if not s.ndim:  # tasks take arrays
            return PathPoint(*(value[0] for value in self.point(s[None])))
        point = self._ask_task(s)
        if self.ending is not None:
            return self.ending.brake(point, s, 1.0 if self.speed is None else self.speed)
        return point if self.speed is None else point.at_speed(self.speed)

    def _ask_task(self, s: Array) -> PathPoint:
        """Return the task at s, of an open path within its ends; it is asked once for an array at a speed.

        A law at a speed lives for one moment, in which the law and its wrapper want the same point.
        """
        if self._asked is not None and self._asked[0] is s:
            return self._asked[1]
        inside = s if self.ending is None else np.minimum(np.maximum(s, self.task.s0), self.task.s_end)
        point = self.task.at(inside)
        if self.speed is not None:
            self._asked = s, point
        return point

    def timed(self, s: Array) -> NDArray[np.bool_]:
        """Return where the plan follows σ̇ = ϑ(σ) without feedback: at the end of an open path, and held, (*batch,).

        A plan that is held at the factor 0 stays where it is, and what pushes the arm does not move it.
        """
        timed = np.zeros(s.shape, dtype=bool)
        if self.ending is not None:
            timed = self.ending.timed(s, 1.0 if self.speed is None else self.speed)
        return timed if self.speed is None else timed | (self.speed == 0.0)

    def full_speed(self, s: Array) -> tuple[Array, Array]:
        """Return q_d'ϑ [rad/s], (*batch, n), and ϑ [1/s] at s (*batch,), where the plan goes at its factor; else 0.

        With the factor w they are the rates ∂(wr)/∂w and ∂(wϑ)/∂w: braked at an end of an open path the plan does not
        depend on w.
        """
        if not s.ndim:
            velocity, theta = self.full_speed(s[None])
            return velocity[0], theta[0]
        point = self._ask_task(s)
        if self.ending is not None:
            point = point.at_speed(self.ending.follows(s, np.ones(()) if self.speed is None else self.speed))
        return point.velocity, point.theta

    def speed_response(self, s: Array, theta: Array) -> Array:
        """Return ∂ṡ/∂w [1/s], (*batch,), at the state s, where the plan's own rate is wϑ, ``theta`` (*batch,).

        It is ϑ for a law whose plan is ṡ = wϑ(s) and what feedback adds.
        """
        return theta

    def speed_gradient(self, q: Array, qd: Array, s: Array, velocity: Array) -> tuple[Array, Array]:
        """Return ∂q̈/∂ẇ [rad/s], (*batch, n), and ∂ṡ/∂ẇ, (*batch,), of a wrapped law at (q, q̇) and s.

        They are q_d'ϑ, ``velocity`` (*batch, n), and 0 for a law whose ṡ does not depend on q̈.
        """
        return velocity, np.zeros(s.shape)

    def inside(self, s: Array, sdot: Array) -> Array:
        """Return ṡ without the part that would leave an open path."""
        if self.task.closed:
            return sdot
        sdot = np.where(s >= self.task.s_end, np.minimum(sdot, 0.0), sdot)
        return np.where(s <= self.task.s0, np.maximum(sdot, 0.0), sdot)

    @property
    def compensated(self) -> Array:
        """The viscous friction b̂ [N m s/rad] that the law compensates, (n,) or (N, n)."""
        return self._viscous if self.friction in ("viscous", "full") else np.zeros(self.robot.n)

    def friction_torque(self, qd: Array, desired: Array | None = None) -> Array | float:
        """Return f̂(q̇) [N m], the friction that the law compensates, (*batch, n).

        Dry friction is compensated in the direction of motion, and where a joint rests, in that of its ``desired``
        velocity: else it would hold for ever an arm that is to start slowly.
        """
        if self.friction == "viscous":
            return self._viscous * qd
        if self.friction in ("none", "observed"):
            return 0.0
        direction = qd if desired is None else np.where(qd == 0, desired, qd)
        plus, minus = levels_of(self.robot.friction, qd)
        return self._viscous * qd + np.where(direction > 0, plus, 0.0) - np.where(direction < 0, minus, 0.0)

    def compensate(self, t: float, q: Array, qd: Array, z: Array, out: ControlOutput) -> ControlOutput:
        """Return ``out`` with what the observer sees, and with that compensated where ``friction`` is ``"observed"``.

        It is the same for a law without observer. Compensated, the estimate of a joint that rests, and is to rest,
        stays what it was: friction would hold the arm whatever the torque, and the smallest error be summed up until
        the arm broke loose, for ever.
        """
        if self.observer is None:
            return out
        memory, compensates = z[..., 1 : 1 + self.observer.size], self.friction == "observed"
        rests = compensates and not qd.all()
        kept = (qd == 0) & (np.abs(out.e_v) < _RESTING) if rests else False
        seen = self.observer.observe(t, q, qd, memory, kept)
        out = out._replace(tau=out.tau - seen.torque if compensates else out.tau, observation=seen)
        return out._replace(zdot=self.rate(out))

    def watching(self, observer_hz: ArrayLike = CUTOFF) -> Self:
        """Return this law with a momentum observer, whose estimate is in ``observation`` of its output.

        A law that has one is returned as it is; another compensates nothing more than before.
        """
        if self.observer is not None:
            return self
        law, cutoff = copy(self), diagonal_gain("observer_hz", observer_hz, self.robot.n, self.robot.joint_names)
        law.observer = MomentumObserver(self.robot, cutoff)
        return law

    def observed_torque(self, z: ArrayLike) -> Array:
        """Return what the law's observer saw at the tick before a state z, r [N m], (*batch, n); 0 at the start.

        A :class:`ControlTick` and a :class:`ControlLoop` have a ``state``, those of a run are ``law_states(run, law)``.

        Raises:
            InputError: the law has no observer, or the state is not one of this law.
        """
        if self.observer is None:
            name = type(self).__name__
            raise InputError(f"{name} has no observer; give it friction='observed', or take law.watching()", value=self)
        return self.observer.recall(np.atleast_1d(np.asarray(z, dtype=np.float64))[..., 1 : 1 + self.observer.size])


def check_controller(name: str, controller: Any) -> None:
    """Check that an argument is a control law, and that its class has made it whole.

    Raises:
        InputError: it is none, or its ``__init__`` does not call that of its base class.
    """
    expect(name, controller, Controller)
    if not hasattr(controller, "task"):
        kind = type(controller).__name__
        raise InputError(
            f"{kind}.__init__ does not call super().__init__(robot, task), which gives a law its arm and task",
            argument=name,
        )


def _phi(x: Array) -> tuple[Array, Array]:
    """Return φ₁(x) = (eˣ − 1)/x and φ₂(x) = (φ₁(x) − 1)/x, the latter by its series where x is small."""
    if not x.any():  # laws whose rate does not depend on s
        return np.ones_like(x), np.full_like(x, 0.5)
    from scipy.special import exprel  # runs of the engine do without SciPy

    small, phi_1 = np.abs(x) < 1e-3, exprel(x)
    if not small.any():
        return phi_1, (phi_1 - 1) / x
    series = 0.5 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5)))
    return phi_1, np.where(small, series, (phi_1 - 1) / np.where(small, 1.0, x))
