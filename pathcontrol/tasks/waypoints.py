"""A smooth path through waypoints, exactly or within a tolerance."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol._expect import expect_choice
from pathcontrol.arguments import Form, Speed, Unit
from pathcontrol.errors import InputError
from pathcontrol.tasks.spline import SplinePath

Parametrisation = Literal["centripetal", "chord", "uniform"]
_POWER = {"uniform": 0.0, "centripetal": 0.5, "chord": 1.0}


class WaypointPath(SplinePath):
    """The cubic spline through waypoints, twice continuously differentiable, open or closed.

    The parameter of waypoint i grows by ‖p_{i+1} − p_i‖^α from one to the next: α = ½ is the centripetal
    parametrisation, which makes neither cusps nor loops between waypoints that lie unevenly (Lee, Computer-Aided
    Design 21, 1989), α = 1 the chord length, α = 0 uniform. With a tolerance the waypoints are moved, to bend the path
    less: of all λ the largest for which min Σ‖y_i − p_i‖² + λ∫‖q_d''‖²ds keeps every ‖y_i − p_i‖ within
    the tolerance.

    Args:
        points: waypoints [rad], (m, n), m ≥ 2, or 3 for a closed path, no two neighbours the same.
        speed: path speed ‖q̇‖ [rad/s].
        closed: whether the path returns to its first point, which is not repeated.
        tolerance: largest distance from a waypoint [rad]; 0 to pass through each.
        parametrisation: ``"centripetal"``, ``"chord"`` or ``"uniform"``, or increasing parameters: one for each
            waypoint, and for a closed path one more for the return to the first.
    """

    def __init__(
        self,
        points: Annotated[ArrayLike, Form.POINTS, Unit("rad")],
        speed: Speed,
        closed: bool = False,
        tolerance: Annotated[float, Form.NOT_NEGATIVE, Unit("rad")] = 0.0,
        parametrisation: Parametrisation | Annotated[ArrayLike, Form.NUMBERS] = "centripetal",
    ) -> None:
        self.points = freeze(_check_points(points, closed))
        self.tolerance = as_scalar("tolerance", tolerance, least=0.0)
        ring = np.concatenate([self.points, self.points[:1]]) if closed else self.points
        self.parameters = freeze(_parameters(ring, parametrisation))
        if self.tolerance:
            ring = _smooth(self.parameters, ring, self.tolerance, closed)
        super().__init__(_interpolant(self.parameters, ring, closed), speed, closed)
        self._refuse_standstill()

    @property
    def polyline(self) -> Array:
        return self.points

    def _refuse_standstill(self) -> None:
        lower, upper = self.one_traverse
        slope = np.linalg.norm(self.dq_d(np.linspace(lower, upper, 16 * len(self.points) + 1)), axis=-1)
        if slope.min() < 1e-6 * np.abs(self.points).max(initial=1e-12) / (upper - lower):
            raise InputError(
                f"the path through these {len(self.points)} waypoints comes to a standstill (‖q_d'‖ falls to "
                f"{slope.min():.1e}); lower tolerance = {self.tolerance:g}, or move waypoints that turn straight back",
                argument="tolerance",
                value=self.tolerance,
            )


def _check_points(points: ArrayLike, closed: bool) -> Array:
    """Check the waypoints."""
    array = check_finite("points", as_array("points", points))
    least = 3 if closed else 2
    if array.ndim != 2 or len(array) < least:
        raise InputError(
            f"points have shape {array.shape}, expected (m, n) with at least {least} waypoints",
            argument="points",
            value=points,
        )
    ring = np.concatenate([array, array[:1]]) if closed else array
    same = np.flatnonzero((np.diff(ring, axis=0) == 0).all(-1))
    if same.size:
        i, j = int(same[0]), int((same[0] + 1) % len(array))
        hint = "; leave the first point out at the end of a closed path" if j == 0 else "; leave one of them out"
        raise InputError(
            f"points {i} and {j} are the same posture {array[i].tolist()}{hint}", argument="points", value=array[i]
        )
    return array


def _parameters(ring: Array, parametrisation: Parametrisation | ArrayLike) -> Array:
    """Return the parameters of the points."""
    if isinstance(parametrisation, str):
        expect_choice("parametrisation", parametrisation, get_args(Parametrisation), ", or an array")
        steps = np.linalg.norm(np.diff(ring, axis=0), axis=-1) ** _POWER[parametrisation]
        return np.concatenate([[0.0], np.cumsum(steps)])
    values = check_finite("parametrisation", as_array("parametrisation", parametrisation))
    if values.shape != (len(ring),) or not (np.diff(values) > 0).all():
        raise InputError(
            f"parametrisation has shape {values.shape}, expected {len(ring)} increasing parameters",
            argument="parametrisation",
            value=parametrisation,
        )
    return values


def _interpolant(s: Array, ring: Array, closed: bool) -> BSpline:
    """Return the C² cubic spline through ``ring``: periodic, or natural at the ends (q_d'' = 0)."""
    return make_interp_spline(s, ring, k=3, bc_type="periodic" if closed else "natural")


def _smooth(s: Array, ring: Array, tolerance: float, closed: bool) -> Array:
    """Return the points moved within ``tolerance`` so that the spline through them bends least."""
    points = ring[:-1] if closed else ring
    energies, modes = np.linalg.eigh(_bending(s, len(points), closed))
    energies, weights = np.maximum(energies, 0.0), modes.T @ points

    def moved(stiffness: float) -> Array:
        return modes @ (weights / (1 + stiffness * energies)[:, None])

    def largest_move(log_stiffness: float) -> float:
        return float(np.linalg.norm(moved(np.exp(log_stiffness)) - points, axis=-1).max())

    low, high = (np.log(factor / energies.max()) for factor in (1e-9, 1e18))
    for _ in range(60):  # bisection; the moves grow with the stiffness
        middle = 0.5 * (low + high)
        low, high = (middle, high) if largest_move(middle) <= tolerance else (low, middle)
    smooth = moved(np.exp(low))
    return np.concatenate([smooth, smooth[:1]]) if closed else smooth


def _bending(s: Array, m: int, closed: bool) -> Array:
    """Return the matrix K, (m, m), of ∫‖q_d''‖²ds = Σ yᵀKy over the spline through y."""
    unit = np.eye(m)
    bend = _interpolant(s, np.concatenate([unit, unit[:1]]) if closed else unit, closed).derivative(2)(s)
    left, right, step = bend[:-1], bend[1:], np.diff(s)[:, None, None]
    outer = [np.einsum("ki,kj->kij", a, b) for a, b in ((left, left), (left, right), (right, left), (right, right))]
    # q_d'' is linear between knots: Simpson's rule is exact
    return (step / 6 * (2 * outer[0] + outer[1] + outer[2] + 2 * outer[3])).sum(0)
