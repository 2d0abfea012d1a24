"""The optimal control problem of predictive path following, in the coordinates along and beside the path."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.mpc.path_spline import spline_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.robot.symbolic_dynamics import load_casadi, symbolic_inverse_dynamics
from pathcontrol.tasks.task import PathTask

_KEPT = 1e-5  # by which constraints may be missed; a solution that keeps them serves, if it is the best one or not
_ROOM = 1e-3, 1e-2  # rad behind the end of a path and rad/s below 0, as the barriers of bounds push a plan that rests
SHORTEST = 1e-3  # of an interval, before the end of a path that is passed
_SCALE = 1e4  # of the cost, beside constraints of the order of 1
_OPTIONS = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "max_iter": 60,
        "tol": 1e-9,
        "compl_inf_tol": 1e-9,
        "mu_init": 1e-3,
        "mu_strategy": "adaptive",  # a guess is near the optimum: two thirds of the steps of a barrier that only falls
        "warm_start_init_point": "yes",
    },
}


class Weights(NamedTuple):
    """Weights of the squares of e_p, of the path speed's error, and of the accelerations beside and along the path."""

    beside: float
    speed: float
    acceleration_beside: float
    acceleration_along: float


class Inputs(NamedTuple):
    """Inputs over N intervals of one length.

    Attributes:
        beside: the acceleration ë of the deviation [rad/s²], (N, n).
        along: s̈ [1/s²], (N,).
        step: the length of an interval [s].
    """

    beside: Array
    along: Array
    step: float

    def moved(self, time: float, step: float) -> Inputs:
        """Return the inputs over N intervals of ``step`` that begin a ``time`` [s] later; 0 after the last one."""
        knots = np.arange(len(self.along) + 1)

        def move(values: Array) -> Array:
            integral = np.append(0.0, np.cumsum(values) * self.step)
            return np.diff(np.interp(step * knots + time, self.step * knots, integral)) / step

        return Inputs(np.stack([move(column) for column in self.beside.T], -1), move(self.along), step)


class Motion(NamedTuple):
    """The deviation e = q_d(s) − q and its rate ė, (N + 1, n), and s and ṡ, (N + 1,), at the nodes of a horizon."""

    e: Array
    edot: Array
    s: Array
    sdot: Array


class Around(NamedTuple):
    """The values at the nodes of a guessed motion, about which the problem is stated.

    Attributes:
        theta: the desired ṡ [1/s], (N + 1,).
        slope: its derivative with respect to s, (N + 1,).
        fastest: the largest ṡ² from which the path can be followed on, at the last node, and its derivative by s.
        most: the largest ṡ at any node [1/s].
        passes: whether the horizon ends at the end of the path, which is passed then, in a time that is free.
        backwards: whether ṡ may be negative.
    """

    theta: Array
    slope: Array
    fastest: tuple[float, float]
    most: float
    passes: bool
    backwards: bool


def follow(e: Array, edot: Array, s: float, sdot: float, inputs: Inputs) -> Motion:
    """Return the motion from a state under the ``inputs``."""

    def integrate(x: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
        rates = rate + inputs.step * np.concatenate([0 * acceleration[:1], np.cumsum(acceleration, axis=0)])
        means = 0.5 * (rates[1:] + rates[:-1])
        return x + inputs.step * np.concatenate([0 * means[:1], np.cumsum(means, axis=0)]), rates

    return Motion(*integrate(e, edot, inputs.beside), *integrate(np.array(s), np.array(sdot), inputs.along))


class PathProblem:
    """The problem of optimal control over a horizon of N intervals, for one arm and one path.

    With q = q_d(s) − e the arm's motion has the coordinates (e, s), of which both are double integrators:

        minimise  Σ Δ(Q‖e‖² + W‖q_d'‖²(ṡ − ϑ)² + R‖ë‖² + R_s‖q_d'‖²s̈²) + ρε
        so that   |M(q)q̈ + C(q,q̇)q̇ + g(q) + b̂q̇| ≤ τ_max at both ends of each interval,
                  |e_N|, |ė_N| ≤ ε,  ṡ_N² ≤ ϑ_max(s_N)² + ε,  s ≤ s_end + ε.

    Where the end of an open path is passed within the horizon, it is s_N = s_end, and Δ is one more unknown. The
    problem is solved by IPOPT with exact derivatives. ϑ and ϑ_max² are linear about the guess.

    Args:
        robot: the arm.
        task: the path.
        viscous: friction coefficients that the torque compensates [N m s/rad], (n,).
        torque: the torque limits τ_max [N m], (n,).
        weights: Q, W, R and R_s.
        step: the length Δ of an interval [s].
        intervals: N.

    Raises:
        MissingExtraError: ``casadi`` is not installed.
    """

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        viscous: Array,
        torque: Array,
        weights: Weights,
        step: float,
        intervals: int,
    ) -> None:
        self.n, self.N, self.step, self.task, self._weights = robot.n, intervals, step, task, weights
        self._torque, self._viscous = torque, viscous
        self._tau = symbolic_inverse_dynamics(robot)
        s = np.linspace(*task.one_traverse, 33)
        self._unit = 1.0 / float(np.linalg.norm(task.dq_d(s), axis=-1).mean())  # of s, for 1 rad of the joints
        self._path = spline_of(task, self._unit)
        self._solver = self._build()

    def solve(self, guess: Motion, inputs: Inputs, around: Around) -> tuple[Inputs, Motion, str]:
        """Return the best inputs from the first state of ``guess`` and their motion, and why there are none, or "".

        Args:
            guess: a motion over the horizon.
            inputs: its inputs.
            around: the values at its nodes.
        """
        lower, upper, least, most = self._bounds(guess, around)
        x0 = np.concatenate([guess.e.ravel(), guess.edot.ravel(), guess.s / self._unit, guess.sdot / self._unit])
        x0 = np.concatenate([x0, inputs.beside.ravel(), inputs.along / self._unit, [0.0, inputs.step / self.step]])
        given = [around.theta / self._unit, around.slope, guess.s / self._unit]
        last = np.array(around.fastest) / (self._unit**2, self._unit)
        with np.errstate(invalid="ignore"):
            out = self._solver(x0=x0, lbx=lower, ubx=upper, lbg=least, ubg=most, p=np.concatenate([*given, last]))
        x, g = (np.array(out[name])[:, 0] for name in "xg")
        if not (np.isfinite(x).all() and np.maximum(least - g, g - most).max() < _KEPT):
            return inputs, guess, str(self._solver.stats()["return_status"])
        e, edot, s, sdot, beside, along, (_, share) = np.split(x, np.cumsum(self._sizes))
        rows = (-1, self.n)
        motion = Motion(e.reshape(rows), edot.reshape(rows), self._unit * s, self._unit * sdot)
        return Inputs(beside.reshape(rows), self._unit * along, float(share) * self.step), motion, ""

    @property
    def _sizes(self) -> list[int]:
        """The numbers of unknowns: e, ė, s, ṡ, ë and s̈; then come ε and the share of Δ."""
        n, N = self.n, self.N
        return [n * (N + 1), n * (N + 1), N + 1, N + 1, n * N, N]

    def _bounds(self, guess: Motion, around: Around) -> tuple[Array, Array, Array, Array]:
        """Return the bounds of the unknowns and of the constraints, (lower, upper) each."""
        sizes, slowest = self._sizes, -np.inf if around.backwards else -_ROOM[1]
        lower = [np.full(size, -np.inf) for size in sizes]
        upper = [np.full(size, np.inf) for size in sizes]
        lower[3][:], upper[3][:] = slowest, around.most / self._unit
        first = (guess.e[0], guess.edot[0], guess.s[:1] / self._unit, guess.sdot[:1] / self._unit)
        for values, low, high in zip(first, lower, upper, strict=False):
            low[: len(values)] = high[: len(values)] = values
        if around.passes:
            lower[2][-1] = upper[2][-1] = self.task.s_end / self._unit
        torques, dynamics = np.ones(2 * self.n * self.N), np.zeros((2 * self.n + 2) * self.N)
        zero, ends = np.zeros(2 * self.n), np.full(self.N + 1, self.task.s_end / self._unit + _ROOM[0])
        least: list[Any] = [dynamics, -torques, zero - np.inf, zero, np.full(self.N + 2, -np.inf)]
        most: list[Any] = [dynamics, torques, zero, zero + np.inf, [0.0], ends]
        shortest = SHORTEST if around.passes else 1.0
        bounds = (np.concatenate([*lower, [0.0, shortest]]), np.concatenate([*upper, [np.inf, 1.0]]))
        return (*bounds, np.concatenate(least), np.concatenate(most))

    def _build(self) -> Any:
        """Return the solver of the problem."""
        ca, N, n, weights = load_casadi(), self.N, self.n, self._weights
        e, edot, w = ca.MX.sym("e", n, N + 1), ca.MX.sym("edot", n, N + 1), ca.MX.sym("w", n, N)
        s, sdot, u = ca.MX.sym("s", 1, N + 1), ca.MX.sym("sdot", 1, N + 1), ca.MX.sym("u", 1, N)
        slack, share, given = ca.MX.sym("slack"), ca.MX.sym("share"), ca.MX.sym("given", 3 * (N + 1) + 2)
        step = share * self.step
        theta, slope, near = (part.T for part in ca.vertsplit(given[:-2], N + 1))
        point, tangent, bend = self._path.map(N + 1)(s)
        velocity = tangent * ca.repmat(sdot, n, 1) - edot
        torques = self._torques(point - e, velocity, tangent, bend, sdot, w, u)
        gaps = [_gaps(x, rate, step, a) for x, rate, a in ((e, edot, w), (s, sdot, u))]
        dynamics = [ca.vec(gap) for pair in zip(*gaps, strict=True) for gap in pair]
        last = ca.vertcat(e[:, -1], edot[:, -1])
        fastest = sdot[-1] ** 2 - given[-2] - given[-1] * (s[-1] - near[-1])
        constraints = [*dynamics, *torques, last - slack, last + slack, fastest - slack, s.T - slack]
        length = ca.sum1(tangent**2)
        error = sdot - theta - slope * (s - near)
        cost = weights.beside * ca.sumsqr(e) + weights.speed * ca.dot(length, error**2)
        cost += weights.acceleration_beside * ca.sumsqr(w) + weights.acceleration_along * ca.dot(length[:-1], u**2)
        cost = _SCALE / weights.beside * (step * cost + weights.beside * slack)
        unknowns = ca.vertcat(*(ca.vec(part) for part in (e, edot, s, sdot, w, u)), slack, share)
        problem = {"x": unknowns, "f": cost, "g": ca.vertcat(*constraints), "p": given}
        return ca.nlpsol("path_problem", "ipopt", problem, _OPTIONS)

    def _torques(self, q: Any, qd: Any, tangent: Any, bend: Any, sdot: Any, w: Any, u: Any) -> list[Any]:
        """Return the torques as shares of their limits at the beginnings and at the ends of all intervals."""
        ca, n, N = load_casadi(), self.n, self.N
        shares = []
        for at in (slice(0, N), slice(1, N + 1)):
            along, squared = ca.repmat(u, n, 1), ca.repmat(sdot[:, at] ** 2, n, 1)
            qdd = tangent[:, at] * along + bend[:, at] * squared - w
            tau = self._tau.map(N)(q[:, at], qd[:, at], qdd) + ca.diag(self._viscous) @ qd[:, at]
            shares.append(ca.vec(ca.diag(1 / self._torque) @ tau))
        return shares


def _gaps(x: Any, rate: Any, step: Any, acceleration: Any) -> tuple[Any, Any]:
    """Return by how much a double integrator misses its next node, in position and in rate."""
    moved = x[:, :-1] + step * rate[:, :-1] + 0.5 * step**2 * acceleration
    return x[:, 1:] - moved, rate[:, 1:] - rate[:, :-1] - step * acceleration
