"""How far before and after a junction a quintic blend begins and ends.

A blend is the quintic that meets the contour a distance d before and after the junction with its tangent and
curvature there. It leaves the contour by less than a tolerance, which bounds d.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.corners import angles
from pathcontrol.toolpaths.curve import CurvePoint, ToolCurve

#: position, tangent and curvature vector at arc lengths (*batch,) [m] away from a junction
Arm = Callable[[Array], CurvePoint]

_SMOOTH = 1e-9  # rad; turns below it are none
_SAMPLES = 65


def blend_length(chord: Array, turn: Array) -> Array:
    """The length [m] of the arc of a circle with this chord [m] and turn [rad]: the parameter length of a blend."""
    half = 0.5 * np.asarray(turn)
    return np.where(half > 1e-6, chord * half / np.sin(np.maximum(half, 1e-6)), chord)


def straight_trims(turns: Array, tolerance: float) -> Array:
    """d [m] for corners between straight edges that turn by ``turns`` [rad], (k,).

    The blend passes the corner at e = d sin(θ/2)(1 − (5/16)θ cot(θ/2)), which is nowhere farther from the edges.
    """
    half = np.maximum(0.5 * turns, 0.5 * _SMOOTH)
    passes = np.sin(half) * (1 - 0.625 * half / np.tan(half))
    return np.where(turns > _SMOOTH, tolerance / passes, 0.0)


def junction_trim(before: Arm, after: Arm, longest: float, tolerance: float) -> float:
    """d [m], at most ``longest``, for a junction of any two segments; 0 where tangent and curvature go through."""
    zero = np.array(0.0)
    (_, t_a, k_a), (_, t_b, k_b) = before(zero), after(zero)
    turn, jump = float(angles(t_a, t_b)), float(np.linalg.norm(k_b - k_a))
    # a tenth of a nanometre away from the junction nothing shows
    if turn <= _SMOOTH and jump <= 1e-5 * (1 + np.linalg.norm(k_a) + np.linalg.norm(k_b)):
        return 0.0
    d = float(straight_trims(np.array([max(turn, 2 * _SMOOTH)]), tolerance)[0])
    d = min(longest, d, np.sqrt(20 * tolerance / max(jump, 1e-12)))
    for _ in range(60):
        if blend_deviation(before, after, d) <= tolerance:
            break
        d *= 0.75
    return d


def blend_deviation(before: Arm, after: Arm, d: float) -> float:
    """How far the blend and the stretch of contour that it replaces are apart [m] (Hausdorff distance)."""
    blend = blend_curve(before, after, d)
    curve = blend.position(np.linspace(blend.s0, blend.s_end, _SAMPLES))
    ways = np.linspace(0.0, d, _SAMPLES)
    contour = np.concatenate([before(ways[::-1]).p, after(ways[1:]).p])
    distance = np.linalg.norm(curve[:, None] - contour, axis=-1)
    # between samples of the contour it is nearer than to them by at most the half step's effect
    step = d / (_SAMPLES - 1)
    there = np.sqrt(np.maximum(distance.min(1) ** 2 - (0.5 * step) ** 2, 0.0)).max()
    corner = np.linalg.norm(curve - contour[_SAMPLES - 1], axis=-1).min()
    return float(max(there, corner))


def blend_curve(before: Arm, after: Arm, d: float) -> ToolCurve:
    """The blend over d [m] on either side."""
    (p_a, t_a, k_a), (p_b, t_b, k_b) = before(np.array(d)), after(np.array(d))
    chord = np.asarray(np.linalg.norm(p_b - p_a))
    length = float(blend_length(chord, angles(t_a, t_b)))
    return ToolCurve([0.0, length], [p_a, p_b], [t_a, t_b], [k_a, k_b])
