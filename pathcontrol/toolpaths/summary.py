"""A summary of a toolpath in numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.smoothing.corners import corners


def summary(toolpath: Toolpath) -> dict[str, Any]:
    """Return contours, lengths, corners, feeds and bounding box in SI units, fit for JSON.

    ``contours`` has for each, in order: ``name``, ``length_m``, ``closed``, ``points``, ``corners`` (those that
    turn by more than 5°), ``sharpest_deg``, ``feed_m_s`` (null where the file gives none), ``rapid`` and ``bounds_m``.
    """
    return {
        "source": toolpath.source,
        "unit": toolpath.unit,
        "bounds_m": _bounds(toolpath),
        "cut_length_m": sum(contour.length for contour in toolpath.cuts),
        "rapid_length_m": sum(contour.length for contour in toolpath if contour.rapid),
        "contours": [_contour(contour) for contour in toolpath],
    }


def _contour(contour: Contour) -> dict[str, Any]:
    """Return the summary of a contour."""
    found = corners(contour)
    return {
        "name": contour.name,
        "length_m": contour.length,
        "closed": contour.closed,
        "points": contour.points,
        "corners": len(found),
        "sharpest_deg": float(np.rad2deg(max((corner.turn for corner in found), default=0.0))),
        "feed_m_s": contour.feed,
        "rapid": contour.rapid,
        "bounds_m": _bounds(contour),
    }


def _bounds(thing: Contour | Toolpath) -> list[list[float]]:
    """Return the corners of a bounding box as lists."""
    lower, upper = thing.bounds
    return [lower.tolist(), upper.tolist()]
