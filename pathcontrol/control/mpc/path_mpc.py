"""Model predictive path following: torques from an optimisation over a receding horizon."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_scalar, as_whole, check_finite
from pathcontrol._expect import expect_choice
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.control.mpc.path_problem import SHORTEST, Around, Inputs, Motion, PathProblem, Weights, follow
from pathcontrol.errors import InputError, warn
from pathcontrol.profiles.topp.joint_limits import joint_values
from pathcontrol.profiles.topp.time_optimal import time_optimal
from pathcontrol.robot.friction import Viscous, levels_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.task import PathTask

_GENTLE = 50.0  # rad/s², along the path, of the first guess
_FASTER = 1.2  # than the fastest profile, the bound of ṡ at any node


class PathMPC(Controller):
    """Model predictive path following within the torque limits: the speed along the path is an input.

    At each tick the motion over the next ``horizon`` is chosen that makes

        ∫ Q‖e_p‖² + W‖q_d'‖²(ṡ − ϑ(s))² + R‖ë_p‖² + R_s‖q_d'‖²s̈² dt,    e_p = q_d(s) − q

    smallest while all torques are within their limits, and the first of its accelerations is applied:

        τ = M(q)[q_d's̈ + q_d''ṡ² − ë_p] + C(q,q̇)q̇ + g(q) + f̂(q̇)

    s and ṡ are states of the law and s̈ is an input of the optimisation, as the timing law of T. Faulwasser and
    R. Findeisen (Nonlinear model predictive control for constrained output path following, IEEE Trans. Automatic
    Control 61, 2016). The law slows down where the torques do not suffice for ϑ, before it is there. At the end of the
    horizon the arm is on the path, at a speed with which the drives can follow the rest of it (the terminal constraint;
    that speed is the one of :func:`time_optimal` with free ends). So a solution at one tick, moved on, is nearly one at
    the next: exactly, where the model is right and the control period is that of an interval. After a push the
    constraint cannot always be met; what is missing is made as small as possible.

    Where the solver fails, the last plan goes on: there ``regular`` is False, and a warning names the reason.

    Args:
        robot: the model the law uses, with torque limits.
        task: the path and the speed that is desired, ϑ; it need not be within the torque limits.
        horizon: length of the horizon [s].
        intervals: number of intervals over which the inputs are constant.
        Q: weight of the position error [1/rad²].
        W: weight of the error of the path speed [s²/rad²]; the smaller, the less the path is left for speed.
        R: weight of the acceleration beside the path [s⁴/rad²]; deviations decay with (Q/R)^¼ [1/s].
        R_s: weight of the acceleration along the path [s⁴/rad²]; the speed settles with √(W/R_s) [1/s].
        torque: |τ| ≤ ``torque`` [N m], (n,); ``True`` for the limits of the URDF.
        margin: share of each torque limit that is left, 0 ≤ margin < 1.
        end: ``"rest"`` at the end of an open path, or ``"free"`` to pass it at any speed. Behind a free end nothing is
            planned: s stays there, and a linear regulator brings the arm back as well as its torques allow.
        options: ``friction``, ``start`` and ``observer_hz`` of :class:`Controller`.

    Raises:
        InputError: a weight, a limit or another argument has a wrong value.
        TaskError: the arm cannot pass a posture of the path slowly.
        MissingExtraError: ``casadi`` is not installed (extra ``mpc``).
    """

    gains = ("Q", "W", "R", "R_s")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        horizon: Annotated[float, Form.POSITIVE, Unit("s")] = 0.5,
        intervals: int = 20,
        Q: Annotated[float, Form.POSITIVE, Unit("1/rad^2")] = 1.0,
        W: Annotated[float, Form.POSITIVE, Unit("s^2/rad^2")] = 1e-4,
        R: Annotated[float, Form.POSITIVE, Unit("s^4/rad^2")] = 1e-6,
        R_s: Annotated[float, Form.POSITIVE, Unit("s^4/rad^2")] = 1e-7,
        torque: Annotated[ArrayLike | bool, Form.LIMITS, Unit("N m", "N")] = True,
        margin: Annotated[float, Form.NOT_NEGATIVE] = 0.05,
        end: Literal["rest", "free"] = "rest",
        **options: Any,
    ) -> None:
        super().__init__(robot, task, **options)
        refuse_batch("task", task)
        expect_choice("end", end, ("rest", "free"))
        self.horizon, self.end = as_scalar("horizon", horizon, positive=True), end
        self.intervals = as_whole("intervals", intervals, 2, 500)
        weights = {"Q": Q, "W": W, "R": R, "R_s": R_s}
        self.Q, self.W, self.R, self.R_s = (as_scalar(name, value, positive=True) for name, value in weights.items())
        self.torque, self.margin = torque, as_scalar("margin", margin)
        self.step = self.horizon / self.intervals
        self._limits = self._torque_limits()
        self._fastest = self._fastest_profile()
        given = Weights(self.Q, self.W, self.R, self.R_s)
        self._problem = PathProblem(robot, task, self.compensated, self._limits, given, self.step, self.intervals)

    def start(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return the state: s, the observer's memory, ṡ of the arm along the path, and the inputs of a first plan."""
        first = super().start(q, qd)
        s = first[..., 0]
        tangent = self.task.dq_d(s)
        along = np.vecdot(tangent, np.broadcast_to(np.asarray(qd, dtype=np.float64), tangent.shape))
        sdot = np.maximum(along / np.vecdot(tangent, tangent), 0.0)
        plans = np.empty((*s.shape, self.intervals * (self.robot.n + 1) + 1))
        for i in np.ndindex(s.shape):
            plans[i] = self._pack(self._first_guess(float(s[i]), float(sdot[i])))
        return np.concatenate([first, sdot[..., None], plans], axis=-1)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        s, sdot, before = z[..., 0], z[..., self._own], z[..., self._own + 1 :]
        task, end = self.task.at(s), self.point(s)
        e_p, rate = task.q_d - q, task.dq_d * sdot[..., None] - qd
        after, regular = np.empty_like(before), np.ones(s.shape, dtype=bool)
        for i in np.ndindex(s.shape):
            one = self if self.speed is None else self.at_speed(np.broadcast_to(self.speed, s.shape)[i])
            inputs, reason = one._optimise(e_p[i], rate[i], float(s[i]), float(sdot[i]), self._unpack(before[i]))
            after[i], regular[i] = self._pack(inputs), not reason
            if reason:
                warn(f"the solver of PathMPC stopped ({reason}); its last plan goes on, and `regular` is False there")
        beside, along = after[..., : self.robot.n], after[..., -self.intervals - 1]
        qdd = task.dq_d * along[..., None] + task.ddq_d * (sdot**2)[..., None] - beside
        viscous = self.compensated * qd
        tau = np.clip(self.robot.inverse_dynamics(q, qd, qdd) + viscous, -self._limits, self._limits)
        tau = tau - viscous + self.friction_torque(qd, task.dq_d * sdot[..., None])
        memory = np.zeros((*s.shape, self._own - 1))
        change = (after - before) / self.step  # in continuous time the plan follows the best one
        zdot = np.concatenate([sdot[..., None], memory, along[..., None], change], axis=-1)
        e_v = end.velocity - qd
        out = ControlOutput(tau, zdot, s, self.inside(s, sdot), np.zeros_like(s), along, e_p, e_v, regular)
        return self.compensate(t, q, qd, z, out)

    def advance(self, z: Array, out: ControlOutput, period: float) -> Array:
        plans = z[..., self._own + 1 :] + self.step * out.zdot[..., self._own + 1 :]
        along = np.empty(z.shape[:-1])
        for i in np.ndindex(along.shape):
            plan = self._unpack(plans[i])
            along[i] = plan.moved(0.0, period).along[0]  # the mean of s̈, of which the first may last for less
            left = self.intervals * plan.step - period  # to the end of a path that is passed
            step = plan.step if plan.step >= self.step else max(left / self.intervals, SHORTEST * self.step)
            plans[i] = self._pack(plan.moved(period, step))
        first = super().advance(z, out._replace(drift=along), period)
        sdot = z[..., self._own] + period * along
        ended = np.zeros(sdot.shape, dtype=bool) if self.task.closed else first[..., 0] >= self.task.s_end
        return np.concatenate([first, np.where(ended, 0.0, sdot)[..., None], plans], axis=-1)

    def speed_response(self, s: Array, theta: Array) -> Array:
        return np.zeros_like(s)

    def speed_gradient(self, q: Array, qd: Array, s: Array, velocity: Array) -> tuple[Array, Array]:
        """Return zeros: the plan changes its speed by its own input s̈."""
        return np.zeros_like(velocity), np.zeros_like(s)

    def describe(self) -> dict[str, Any]:
        torque = self.torque if isinstance(self.torque, bool) else np.asarray(self.torque).tolist()
        limits = {"torque": torque, "margin": self.margin, "end": self.end}
        return super().describe() | {"horizon": self.horizon, "intervals": self.intervals} | limits

    # --- inside ---------------------------------------------------------------------------------------------

    @property
    def _own(self) -> int:
        """The place of ṡ in the state, after s and the memory of the observer."""
        return 1 if self.observer is None else 1 + self.observer.size

    def _torque_limits(self) -> Array:
        """Return the limits of the torque without dry friction [N m], (n,), less the margin.

        Raises:
            InputError: there are none, or dry friction takes all of one.
        """
        if not 0 <= self.margin < 1:
            raise InputError(
                f"margin = {self.margin:g}, expected the share of the torque that is left, 0 ≤ margin < 1",
                argument="margin",
                value=self.margin,
                limit=(0.0, 1.0),
            )
        limits = (1 - self.margin) * joint_values("torque", self.torque, self.robot.limits.effort, self.robot)
        if not np.isfinite(limits).all():
            raise InputError(
                f"torque = {limits.tolist()}, expected a limit of each joint; give torque = [N m, …]",
                argument="torque",
                value=self.torque,
            )
        if self.friction == "full":
            rest = limits - np.max(levels_of(self.robot.friction, np.zeros(self.robot.n)), axis=0)
            if (rest <= 0).any():
                raise InputError(
                    f"dry friction takes all of the torque limits {limits.tolist()} N m of a joint",
                    argument="torque",
                    value=limits,
                )
            return rest
        return check_finite("torque", limits)

    def _fastest_profile(self) -> Any:
        """Return the fastest profile within the torque limits, with free ends."""
        arm = self.robot.with_friction(Viscous(self.compensated))
        ends: dict[str, Any] = {"start_rate": "free", "end_rate": "free" if self.end == "free" else None}
        ends = {} if self.task.closed else ends
        return time_optimal(arm, self.task, velocity=None, torque=self._limits, margin=0.0, **ends)

    def _first_guess(self, s: float, sdot: float) -> Inputs:
        """Return the inputs of a motion along the path at the desired speed, or the fastest if that is lower."""
        rates, step = [sdot], self.step
        for _ in range(self.intervals):
            at = np.array(s if self.task.closed else min(s, self.task.s_end))
            fastest = float(np.minimum(self._fastest.theta(self.task, at), self.task.theta(at)))
            gentle = step * _GENTLE / float(np.linalg.norm(self.task.dq_d(at)))
            rates.append(min(fastest, rates[-1] + gentle))
            s += step * rates[-1]
        return Inputs(np.zeros((self.intervals, self.robot.n)), np.diff(rates) / step, step)

    def _optimise(self, e: Array, edot: Array, s: float, sdot: float, inputs: Inputs) -> tuple[Inputs, str]:
        """Return the best inputs from a state, near those of the last plan, and the solver's reason if it fails."""
        if self.end == "free" and not self.task.closed and s >= self.task.s_end:
            return self._come_back(e, edot), ""
        time = self._time_to_end(follow(e, edot, s, sdot, inputs), inputs.step)
        passes = time <= self.horizon
        inputs = inputs.moved(0.0, max(time / self.intervals, SHORTEST * self.step) if passes else self.step)
        guess = follow(e, edot, s, sdot, inputs)
        inputs, _, reason = self._problem.solve(guess, inputs, self._around(guess, passes))
        return inputs, reason

    def _come_back(self, e: Array, edot: Array) -> Inputs:
        """Return the inputs behind a free end: the linear-quadratic regulator of the deviation, and s at rest."""
        pole, beside = (self.Q / self.R) ** 0.25, np.zeros((self.intervals, self.robot.n))
        beside[0] = -(pole**2) * e - np.sqrt(2) * pole * edot
        return Inputs(beside, np.zeros(self.intervals), self.step)

    def _time_to_end(self, guess: Motion, step: float) -> float:
        """Return the time [s] after which a guess passes the free end of the path, ∞ where none is ahead."""
        end, s = self.task.s_end, guess.s
        if self.end == "rest" or self.task.closed:
            return np.inf
        if s[-1] < end:
            return self.intervals * step + float((end - s[-1]) / max(guess.sdot[-1], SHORTEST * float(np.ptp(s))))
        k = int(np.argmax(s >= end))
        return step * (k - float((s[k] - end) / (s[k] - s[k - 1])))

    def _around(self, guess: Motion, passes: bool) -> Around:
        """Return the desired and the fastest speeds at the nodes of a guess."""
        task, last = self.task, guess.s[-1]
        point = self.point(guess.s)
        if passes:
            point = task.at(np.minimum(guess.s, task.s_end))
            point = point if self.speed is None else point.at_speed(self.speed)
        at = np.asarray(last if task.closed else min(max(last, task.s0), task.s_end))
        rate, slope = float(self._fastest.theta(task, at)), float(self._fastest.dtheta(task, at))
        most = _FASTER * max(float(np.sqrt(self._fastest.squared.max())), float(guess.sdot[0]))
        backwards = self.speed is not None and bool(np.any(self.speed < 0))
        return Around(point.theta, point.dtheta, (rate**2, 2 * rate * slope), most, passes, backwards)

    def _pack(self, inputs: Inputs) -> Array:
        """Return inputs as a part of the state."""
        return np.concatenate([inputs.beside.ravel(), inputs.along, [inputs.step]])

    def _unpack(self, plan: Array) -> Inputs:
        """Return the inputs that are a part of the state."""
        beside, along = plan[: -self.intervals - 1], plan[-self.intervals - 1 : -1]
        return Inputs(beside.reshape(self.intervals, self.robot.n), along, float(plan[-1]))
