"""Orientations of a tool along its curve: free, fixed, along the tangent, or against normals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation, Slerp

from pathcontrol._arrays import Array, as_array, check_finite, freeze
from pathcontrol.arguments import Direction, Form, Unit
from pathcontrol.errors import InputError
from pathcontrol.robot.rotations import cross, rotation_vectors_of, scale_axis
from pathcontrol.toolpaths.tool_curve import ToolCurve

_PARALLEL = 1e-6  # sine of an angle that counts as zero
_NO_SINE = 1e-12  # rounding error of the sine of no turn, or of half a turn


class Orientation(ABC):
    """The desired frame R_d(s) of the tool along a curve, all of it or its z axis only.

    Attributes:
        rows: how many rotations it prescribes: 3 (the frame), 2 (its z axis, about which the tool may turn) or 0.
    """

    rows: int = 3

    @abstractmethod
    def frames(self, curve: ToolCurve, s: Array) -> Array:
        """Return R_d(s), (N, 3, 3), at s (N,): its columns are the tool's axes in the base frame."""

    def error(self, curve: ToolCurve, s: Array, rotation: Array) -> tuple[Array, Array]:
        """Return the rotation e [rad] from R_d(s) to ``rotation`` (N, 3, 3), and de/dω where e = 0.

        With 3 rows e is the rotation vector of R R_dᵀ, with 2 that of the shortest rotation from R_d's z axis to the
        tool's, along R_d's x and y axes: (N, rows) and (N, rows, 3). ‖e‖ is the angle. ω is in axes parallel to the
        base's; ½‖e‖² has the gradient e with respect to it wherever e is defined.
        """
        wanted = self.frames(curve, s)
        return self.turn(wanted, rotation), self.slope(wanted)

    def turn(self, wanted: Array, rotation: Array) -> Array:
        """Return the rotation e of :meth:`error` from frames ``wanted`` (N, 3, 3) to ``rotation`` (N, 3, 3)."""
        if self.rows == 3:
            return rotation_vectors_of(rotation @ wanted.swapaxes(-1, -2))
        z, towards = rotation[..., :, 2], wanted[..., :, 2]
        axis, cosine = cross(towards, z), (towards * z).sum(-1)
        turn = scale_axis(axis, cosine)
        opposite = (np.linalg.norm(axis, axis=-1) <= _NO_SINE) & (cosine < 0)
        turn[opposite] = np.pi * wanted[opposite, :, 0]  # half a turn, about any axis across z
        return (self.slope(wanted) @ turn[..., None])[..., 0]

    def slope(self, wanted: Array) -> Array:
        """Return de/dω of :meth:`error` where the tool has the frames ``wanted`` (N, 3, 3)."""
        return np.broadcast_to(np.eye(3), wanted.shape) if self.rows == 3 else wanted[..., :, :2].swapaxes(-1, -2)

    def turning(self, wanted: Array, angular: Array) -> Array:
        """Return ∂e/∂q (N, rows, n) where the tool has the frames ``wanted``, given its angular Jacobian (N, 3, n)."""
        return angular if self.rows == 3 else self.slope(wanted) @ angular


class FreeOrientation(Orientation):
    """An orientation that is not prescribed: only the position of the tool is."""

    rows = 0

    def frames(self, curve: ToolCurve, s: Array) -> Array:
        return np.broadcast_to(np.eye(3), (*np.shape(s), 3, 3))

    def turn(self, wanted: Array, rotation: Array) -> Array:
        return np.empty((len(wanted), 0))

    def slope(self, wanted: Array) -> Array:
        return np.empty((len(wanted), 0, 3))


class FixedOrientation(Orientation):
    """An orientation that is the same all along the curve.

    Args:
        rotation: rotation matrix (3, 3) of the tool in the base frame, or a unit quaternion (x, y, z, w).
    """

    def __init__(self, rotation: Annotated[ArrayLike, Form.ARRAY]) -> None:
        given = check_finite("rotation", as_array("rotation", rotation))
        if given.shape not in ((3, 3), (4,)):
            raise InputError(
                f"rotation has shape {given.shape}, expected a matrix (3, 3) or a quaternion (x, y, z, w)",
                argument="rotation",
                value=rotation,
            )
        if given.shape == (4,) and not abs(np.linalg.norm(given) - 1) < 1e-6:
            raise InputError(
                f"rotation = {given.tolist()} has the norm {np.linalg.norm(given):g}, expected 1",
                argument="rotation",
                value=rotation,
            )
        matrix = Rotation.from_quat(given).as_matrix() if given.shape == (4,) else given
        if not (np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6) and np.linalg.det(matrix) > 0):
            raise InputError(
                "rotation is no rotation matrix: its columns are not orthonormal and right-handed",
                argument="rotation",
                value=rotation,
            )
        self.rotation = freeze(Rotation.from_matrix(matrix).as_matrix())

    def frames(self, curve: ToolCurve, s: Array) -> Array:
        return np.broadcast_to(self.rotation, (*np.shape(s), 3, 3))


class TangentOrientation(Orientation):
    """An orientation with the tool's x axis along the curve, and its z axis as near to ``up`` as possible.

    The frame turns with the curvature of the curve: q_d'' changes fast where the curvature does, at the ends of a
    blended corner for instance.

    Args:
        up: direction for z in the base frame, (3,), of any length; (0, 0, -1) for a tool that points downwards.

    Raises:
        InputError: on evaluation, where the tangent is parallel to ``up``.
    """

    def __init__(self, up: Direction = (0.0, 0.0, 1.0)) -> None:
        self.up = freeze(_direction("up", up))

    def frames(self, curve: ToolCurve, s: Array) -> Array:
        x = curve.tangent(s)
        z = _perpendicular(self.up, x, "the tangent", "up", s)
        return np.stack([x, np.cross(z, x), z], axis=-1)


class NormalOrientation(Orientation):
    """An orientation with the tool's z axis against given surface normals, so that it points into the surface.

    The rotation about z is left free, five constraints in all, unless a reference direction is given for x.

    Args:
        normals: directions of any length in the base frame: one for the whole curve, (3,); one for each parameter of
            ``at``, (k, 3), between which a C² cubic spline is drawn; or a function of s (N,) that gives (N, 3) and is
            twice continuously differentiable.
        at: increasing parameters s [m] of the normals, (k,), from the beginning of the curve to its end.
        reference: the x axis is as near to this direction (3,) as the normals allow; None for free.

    Raises:
        InputError: wrong shapes; on evaluation, normals that vanish, do not cover the curve, or are parallel to the
            reference.
    """

    def __init__(
        self,
        normals: Annotated[ArrayLike, Form.ARRAY] | Callable[[Array], Array],
        at: Annotated[ArrayLike, Form.NUMBERS, Unit("m")] | None = None,
        reference: Direction | None = None,
    ) -> None:
        self.reference = None if reference is None else freeze(_direction("reference", reference))
        self.rows = 2 if reference is None else 3
        self.at = None if at is None else freeze(check_finite("at", as_array("at", at)))
        self._normals = normals if callable(normals) else _interpolate(as_array("normals", normals), self.at)

    def frames(self, curve: ToolCurve, s: Array) -> Array:
        self._check_cover(curve)
        z = -_unit(np.asarray(self._normals(s), dtype=np.float64), s)
        if self.reference is None:
            x = _unit(np.cross(z, np.eye(3)[np.abs(z).argmin(-1)]), s)  # any direction across z will do
        else:
            x = _perpendicular(self.reference, z, "the normal", "reference", s)
        return np.stack([x, np.cross(z, x), z], axis=-1)

    def _check_cover(self, curve: ToolCurve) -> None:
        if self.at is not None and (self.at[0] > curve.s0 + 1e-9 or self.at[-1] < curve.s_end - 1e-9):
            raise InputError(
                f"the normals are given for s from {self.at[0]:g} to {self.at[-1]:g} m, but the curve goes from "
                f"{curve.s0:g} to {curve.s_end:g} m",
                argument="at",
                value=self.at,
                limit=(curve.s0, curve.s_end),
            )


def _interpolate(normals: Array, at: Array | None) -> Callable[[Array], Array]:
    """Return the normals as a function of s."""
    check_finite("normals", normals)
    if normals.shape == (3,):
        return partial(_constant, _direction("normals", normals))
    if normals.ndim != 2 or normals.shape[1] != 3 or at is None or at.shape != normals.shape[:1] or len(at) < 2:
        places = "no parameters at" if at is None else f"parameters at of shape {at.shape}"
        raise InputError(
            f"normals have shape {normals.shape} and {places}, expected (3,), or (k, 3) with parameters (k,), k ≥ 2; "
            "for normals at the knots of a curve: at=curve.knots",
            argument="normals",
            value=normals,
        )
    if not (np.diff(at) > 0).all():
        raise InputError("the parameters at of the normals do not increase", argument="at", value=at)
    unit = _unit(normals, at)
    periodic = len(at) > 2 and np.linalg.norm(unit[0] - unit[-1]) < _PARALLEL
    if periodic:
        unit = np.concatenate([unit[:-1], unit[:1]])
    return make_interp_spline(at, unit, k=3, bc_type="periodic" if periodic else "natural")


def _constant(direction: Array, s: Array) -> Array:
    """Return the same direction at all s, (*batch, 3)."""
    return np.broadcast_to(direction, (*np.shape(s), 3))


def _direction(name: str, value: ArrayLike) -> Array:
    """Check that a direction is a vector (3,) with a length; return it with unit length."""
    vector = check_finite(name, as_array(name, value))
    if vector.shape != (3,) or not np.linalg.norm(vector) > 0:
        raise InputError(
            f"{name} = {np.asarray(value).tolist()}, expected a direction (3,) with a length",
            argument=name,
            value=value,
        )
    return vector / np.linalg.norm(vector)


def _unit(vectors: Array, s: Array) -> Array:
    """Scale vectors to unit length; a zero vector is an error that names its s."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not (length > _PARALLEL).all():
        where = float(np.asarray(s)[int(np.argmin(length > _PARALLEL))])
        raise InputError(
            f"the normal at s = {where:g} m has no length; between opposite normals give more of them", s=where
        )
    return vectors / length


def _perpendicular(direction: Array, axis: Array, axis_name: str, name: str, s: Array) -> Array:
    """Return the unit vector normal to ``axis`` (N, 3) nearest to ``direction`` (3,)."""
    across = direction - (axis @ direction)[..., None] * axis
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    if (length < _PARALLEL).any():
        where = float(np.asarray(s)[int(np.argmin(length))])
        raise InputError(
            f"{axis_name} is parallel to {name} = {direction.tolist()} at s = {where:g} m; give another {name}",
            argument=name,
            value=direction,
            s=where,
        )
    return across / length


class TurningOrientation(Orientation):
    """A turn from one rotation to another about one axis, with gentle ends: twice continuously differentiable.

    Args:
        first: rotation matrix at the beginning of the curve, (3, 3).
        last: rotation matrix at its end, (3, 3).
    """

    def __init__(self, first: Array, last: Array) -> None:
        self._slerp = Slerp([0.0, 1.0], Rotation.from_matrix([first, last]))

    def frames(self, curve: ToolCurve, s: Array) -> Array:
        u = np.clip((np.asarray(s) - curve.s0) / curve.length, 0.0, 1.0)
        return self._slerp(np.clip(u**3 * (10 - 15 * u + 6 * u**2), 0.0, 1.0)).as_matrix()
