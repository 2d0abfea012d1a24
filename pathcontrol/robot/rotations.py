"""Rotations as matrices and quaternions (x, y, z, w), without SciPy, which takes longer to load than a film to make."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array

_WIDE = -0.9  # cosine of angles whose axis is better known from the symmetric part of the matrix
_NO_SINE = 1e-12  # rounding error of the sine of no turn, or of half a turn


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


def cross(a: Array, b: Array) -> Array:
    """Return the products a × b of rows (*batch, 3), as NumPy does, which takes three times as long for a few."""
    out = np.empty(a.shape)
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        out[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return out


def rotation_vectors_of(rotation: Array) -> Array:
    """Return the rotation vectors [rad], (*batch, 3), of rotation matrices (*batch, 3, 3)."""
    axis = 0.5 * (rotation[..., [2, 0, 1], [1, 2, 0]] - rotation[..., [1, 2, 0], [2, 0, 1]])
    cosine = 0.5 * (rotation[..., 0, 0] + rotation[..., 1, 1] + rotation[..., 2, 2] - 1)
    turn = scale_axis(axis, cosine)
    wide = cosine < _WIDE
    if wide.any():
        turn[wide] = _wide_turn(rotation[wide], axis[wide], cosine[wide])
    return turn


def _wide_turn(rotation: Array, axis: Array, cosine: Array) -> Array:
    """Return the rotation vector [rad] of turns by nearly or exactly π, (N, 3).

    R − Rᵀ vanishes there. The symmetric part has the axis a instead: ½(R + Rᵀ) = cos θ I + (1 − cos θ) a aᵀ. Of the two
    that it leaves, the sign is that of ``axis`` (N, 3), a sin θ; for half a turn both are right.
    """
    square = 0.5 * (rotation + rotation.swapaxes(-1, -2)) - cosine[:, None, None] * np.eye(3)
    largest = np.diagonal(square, axis1=-2, axis2=-1).argmax(-1)
    direction = np.take_along_axis(square, largest[:, None, None], axis=-1)[..., 0]
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    sign = np.where((direction * axis).sum(-1) < 0, -1.0, 1.0)
    angle = np.arctan2(np.linalg.norm(axis, axis=-1), cosine)
    return (sign * angle)[:, None] * direction


def scale_axis(axis: Array, cosine: Array) -> Array:
    """Return the rotation vector of an axis (N, 3) whose length is the sine of the angle, given its ``cosine``."""
    sine = np.sqrt((axis * axis).sum(-1))
    factor = np.divide(np.arctan2(sine, cosine), sine, out=np.ones_like(sine), where=sine > _NO_SINE)
    return factor[..., None] * axis
