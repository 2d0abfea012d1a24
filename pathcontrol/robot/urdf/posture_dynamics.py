"""Mass matrix and gravity torque of an arm from the values of its URDF, for the checks.

The model itself is Pinocchio's; these are for a few hundred postures of an arm that may not become one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pathcontrol.robot.urdf.links import Inertial
from pathcontrol.robot.urdf.model_values import Arm, Body, link_pose, moving_bodies

GRAVITY = 9.81  # m/s^2, against the z axis of the root link
POSTURES = 400

_ANY_TURN = np.pi  # rad: where a joint has no limits, or wider ones


class _Placed(NamedTuple):
    """A body at N postures: its joint's pose (N, 4, 4), and the joints that move it with origin and axis, (N, 3)."""

    body: Body
    pose: np.ndarray
    moved_by: tuple[tuple[int, np.ndarray, np.ndarray], ...]


def postures(arm: Arm, count: int = POSTURES) -> np.ndarray:
    """Return postures within the limits of the free joints, (count, n): the zero posture first, then random ones."""
    bodies = moving_bodies(arm)
    low, high = np.array([_position_range(body) for body in bodies]).T
    drawn = np.random.default_rng(0).uniform(low, high, (count, len(bodies)))
    drawn[0] = np.clip(0.0, low, high)
    return drawn


def dynamics(arm: Arm, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mass matrix [kg m^2], (N, n, n), and gravity torque [N m], (N, n), at postures q (N, n).

    The joints are in the order of :func:`moving_bodies`. With J_v and J_w the Jacobians of the centre of mass of a
    link and of its rotation, M is the sum of m J_v' J_v + J_w' R I R' J_w and g that of m J_v' (0, 0, 9.81).
    """
    count, n = q.shape
    M, g = np.zeros((count, n, n)), np.zeros((count, n))
    for placed in _place_bodies(arm, q):
        for link, pose in placed.body.poses.items():
            if (inertial := arm.links[link].inertial) is not None:
                _add_link(M, g, inertial, placed, placed.pose @ pose)
    return M, g


def _add_link(M: np.ndarray, g: np.ndarray, inertial: Inertial, placed: _Placed, link: np.ndarray) -> None:
    """Add the contribution of one link to M and g, in the rows and columns of the joints that move it."""
    centre = link if inertial.origin is None else link @ inertial.origin
    count, joints = len(g), [i for i, _, _ in placed.moved_by]
    J_v, J_w = np.zeros((count, 3, len(joints))), np.zeros((count, 3, len(joints)))
    for k, (_, origin, axis) in enumerate(placed.moved_by):
        if origin.size:
            J_w[:, :, k] = axis
            J_v[:, :, k] = np.cross(axis, centre[:, :3, 3] - origin)
        else:
            J_v[:, :, k] = axis
    turned = centre[:, :3, :3].swapaxes(1, 2) @ J_w
    of_link = inertial.mass * J_v.swapaxes(1, 2) @ J_v + turned.swapaxes(1, 2) @ inertial.inertia @ turned
    M[np.ix_(range(count), joints, joints)] += of_link
    g[:, joints] += inertial.mass * GRAVITY * J_v[:, 2]


def _place_bodies(arm: Arm, q: np.ndarray) -> Iterator[_Placed]:
    """Yield the bodies at postures q (N, n), from the root outwards."""
    holder: dict[str, _Placed] = {}
    for i, body in enumerate(moving_bodies(arm)):
        joint, inner = body.joint, holder.get(body.joint.parent)
        before = link_pose(arm, joint.parent) if inner is None else inner.pose @ inner.body.poses[joint.parent]
        pose = before @ (np.eye(4) if joint.origin is None else joint.origin) @ _motion(body, q[:, i])
        axis = pose[:, :3, :3] @ _unit(body)
        origin = np.empty(0) if joint.type == "prismatic" else pose[:, :3, 3]
        moved_by = (*(() if inner is None else inner.moved_by), (i, origin, axis))
        placed = _Placed(body, pose, moved_by)
        holder |= dict.fromkeys(body.poses, placed)
        yield placed


def _motion(body: Body, position: np.ndarray) -> np.ndarray:
    """Return the transform of a joint at N positions, (N, 4, 4); Rodrigues' formula for one that turns."""
    motion, axis = np.tile(np.eye(4), (len(position), 1, 1)), _unit(body)
    if body.joint.type == "prismatic":
        motion[:, :3, 3] = position[:, None] * axis
        return motion
    cross = np.cross(axis, np.eye(3)).T
    sine, rest = np.sin(position)[:, None, None], 1 - np.cos(position)[:, None, None]
    motion[:, :3, :3] += sine * cross + rest * (cross @ cross)
    return motion


def _unit(body: Body) -> np.ndarray:
    """Return the unit vector along the axis of a joint, or zero."""
    length = float(np.linalg.norm(body.joint.axis))
    return np.asarray(body.joint.axis) / length if length else np.zeros(3)


def _position_range(body: Body) -> tuple[float, float]:
    """Return the range of positions of a joint; where it has no limits, 1 m or half a turn either way."""
    limit, most = body.joint.limit, 1.0 if body.joint.type == "prismatic" else _ANY_TURN
    if limit is None or body.joint.type == "continuous":
        return -most, most
    low, high = limit.lower or 0.0, limit.upper or 0.0
    low, high = float(np.clip(low, -1e3, 1e3)), float(np.clip(high, -1e3, 1e3))
    if body.joint.type != "prismatic" and high - low > 2 * _ANY_TURN:
        return max(low, -_ANY_TURN), min(high, _ANY_TURN)
    return min(low, high), max(low, high)
