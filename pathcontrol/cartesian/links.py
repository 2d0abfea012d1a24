"""Ways from the end of one contour to the start of the next, where a file gives none."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.segments import Polyline

_MEET = 1e-7  # m


def linked(toolpath: Toolpath, clearance: float) -> list[Contour]:
    """The contours, each beginning where the one before it ends: rapids are put in between where there is a gap.

    A rapid goes ``clearance`` [m] above the higher of the two points along z, across and down again; straight where the
    clearance is 0, for arms that move in a plane.
    """
    contours = [toolpath[0]]
    for contour in toolpath.contours[1:]:
        gap = _way(contours[-1].end, contour.start, clearance)
        if gap is not None:
            contours.append(Contour((Polyline(gap),), rapid=True, name="between contours"))
        contours.append(contour)
    return contours


def _way(start: Array, end: Array, clearance: float) -> Array | None:
    """Points (k, 3) on the way, None where there is nowhere to go."""
    if np.linalg.norm(end - start) < _MEET:
        return None
    if clearance == 0:
        return np.array([start, end])
    top = max(start[2], end[2]) + clearance
    above = [np.array([*point[:2], top]) for point in (start, end)]
    points = np.array([start, *above, end])
    return points[np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=-1) > _MEET)]
