"""Postures and the joint range: spread over it, with whole turns removed, and distances to the limits."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.model import RobotModel

_ROUNDING = 1e-9  # rad or m


def spread_postures(robot: RobotModel, count: int) -> Array:
    """Return postures (count, n) spread evenly over the joint range, at most a turn: the additive golden sequence.

    The i-th coordinate is the fraction of k/φⁱ with φ^{n+1} = φ + 1, which for n = 1 is the golden ratio.
    """
    ratio = 2.0
    for _ in range(60):  # fixed-point iteration, a contraction
        ratio = (1 + ratio) ** (1 / (robot.n + 1))
    fractions = np.modf(np.arange(1, count + 1)[:, None] * ratio ** -np.arange(1.0, robot.n + 1) + 0.5)[0]
    lower, upper = one_turn(robot)
    return lower + fractions * (upper - lower)


def one_turn(robot: RobotModel) -> tuple[Array, Array]:
    """Return the joint range, at most one turn about its middle, each (n,); about 0 where there are no limits."""
    lower, upper = robot.limits.lower, robot.limits.upper
    bounded = np.isfinite(lower) & np.isfinite(upper)
    middle = np.clip(0.0, lower, upper)
    middle[bounded] = 0.5 * (lower[bounded] + upper[bounded])
    return np.maximum(lower, middle - np.pi), np.minimum(upper, middle + np.pi)


def unwind(robot: RobotModel, q: Array) -> Array:
    """Return the same postures q (N, n) without whole turns, where the limits allow a turn and more."""
    lower, upper = one_turn(robot)
    turns = (np.array(robot.position_units) == "rad") & (upper - lower > 2 * np.pi - 1e-9)
    return np.where(turns, lower + np.mod(q - lower, 2 * np.pi), q)


def is_outside(robot: RobotModel, q: Array) -> Array:
    """Return whether a joint of postures q (*batch, n) is outside its limits by more than rounding, (*batch,)."""
    return np.asarray((distance_to_limits(robot, q) < -_ROUNDING).any(-1))


def distance_to_limits(robot: RobotModel, q: Array) -> Array:
    """Return the distance of each joint to its nearer limit, (*batch, n); negative outside, inf without limit.

    A joint that has no room between its limits counts as locked there: inf too, unless it is elsewhere.
    """
    lower, upper = robot.limits.lower, robot.limits.upper
    distance = np.minimum(q - lower, upper - q)
    return np.where((lower >= upper) & (distance >= -_ROUNDING), np.inf, distance)


def share_to_limits(robot: RobotModel, q: Array) -> Array:
    """Return the least distance to a limit as a share of half the joint's range, (N,), 1 without limits."""
    half = 0.5 * (robot.limits.upper - robot.limits.lower)
    share = np.divide(distance_to_limits(robot, q), half, out=np.ones_like(q), where=np.isfinite(half) & (half > 0))
    return share.min(-1)
