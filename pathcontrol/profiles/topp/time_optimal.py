"""The time-optimal velocity profile of a path within the limits of the arm's drives."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, as_scalar, as_whole, freeze
from pathcontrol._expect import did_you_mean, expect
from pathcontrol.arguments import Form, Rate, Unit
from pathcontrol.errors import InputError, TaskError
from pathcontrol.profiles.limited.grid import edges, refine
from pathcontrol.profiles.tabulated import MOST_POINTS, TabulatedProfile
from pathcontrol.profiles.topp.dynamics import sample, torques
from pathcontrol.profiles.topp.joint_limits import LimitChoice, VelocityLimit, joint_limits
from pathcontrol.profiles.topp.recheck import find_broken
from pathcontrol.profiles.topp.traversal import Demand, fastest
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.profile import Path
from pathcontrol.tasks.task import PathTask

_BINDING = 0.999
_CHANGE = 0.25  # of q_d' within a cell, in shares of its length
_FINER = 3  # samples of the last check for one of the passes
_HALVINGS = 8  # of a cell, to 1/256, beyond which a path is rather a corner
_FREE = "free"


class TimeOptimal(TabulatedProfile):
    """The profile that :func:`time_optimal` computes: a table of ϑ² with the limits that bind.

    Attributes:
        limiting: the limit that is used most at each knot, as ``"torque of elbow_joint"``, m of them.
        used: the share of that limit in use, (m,); 1 where it binds.
        margin: the share of each torque limit that is left for feedback.
    """

    def __init__(
        self, s: Array, squared: Array, period: float | None, limiting: tuple[str, ...], used: Array, margin: float
    ) -> None:
        super().__init__(s, squared, period)
        self.limiting, self.used, self.margin = limiting, freeze(used), margin

    @property
    def limited_by(self) -> dict[str, float]:
        """The share of the traversal time during which each limit binds, the largest first."""
        rate = np.sqrt(self.squared)
        times = np.diff(self.s) / (rate[:-1] + rate[1:])  # half of each cell's
        at_knots = (np.append(times, 0.0) + np.append(0.0, times)) / (2 * times.sum())
        names, index = np.unique(self.limiting, return_inverse=True)
        shares = np.bincount(index, np.where(self.used > _BINDING, at_knots, 0.0))
        return {str(names[i]): float(shares[i]) for i in np.argsort(-shares) if shares[i]}

    def describe(self) -> dict[str, Any]:
        """Return name, number of knots, traversal time [s], margin, and the share of time in which each limit binds."""
        return super().describe() | {"margin": self.margin, "limited_by": self.limited_by}


def time_optimal(
    robot: RobotModel,
    path: Path,
    *,
    velocity: VelocityLimit = True,
    acceleration: Annotated[LimitChoice, Form.LIMITS, Unit("rad/s^2", "m/s^2")] = None,
    torque: Annotated[LimitChoice, Form.LIMITS, Unit("N m", "N")] = True,
    margin: Annotated[float, Form.NOT_NEGATIVE] = 0.05,
    points: int = 1000,
    start_rate: Rate | Literal["free"] | None = None,
    end_rate: Rate | Literal["free"] | None = None,
    end_time: Annotated[float, Form.POSITIVE, Unit("s")] | None = None,
) -> TimeOptimal:
    """Return the profile ϑ(s) that takes an arm along a path in the least time within the limits of its joints.

    Along the path the torques are τ = a s̈ + b ṡ² + d ṡ + c + F with ṡ = ϑ and s̈ = ϑϑ': inertia, centrifugal and
    Coriolis terms, viscous friction, weight, and dry friction in the direction of motion. On a grid, with ϑ² linear in
    s between its knots, a backward pass finds the ϑ² from which the rest of the path can still be passed, and a forward
    pass takes the largest of them (reachability analysis: Pham and Pham, IEEE Trans. Robotics 34, 2018; viscous
    friction, with which the sets of allowed ϑ² and s̈ are not convex, is kept exactly, as quadratics in ϑ). Each limit
    is kept at both ends of every cell; where inverse dynamics between the knots finds more than 0.07 % too much, the
    cell is given less and the passes are repeated. The pieces of the path begin and end at knots, and cells are halved
    where q_d' changes much, or where inverse dynamics on a finer grid finds more than 0.1 % too much.

    A joint that turns back within a cell is given the dry friction of both directions there. Friction that falls with
    velocity (Stribeck) is taken to be anything between its levels at rest and at high speed.

    An open path begins and ends slowly, but not with ϑ = 0, where the motion plan ṡ = ϑ(s) would stop for ever: by
    default with the rate that the arm reaches from rest if it accelerates for 2.5 ms as fast as it can. The controllers
    bring what is left to rest with ϑ ≤ (s_end − s)/T, T = 0.1 s, which for some 10 ms brakes harder than the limits
    allow; ``end_time = 0.1`` makes the profile approach the end like that, within the limits to the last. A rate that
    is ``"free"`` is the one with which the path takes the least time: at the end whatever the arm has there, at the
    start the largest from which the rest of the path can be passed. The profile of a closed path is periodic.

    Every posture must be one that the arm can pass slowly: a controller of the path may slow down anywhere.

    Args:
        robot: the arm, with the friction to be overcome, ``robot.friction``.
        path: a path that ends or closes; its own ϑ does not matter.
        velocity: |q̇| ≤ ``velocity`` [rad/s], (n,); ``True`` for the limits of the URDF, ``None`` for none.
        acceleration: |q̈| ≤ ``acceleration`` [rad/s²], (n,); ``None`` for no limit.
        torque: |τ| ≤ ``torque`` [N m], (n,); ``True`` for the limits of the URDF, ``None`` for none.
        margin: share of each torque limit left for feedback, 0 ≤ margin < 1.
        points: knots of the grid, 10 or more; there are more where cells are halved.
        start_rate: ϑ at the start of an open path [1/s], or ``"free"``. For a tool that begins with v [m/s] along a
            curve p(s) it is v/‖p'‖: v itself where s is the length of the curve.
        end_rate: ϑ at its end [1/s], or ``"free"``.
        end_time: time constant [s] of the approach to its end, instead of ``end_rate``.

    Raises:
        InputError: a limit or rate is not positive or of the wrong shape, or nothing limits the speed somewhere.
        TaskError: the path neither ends nor closes or is for another number of joints; or the demand cannot be met: the
            message says which limit of which joint is in the way, at which s and posture.
    """
    expect("robot", robot, RobotModel)
    expect("path", path, PathTask)
    limits = joint_limits(robot, velocity, acceleration, torque, margin)
    ends = _ends(path, start_rate=start_rate, end_rate=end_rate, end_time=end_time)
    knots = _knots(path, as_whole("points", points, 10, MOST_POINTS))
    for _ in range(_HALVINGS):
        samples = sample(path, knots, robot.n)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # bounds that do not exist are infinite
            demand = Demand(limits, samples, torques(robot, samples), path.period is not None, *ends)
            squared, binding, coarse = fastest(demand)
            finer = sample(path, knots, robot.n, _FINER)
            coarse |= find_broken(limits, finer, torques(robot, finer), squared)
        if not coarse.any():
            break
        knots = np.sort(np.append(knots, 0.5 * (knots[:-1] + knots[1:])[coarse]))
    else:
        where = samples.knots.s[coarse.argmax()]
        raise TaskError(
            f"{len(squared)} points do not resolve the path near s = {where:.6g}: limits are exceeded between them; "
            "give more, or a path that is twice differentiable there",
            s=float(where),
        )
    names = robot.joint_names
    limiting = tuple(f"{kind} of {names[i]}" for kind, i in zip(binding.kinds, binding.joints, strict=True))
    return TimeOptimal(samples.knots.s, squared, path.period, limiting, binding.shares, margin)


def _knots(path: Path, points: int) -> Array:
    """Return the knots of a grid of at least so many ``points``, with cells halved in which q_d' changes much."""

    def resolved(s: Array) -> NDArray[np.bool_]:
        dq = np.asarray(path.dq_d(s))
        change = np.linalg.norm(np.diff(dq, axis=1), axis=-1).sum(-1)
        return np.asarray(~(change > _CHANGE * np.linalg.norm(dq, axis=-1).mean(-1)))  # NaN is for the samples to tell

    return refine(resolved, edges(path, points - 1))


def _ends(path: Path, **ends: float | str | None) -> list[float | None]:
    """Check the rates and the time asked for at the ends of a path, and return them, ∞ for a free rate."""
    given = {name: _end(name, value) for name, value in ends.items() if value is not None}
    if given and path.period is not None:
        raise InputError(
            f"{' and '.join(given)} for a closed path, which begins as fast as it ends; leave them out",
            argument=next(iter(given)),
            value=next(iter(given.values())),
        )
    if given.keys() >= {"end_rate", "end_time"}:
        raise InputError(
            "both end_rate and end_time are given; one of them says how an open path ends",
            argument="end_time",
            value=ends["end_time"],
        )
    return [given.get(name) for name in ends]


def _end(name: str, value: float | str) -> float:
    """Return one rate [1/s], ∞ for a free one, or the time [s] at an end of a path."""
    if not isinstance(value, str | bool) or name == "end_time":
        return as_scalar(name, value, positive=True)
    if value != _FREE:
        raise InputError(
            f"{name} = {value!r}, expected a number greater than 0 [1/s], or {_FREE!r}{did_you_mean(value, [_FREE])}",
            argument=name,
            value=value,
        )
    return np.inf
