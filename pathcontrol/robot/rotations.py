"""Rotations as matrices and quaternions (x, y, z, w), without SciPy, which takes longer to load than a film to make."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array


def rotation_of_rpy(rpy: ArrayLike) -> Array:
    """Return the rotation matrix (3, 3) of roll, pitch and yaw [rad], as in a URDF: about fixed x, then y, then z."""
    roll, pitch, yaw = np.asarray(rpy, dtype=np.float64)
    return np.asarray(pin.rpy.rpyToMatrix(roll, pitch, yaw))


def rotation_of_quaternion(quaternion: ArrayLike) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion (x, y, z, w)."""
    return np.asarray(pin.Quaternion(np.asarray(quaternion, dtype=np.float64)).toRotationMatrix())


def rotation_between(start: ArrayLike, end: ArrayLike) -> Array:
    """Return the smallest rotation, (3, 3), that turns the direction of ``start`` (3,) into that of ``end`` (3,)."""
    vectors = (np.asarray(vector, dtype=np.float64) for vector in (start, end))
    return np.asarray(pin.Quaternion.FromTwoVectors(*vectors).toRotationMatrix())


def quaternions_of(rotations: Array) -> Array:
    """Return the unit quaternions (x, y, z, w), (k, 4), of rotation matrices (k, 3, 3).

    R gives all products of the components of its quaternion v: 4vvᵀ, of which the column with the largest diagonal is
    taken (S. W. Shepperd, Journal of Guidance and Control 1, 1978).
    """
    products = np.empty((len(rotations), 4, 4))
    symmetric, trace = rotations + rotations.swapaxes(1, 2), np.trace(rotations, axis1=1, axis2=2)
    products[:, :3, :3] = symmetric + np.eye(3) * (1 - trace)[:, None, None]
    products[:, 3, 3] = 1 + trace
    for i, (j, k) in enumerate(((2, 1), (0, 2), (1, 0))):
        products[:, i, 3] = products[:, 3, i] = rotations[:, j, k] - rotations[:, k, j]
    largest = np.einsum("kii->ki", products).argmax(-1)
    columns = products[np.arange(len(rotations)), largest]
    return columns / np.linalg.norm(columns, axis=-1, keepdims=True)
