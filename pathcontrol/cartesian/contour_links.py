"""Connection of contours: the curves that stand for them, with rapids in between where they do not meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.toolpaths.smoothing.smooth import Corners, Smoothed, smooth

_MEET = 1e-7  # m


def link_contours(
    contours: Sequence[Contour], clearance: float, up: Array, tolerance: float, corner: Corners
) -> list[tuple[Contour, Smoothed]]:
    """Return the contours with the curves that stand for them, and rapids between those that do not meet.

    Each begins and ends as :func:`smooth_open` says, so that the tool is not lifted where contours meet. A rapid
    goes ``clearance`` [m] above the higher of its ends, along ``up``, across and down again; straight where the
    clearance is 0, for arms that move in a plane.
    """
    done: list[tuple[Contour, Smoothed]] = []
    for contour in contours:
        curves = smooth_open(contour, tolerance, corner)
        if done:
            last, first = done[-1][1].curves[-1], curves.curves[0]
            way = _rapid_points(last.position(last.s_end), first.position(first.s0), clearance, up)
            if way is not None:
                rapid = Contour((Polyline(way),), rapid=True, name=f"rapid to {contour.name or 'the next contour'}")
                done.append((rapid, smooth_open(rapid, tolerance, corner)))
        done.append((contour, curves))
    return done


def smooth_open(contour: Contour, tolerance: float, corner: Corners) -> Smoothed:
    """Smooth a contour to curves with exactly its ends, a closed one too: the arm rests there.

    The corner of a closed contour at its start is not blended: where the tool enters and leaves the material is up to
    the file.
    """
    return smooth(replace(contour, closed=False), tolerance, corner)


def _rapid_points(start: Array, end: Array, clearance: float, up: Array) -> Array | None:
    """Return the points (k, 3) of a rapid, None where its ends are the same."""
    if np.linalg.norm(end - start) < _MEET:
        return None
    if clearance == 0:
        return np.array([start, end])
    top = max(start @ up, end @ up) + clearance
    points = np.array([start, *(point + (top - point @ up) * up for point in (start, end)), end])
    return points[np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=-1) > _MEET)]
