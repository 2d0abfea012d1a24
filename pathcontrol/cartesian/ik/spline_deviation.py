"""The deviation from the curve of a tool whose arm follows a joint spline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint

VELOCITY = 1e-3  # share of p' by which the tool's velocity may be off, in size and direction
_CHUNK = 1 << 14  # postures evaluated together


class Deviations(NamedTuple):
    """The deviations found at parameters s (N,), each (N,).

    Attributes:
        position: distance between the tool and p(s) [m], not less than that to the curve.
        angle: angle between the tool and its orientation at s [rad].
        velocity: ‖J_v q_d' − p'‖/‖p'‖.
        conditioning: smallest singular value of ∂f/∂q, of those that are not zero everywhere; (0,) if not asked for.
    """

    position: Array
    angle: Array
    velocity: Array
    conditioning: Array


def deviations(constraint: ToolConstraint, spline: BSpline, s: Array, conditioned: bool) -> Deviations:
    """Return the deviations at s (N,) of an arm led by q_d = ``spline``, with the conditioning or without."""
    slope, split = spline.derivative(), np.array_split(s, len(s) // _CHUNK + 1)
    parts = [_chunk(constraint, spline(part), slope(part), part, conditioned) for part in split]
    return Deviations(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def conditioning(constraint: ToolConstraint, spline: BSpline, s: Array) -> Array:
    """Return the conditioning of :class:`Deviations` alone, (N,)."""
    return _conditioning(constraint, constraint.slope(spline(s), constraint.target(s)))


def _conditioning(constraint: ToolConstraint, slope: Array) -> Array:
    return np.linalg.svd(slope, compute_uv=False)[:, constraint.rank - 1]


def _chunk(constraint: ToolConstraint, q: Array, dq: Array, s: Array, conditioned: bool) -> Deviations:
    f, jacobian = constraint.at(q, s)
    wanted = constraint.curve.at(s).dp
    velocity = constraint.length * (jacobian[:, :3] @ dq[..., None])[..., 0]
    off = np.linalg.norm(velocity - wanted, axis=-1) / np.linalg.norm(wanted, axis=-1)
    values = _conditioning(constraint, jacobian) if conditioned else np.empty(0)
    return Deviations(*constraint.deviation(f), off, values)
