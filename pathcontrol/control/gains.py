"""The forms of gains: one number, a diagonal, or one for each rollout; all are checked and read-only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_finite, freeze, strip_labels
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel


def diagonal_gain(name: str, value: ArrayLike, n: int, joints: Sequence[str] | None = None) -> Array:
    """Return the diagonal of a diagonal, positive definite gain matrix.

    Args:
        name: what the gain is called in errors.
        value: a number for all joints, the diagonal (n,), or the matrix itself, (n, n), as ``np.diag([800, 600])``;
            (N, n) has a row for each rollout. Where N = n, an array with zeros, or one that is symmetric and in which
            the diagonal exceeds the rest of each row, is a matrix, and any other has rows; (N, 1, n) always has rows.
        n: number of joints.
        joints: their names, by which values that are labelled are put in order.

    Raises:
        InputError: it has another shape, is not positive, or is a matrix that is not diagonal.
    """
    given = value if joints is None else strip_labels(name, value, joints)
    array = _diagonal_of_matrix(name, check_finite(name, as_array(name, given)), n)
    if array.ndim and array.shape[-1] not in (1, n):
        raise InputError(
            f"{name} has shape {array.shape}, expected a scalar, its diagonal ({n},) or a diagonal matrix ({n}, {n})",
            argument=name,
            value=value,
        )
    return _check_positive(name, array)


def joint_gains(robot: RobotModel, **gains: ArrayLike) -> Iterator[Array]:
    """Yield the diagonals of gain matrices for the joints of an arm, by :func:`diagonal_gain`, in their order."""
    yield from (diagonal_gain(name, value, robot.n, robot.joint_names) for name, value in gains.items())


def scalar_gain(name: str, value: ArrayLike) -> Array:
    """Return a gain that is the same for all joints: a number k, the matrix kI, or (N, 1) with one for each rollout.

    Raises:
        InputError: it has another shape, is not positive, or is a matrix other than kI.
    """
    array = check_finite(name, as_array(name, value))
    array = _diagonal_of_matrix(name, array, array.shape[-1] if array.ndim > 1 else 1)
    if np.ndim(value) > 1 and array.ndim == 1 and (array == array[0]).all():
        array = array[:1]
    if array.ndim and array.shape[-1] != 1:
        raise InputError(
            f"{name} = {np.asarray(value).tolist()}, expected a scalar: the Lyapunov function (42) is for one "
            f"gain; give one {name}, or weigh the joints with K_v",
            argument=name,
            value=value,
        )
    return _check_positive(name, array)


def rollout_gain(name: str, value: ArrayLike) -> Array:
    """Return a gain that is one number, (), or has one for each rollout, (N, 1), given as (N,) or (N, 1); read-only.

    Raises:
        InputError: it is no finite number, or has other axes.
    """
    array = check_finite(name, as_array(name, value))
    if array.ndim > 2 or (array.ndim == 2 and array.shape[1] != 1):
        raise InputError(
            f"{name} has shape {array.shape}, expected a number, or one for each rollout, (N,) or (N, 1)",
            argument=name,
            value=value,
        )
    return freeze(array[:, None] if array.ndim == 1 else array)


def each_rollout(gain: Array) -> Array:
    """Return a gain of :func:`rollout_gain` as one number, (), or (N,), for numbers that have no joints."""
    return gain[..., 0] if gain.ndim else gain


def positive_rollout_gain(name: str, value: ArrayLike) -> Array:
    """Return a gain greater than 0 that is one number for all joints, (), or of each rollout, (N, 1); read-only.

    Raises:
        InputError: it is no finite number, is not positive, or has other axes, as one for each joint would.
    """
    if np.ndim(value) == 1 and np.size(value) > 1:
        raise InputError(
            f"{name} = {np.asarray(value).tolist()}, expected one number for all joints; gains of several rollouts are "
            "rows, (N, 1)",
            argument=name,
            value=value,
        )
    return _check_positive(name, rollout_gain(name, value))


def _diagonal_of_matrix(name: str, array: Array, n: int) -> Array:
    """Return ``array`` with its diagonal in place of a matrix (n, n), and (N, n) in place of (N, 1, n)."""
    if array.ndim == 3 and array.shape[1:] == (1, n):
        return array[:, 0]
    if n < 2 or array.shape != (n, n) or not _is_matrix(array):
        return array
    diagonal = array.diagonal()
    if np.count_nonzero(array - np.diag(diagonal)):
        raise InputError(
            f"{name} = {array.tolist()} is a matrix that is not diagonal; the theorems ask for diagonal gains: "
            f"give its diagonal, as {name} = {diagonal.tolist()} (gains of {n} rollouts are rows, "
            f"({n}, 1, {n}))",
            argument=name,
            value=array.tolist(),
        )
    return diagonal


def _is_matrix(array: Array) -> bool:
    """Tell a gain matrix (n, n) from the gains of n rollouts, one row each, which contain no zeros."""
    off = np.abs(array - np.diag(array.diagonal())).sum(-1)
    return bool((array == 0).any() or ((array == array.T).all() and (array.diagonal() > off).all()))


def _check_positive(name: str, array: Array) -> Array:
    """Check that all gains are greater than 0; return them read-only."""
    if (array <= 0).any():
        raise InputError(
            f"{name} = {array.tolist()}, expected gains greater than 0", argument=name, value=array.tolist(), limit=0.0
        )
    return freeze(array)
