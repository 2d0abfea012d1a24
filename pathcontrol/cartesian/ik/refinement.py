"""Refinement of the joint spline along a curve until the tolerance is kept."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.failure import place
from pathcontrol.cartesian.ik.inverse_kinematics import InverseKinematics, Samples
from pathcontrol.cartesian.ik.spline_deviation import VELOCITY, Deviations, deviations
from pathcontrol.errors import TaskError

_DEGREE = 5
_PIECES = 8  # intervals to begin with, at least
_PROBES = np.array([0.2, 0.5, 0.8])  # places of the probes, as shares of an interval
#: of an interval: where it is verified, at its ends, where derivatives are most off, and between, at none of the probes
_CHECKS = np.concatenate([[0.0], (np.arange(16) + 0.5 * (5**0.5 - 1)) / 16, [1.0]])
_VERIFIED = 0.7  # largest share of the tolerance there; between points so close it is not much larger
_SHARE = 0.5  # share of the tolerance allowed at the probes; the rest is kept for the points between them
_QUARTER = (
    50.0  # an interval with so many times the allowed error is cut in four: the error falls with a power of its length
)
_SMALLEST = 1e-8  # part of the curve: cutting a shorter interval does not help
_MOST_KNOTS = 300_000
_GRADING = 3.0  # largest ratio of neighbouring intervals; interpolation by quintic splines is unstable far above it


class Refined(NamedTuple):
    """A joint spline that keeps the tolerance.

    Attributes:
        spline: q_d(s) [rad], of degree 5, four times continuously differentiable.
        mesh: its knots and, for a closed path, the return to the first [m], (K,).
        rounds: how often knots were added.
        checks: where the tolerance was verified [m], (C,).
        deviations: what was found there, each (C,).
    """

    spline: BSpline
    mesh: Array
    rounds: int
    checks: Array
    deviations: Deviations


def refine(kinematics: InverseKinematics, known: Samples, closed: bool) -> Refined:
    """Return the spline through postures on the curve, with knots added until the tolerance is kept.

    It begins with the knots of the curve, where p''' jumps. The tool's velocity is kept too, within 0.1 % of p'.

    Raises:
        TaskError: the curve cannot be followed, or not with 300 000 knots.
    """
    constraint, curve, rounds = kinematics.constraint, kinematics.constraint.curve, 0
    mesh = first_mesh(curve.knots, curve.length / _PIECES)
    while True:
        known = kinematics.fill(known, mesh)
        spline = _interpolant(known, closed)
        worst, _, _ = _worst(constraint, spline, mesh, _PROBES)
        worst = worst / _SHARE
        if (worst <= 1).all():
            worst, checks, found = _worst(constraint, spline, mesh, _CHECKS, conditioned=True)
            worst = worst / _VERIFIED
            if (worst <= 1).all():
                return Refined(spline, mesh, rounds, checks, found)
        _check_progress(constraint, mesh, worst)
        mesh, rounds = grade(subdivide(mesh, np.select([worst > _QUARTER, worst > 1], [4, 2], 1))), rounds + 1


def _interpolant(known: Samples, closed: bool) -> BSpline:
    """Return the spline through postures, periodic for a closed curve."""
    if not closed:
        return make_interp_spline(known.s, known.q, k=_DEGREE)
    ring = np.concatenate([known.q[:-1], known.q[:1]])
    return make_interp_spline(known.s, ring, k=_DEGREE, bc_type="periodic")


def _worst(
    constraint: ToolConstraint, spline: BSpline, mesh: Array, fractions: Array, conditioned: bool = False
) -> tuple[Array, Array, Deviations]:
    """Return the largest deviation of each interval as a multiple of what is allowed, its place, and all deviations."""
    s = points_between(mesh, fractions)
    found = deviations(constraint, spline, s.ravel(), conditioned)
    position, angle = constraint.tolerance
    excess = np.maximum.reduce([found.position / position, found.angle / angle, found.velocity / VELOCITY])
    return excess.reshape(s.shape).max(-1), s.ravel(), found


def _check_progress(constraint: ToolConstraint, mesh: Array, worst: Array) -> None:
    """Check that another round of refinement can help."""
    i = int(np.argmax(worst))
    if len(mesh) > _MOST_KNOTS or mesh[i + 1] - mesh[i] < _SMALLEST * constraint.curve.length:
        raise TaskError(
            f"the path of the joints does not come within the tolerance of the curve with {len(mesh)} knots: near "
            f"{place(constraint, float(mesh[i]))}, it is still {worst[i]:.3g} times too far off; the curve or the "
            "orientation along it may have a kink there (both have to be smooth), or the tolerance is too small",
            argument="tolerance",
            value=constraint.tolerance,
            s=float(mesh[i]),
        )


def first_mesh(knots: Array, longest: float) -> Array:
    """Return the knots of a curve, graded, with intervals of at most ``longest``."""
    pieces = np.maximum(1, np.ceil(np.diff(knots) / longest - 1e-9)).astype(int)
    return grade(subdivide(knots, pieces))


def subdivide(mesh: Array, pieces: Array) -> Array:
    """Cut each interval of a mesh (K,) into equal ``pieces`` (K − 1,)."""
    left, step = np.repeat(mesh[:-1], pieces), np.repeat(np.diff(mesh) / pieces, pieces)
    rank = np.arange(len(left)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(left + rank * step, mesh[-1])


def grade(mesh: Array) -> Array:
    """Halve intervals of a mesh until none is much longer than its neighbour."""
    while True:
        steps = np.diff(mesh)
        beside = np.minimum(np.append(steps[1:], np.inf), np.append(np.inf, steps[:-1]))
        coarse = steps > _GRADING * beside
        if not coarse.any():
            return mesh
        mesh = subdivide(mesh, 1 + coarse)


def points_between(mesh: Array, fractions: Array) -> Array:
    """Return the points at ``fractions`` (k,) of each interval, (K − 1, k)."""
    return mesh[:-1, None] + np.diff(mesh)[:, None] * fractions
