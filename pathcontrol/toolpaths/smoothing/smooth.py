"""Smoothing of a contour with corners to curves that a tool can follow without stopping in between."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, get_args

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._expect import expect, expect_choice
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.smoothing.bends import regularize
from pathcontrol.toolpaths.smoothing.corners import SHARP, TURN_BACK, Corner, corners, split
from pathcontrol.toolpaths.smoothing.knots import smooth_knots
from pathcontrol.toolpaths.tool_curve import ToolCurve

Corners = Literal["blend", "stop"]

_SHARE = 0.1  # of the tolerance, for polylines that stand for segments with sharp bends


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The smooth curves in place of a contour.

    Attributes:
        curves: one after another; more than one where the tool stops at corners.
        deviation: largest distance between contour and curves [m], on both.
        corners: the corners that were blended or stopped at.
        stops: how often the tool stops on its way, at corners; round a closed contour at its start too.
        normals: for each curve the tool axes given with the contour, as (s, unit vectors), or None.
    """

    curves: tuple[ToolCurve, ...]
    deviation: float
    corners: tuple[Corner, ...]
    stops: int
    normals: tuple[tuple[Array, Array] | None, ...]


def smooth(contour: Contour, tolerance: float = 1e-4, corner: Corners = "blend") -> Smoothed:
    """Return curves with continuous tangent and curvature within ``tolerance`` of a contour.

    Junctions where the tangent or the curvature jumps are replaced by quintic blends. Corners that turn by more than
    5° are blended as well, or else end one curve and begin the next; those that turn by more than 150° always do.
    Curves are parametrised nearly by arc length, 0.5 ≤ ‖p'‖ ≤ 2, and begin where their contour does: an open one or one
    with stops exactly, a closed one in the middle of the blend there.

    Args:
        contour: what is to be followed.
        tolerance: largest distance between contour and curves [m].
        corner: ``"blend"`` sharp corners or ``"stop"`` at them.

    Raises:
        InputError: the tolerance is not positive, or a segment cannot be resolved to 1 nm.
        UnknownNameError: ``corner`` is neither.
    """
    expect("contour", contour, Contour)
    tolerance = as_scalar("tolerance", tolerance, positive=True)
    expect_choice("corner", corner, get_args(Corners))
    parts = split(contour, TURN_BACK if corner == "blend" else SHARP)
    done = [piece for part in parts for piece in _pieces(part, tolerance)]
    curves, deviations, normals = zip(*done, strict=True)
    stops = 0 if curves[0].closed else len(curves) - (not contour.closed)
    return Smoothed(curves, max(deviations), tuple(corners(contour)), stops, normals)


_Piece = tuple[ToolCurve, float, tuple[Array, Array] | None]


def _pieces(contour: Contour, tolerance: float) -> Iterator[_Piece]:
    """Yield smooth curves for a contour that may still turn back inside its segments."""
    segments, apart = zip(*(regularize(segment, _SHARE * tolerance) for segment in contour.segments), strict=True)
    used = max(apart)
    for piece in split(replace(contour, segments=segments), TURN_BACK):
        knots, deviation, normals = smooth_knots(piece, tolerance - used)
        yield ToolCurve(*knots, closed=piece.closed), deviation + used, normals
