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
    """A body at N postures: its joint's pose (N, 4, 4), and the k joints that move it with origins and axes, (N, 3, k).

    Attributes:
        body: The body.
        pose: The pose of its joint.
        joints: Numbers of the joints that move it.
        slides: Which of them slide, (k,).
        origins: Their origins.
        axes: Their axes, of unit length.
    """

    body: Body
    pose: np.ndarray
    joints: list[int]
    slides: np.ndarray
    origins: np.ndarray
    axes: np.ndarray


class _Link(NamedTuple):
    """A link at N postures: the joints that move it, its rotation (N, 3, 3) and its Jacobians (N, 3, k)."""

    inertial: Inertial
    joints: list[int]
    rotation: np.ndarray
    J_v: np.ndarray
    J_w: np.ndarray


def postures(arm: Arm, count: int = POSTURES) -> np.ndarray:
    """Return postures within the limits of the free joints, (count, n): the zero posture first, then random ones."""
    bodies = moving_bodies(arm)
    low, high = np.array([_position_range(body) for body in bodies]).T
    drawn = np.random.default_rng(0).uniform(low, high, (count, len(bodies)))
    drawn[0] = np.clip(0.0, low, high)
    return drawn


def mass_matrix(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return the mass matrix [kg m^2], (N, n, n), at postures q (N, n), joints in the order of :func:`moving_bodies`.

    With J_v and J_w the Jacobians of the centre of mass of a link and of its rotation, it is the sum of
    m J_v' J_v + J_w' R I R' J_w.
    """
    count, n = q.shape
    M = np.zeros((count, n, n))
    for link in _place_links(arm, q):
        J_v, joints, turned = link.J_v, link.joints, link.rotation.swapaxes(1, 2) @ link.J_w
        of_link = link.inertial.mass * J_v.swapaxes(1, 2) @ J_v + turned.swapaxes(1, 2) @ link.inertial.inertia @ turned
        M[np.ix_(range(count), joints, joints)] += of_link
    return M


def gravity_torque(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return the gravity torque [N m], (N, n), at postures q (N, n): the sum of m J_v' (0, 0, 9.81)."""
    g = np.zeros(q.shape)
    for link in _place_links(arm, q):
        g[:, link.joints] += link.inertial.mass * GRAVITY * link.J_v[:, 2]
    return g


def _place_links(arm: Arm, q: np.ndarray) -> Iterator[_Link]:
    """Yield the links that have a mass, at postures q (N, n)."""
    for placed in _place_bodies(arm, q):
        for link, pose in placed.body.poses.items():
            if (inertial := arm.links[link].inertial) is not None:
                own = pose if inertial.origin is None else pose @ inertial.origin
                yield _place_link(inertial, placed, placed.pose @ own)


def _place_link(inertial: Inertial, placed: _Placed, centre: np.ndarray) -> _Link:
    """Return a link with its Jacobians; ``centre`` is the pose of its centre of mass, (N, 4, 4)."""
    slides, axes = placed.slides, placed.axes
    J_v = np.where(slides, axes, np.cross(axes, centre[:, :3, 3, None] - placed.origins, axis=1))
    return _Link(inertial, placed.joints, centre[:, :3, :3], J_v, np.where(slides, 0.0, axes))


def _place_bodies(arm: Arm, q: np.ndarray) -> Iterator[_Placed]:
    """Yield the bodies at postures q (N, n), from the root outwards."""
    holder: dict[str, _Placed] = {}
    for i, body in enumerate(moving_bodies(arm)):
        joint, inner = body.joint, holder.get(body.joint.parent)
        before = link_pose(arm, joint.parent) if inner is None else inner.pose @ inner.body.poses[joint.parent]
        pose = before @ (np.eye(4) if joint.origin is None else joint.origin) @ _motion(body, q[:, i])
        joints, slides = [i], np.array([joint.type == "prismatic"])
        origins, axes = pose[:, :3, 3, None], (pose[:, :3, :3] @ _unit(body))[..., None]
        if inner is not None:
            joints, slides = [*inner.joints, i], np.append(inner.slides, slides)
            origins, axes = np.dstack([inner.origins, origins]), np.dstack([inner.axes, axes])
        placed = _Placed(body, pose, joints, slides, origins, axes)
        holder |= dict.fromkeys(body.poses, placed)
        yield placed


def _motion(body: Body, position: np.ndarray) -> np.ndarray:
    """Return the transform of a joint at N positions, (N, 4, 4); Rodrigues' formula for one that turns."""
    motion, axis = np.tile(np.eye(4), (len(position), 1, 1)), _unit(body)
    if body.joint.type == "prismatic":
        motion[:, :3, 3] = position[:, None] * axis
        return motion
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
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
