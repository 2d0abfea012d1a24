"""Pinocchio's algorithms for one configuration or a batch, with their work space."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array
from pathcontrol.errors import InputError


class RigidBody:
    """A ``pin.Model`` with its data, and copies of both for each thread.

    The transpose of a C-ordered (N, n) array is the (n, N) array Pinocchio's batched calls want, so nothing is copied
    on the way.

    Args:
        model: the ``pin.Model``; do not change it.
        threads: threads used by batched calls.
    """

    def __init__(self, model: Any, threads: int) -> None:
        self.model, self.n, self.data = model, model.nv, model.createData()
        self._joints = tuple(model.names)[1:]
        self._threads = threads

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Return τ [N m] of (q, q̇, q̈), (*batch, n), by the recursive Newton–Euler algorithm."""
        return self._of(pin.rnea, pin.rneaInParallel, ("q", "qd", "qdd"), q, qd, qdd)

    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> Array:
        """Return q̈ [rad/s²] of (q, q̇, τ), (*batch, n), by the articulated-body algorithm."""
        return self._of(_aba, pin.abaInParallel, ("q", "qd", "tau"), q, qd, tau)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return M(q) [kg m²], (*batch, n, n), by the composite rigid body algorithm."""
        array = as_joint_array("q", q, self.n, self._joints)
        M = np.empty((array.size // self.n, self.n, self.n))
        for k, qi in enumerate(array.reshape(-1, self.n)):
            M[k] = pin.crba(self.model, self.data, qi)
        return M.reshape(*array.shape, self.n)

    def _of(self, one: Callable[..., Any], many: Callable[..., Any], names: Sequence[str], *values: Any) -> Array:
        """Apply an algorithm, given for one configuration and for many, to (*batch, n) arguments that broadcast."""
        if not _fit(self.n, *values):
            values = tuple(broadcast(self.n, dict(zip(names, values, strict=True)), self._joints))
        a, b, c = values
        out: Array = np.empty(a.shape)
        if out.size == self.n:  # one configuration is not worth the threads' overhead
            out[...] = one(self.model, self.data, a.ravel(), b.ravel(), c.ravel())
        elif out.size:
            many(self._threads, self._pool, *(array.reshape(-1, self.n).T for array in (a, b, c, out)))
        return out

    @cached_property
    def _pool(self) -> Any:
        return pin.ModelPool(self.model, self._threads)


def _fit(n: int, a: Any, b: Any, c: Any) -> bool:
    """Return whether three arguments are arrays of doubles of one shape (*batch, n), as in each step of a run."""
    if not (type(a) is type(b) is type(c) is np.ndarray and a.dtype == b.dtype == c.dtype == np.float64):
        return False
    return bool(a.shape == b.shape == c.shape and a.shape[-1:] == (n,))


def broadcast(n: int, arguments: Mapping[str, ArrayLike], joints: Sequence[str] | None = None) -> list[Array]:
    """Broadcast arguments (*batch, n) to one shape, each in the order of the ``joints``.

    Raises:
        InputError: one of them has another last axis than n, or their batch axes do not fit together.
    """
    arrays = [as_joint_array(name, value, n, joints) for name, value in arguments.items()]
    shapes = [a.shape for a in arrays]
    if shapes.count(shapes[0]) == len(shapes):
        return arrays
    try:
        shape = np.broadcast_shapes(*shapes)
    except ValueError as error:
        said = ", ".join(f"{name} {shape}" for name, shape in zip(arguments, shapes, strict=True))
        raise InputError(f"the batch axes do not fit together: {said}") from error
    return [_repeat(a, shape) for a in arrays]


def _repeat(array: Array, shape: tuple[int, ...]) -> Array:
    """Return an array repeated to a shape; a copy, as a view without strides costs more where it is read."""
    if array.shape == shape:
        return array
    out = np.empty(shape)
    out[...] = array
    return out


def _aba(*arguments: Any) -> Array:
    """Compute forward dynamics in the convention of :func:`pin.abaInParallel`, to get the same bits."""
    return pin.aba(*arguments, pin.Convention.WORLD)
