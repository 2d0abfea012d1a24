"""Measured deviations and margins of a Cartesian path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.joint_range import distance_to_limits
from pathcontrol.cartesian.ik.preference import PLANE, find_lowest
from pathcontrol.cartesian.ik.refinement import Refined
from pathcontrol.cartesian.ik.spline_deviation import conditioning

_VALLEYS = 8  # minima of a function along the path that are refined
_HEIGHTS = 256  # postures at which heights are measured
_FINE, _ZOOMS = 33, 3  # points in each, and how often


@dataclass(frozen=True)
class CartesianReport:
    """Measurements at the knots and at more places between them, ``points`` in all.

    Attributes:
        position_deviation: largest distance between the tool and p(s) [m].
        angle_deviation: largest angle between the tool and its orientation at s [rad].
        velocity_deviation: largest ‖J_v q_d' − p'‖/‖p'‖: how far the feed is from constant and along the curve.
        points: number of places.
        knots: number of knots of q_d.
        rounds: how often knots were added.
        length: lever arm ℓ of the joints [m] by which lengths are divided for singular values.
        smallest_singular_value: least singular value of the tool's Jacobian, of those not zero everywhere: a joint
            speed of 1/σ rad/s is needed for a tool speed of ℓ in the worst direction.
        singular_at: where that is [m].
        limit_distance: least distance of a joint to a limit [rad, or m if it slides]; inf if there are none.
        limit_joint: name of that joint; empty if there are no limits.
        limit_at: where that is [m].
        fastest: largest ‖q_d'‖ [rad/m], joint motion for a motion of the tool.
        start_postures: number of start postures from which the curve was followed.
        posture: which posture was chosen, in words.
        lowest_joint: name of the joint that comes lowest, of those that move the tool.
        lowest_height: how high that is above the base plane, z = 0 of the base frame [m].
    """

    position_deviation: float
    angle_deviation: float
    velocity_deviation: float
    points: int
    knots: int
    rounds: int
    length: float
    smallest_singular_value: float
    singular_at: float
    limit_distance: float
    limit_joint: str
    limit_at: float
    fastest: float
    start_postures: int
    posture: str
    lowest_joint: str
    lowest_height: float


def measure(constraint: ToolConstraint, refined: Refined, start_postures: int, searched: bool) -> CartesianReport:
    """Measure a refined spline, whose start posture was ``searched`` or given."""
    robot, spline, found, s = constraint.tool.robot, refined.spline, refined.deviations, refined.checks

    def distance(s: Array) -> Array:
        return distance_to_limits(robot, spline(s)).min(-1)

    singular_at = _search_least(partial(conditioning, constraint, spline), refined, found.conditioning)
    limit_at = _search_least(distance, refined, distance(s))
    distances = distance_to_limits(robot, spline(limit_at))
    joint = int(np.argmin(distances))
    lowest_joint, lowest_height = find_lowest(constraint, spline(s[:: -(-len(s) // _HEIGHTS)]))
    return CartesianReport(
        position_deviation=float(found.position.max()),
        angle_deviation=float(found.angle.max()),
        velocity_deviation=float(found.velocity.max()),
        points=len(s),
        knots=len(refined.mesh),
        rounds=refined.rounds,
        length=constraint.length,
        smallest_singular_value=float(conditioning(constraint, spline, np.array([singular_at]))[0]),
        singular_at=singular_at,
        limit_distance=float(distances[joint]),
        limit_joint=robot.joint_names[joint] if np.isfinite(distances[joint]) else "",
        limit_at=limit_at,
        fastest=float(np.linalg.norm(spline(s, 1), axis=-1).max()),
        start_postures=start_postures,
        posture=_posture(start_postures, searched, lowest_joint, lowest_height),
        lowest_joint=lowest_joint,
        lowest_height=lowest_height,
    )


def _posture(start_postures: int, searched: bool, lowest_joint: str, lowest_height: float) -> str:
    """Describe the chosen posture, and whether it keeps above the base plane."""
    choice = f"the best of {start_postures} searched" if searched else "from the start given"
    if lowest_height >= -PLANE:
        return f"{choice}, all joints above the base plane"
    return f"{choice}, {lowest_joint} down to {-lowest_height:.3g} m below the base plane"


def _search_least(function: Callable[[Array], Array], refined: Refined, values: Array) -> float:
    """Return the least value of a function of s (N,), searched around the least of its ``values`` at the checks."""
    s, ends = refined.checks, (refined.mesh[0], refined.mesh[-1])
    padded = np.concatenate([[np.inf], values, [np.inf]])
    valleys = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    centre = s[valleys[np.argsort(values[valleys], kind="stable")[:_VALLEYS]]]
    width = float(np.diff(s).max())
    for _ in range(_ZOOMS):
        fine = np.clip(centre[:, None] + width * np.linspace(-1, 1, _FINE), *ends)
        depth = function(fine.ravel()).reshape(fine.shape)
        centre = fine[np.arange(len(fine)), depth.argmin(-1)]
        width *= 2 / _FINE
    return float(centre[np.argmin(depth.min(-1))])
