"""Rounding and overshoot of an arm at the corners of a polyline that its path stands for.

At a corner c the polyline arrives along the unit vector a and leaves along b. The passes of several cycles are averaged
in parallel planes: for the rounding in those normal to a + b, for the overshoot in those normal to b. With the mean
pass x̄,

    round-off = min ‖x̄ − c‖,
    overshoot = max ‖x̄ − (c + wb)‖ over w = b·(x̄ − c) > 0, where x̄ is on the side of the leaving leg to which a points.

Both look no farther than the middle of the legs beside the corner.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_finite
from pathcontrol.analysis.compared_space import ComparedSpace
from pathcontrol.analysis.crossings import Motion, find_crossings
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import InputError
from pathcontrol.tasks.task import PathTask
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.segment import Polyline

LEAST_TURN = np.deg2rad(45.0)  # turns of a polyline below it are bends of a curve
_ROUNDING = 1e-9  # rad
_POINTS, _ROUNDS = 33, 7  # planes at once, and how often the interval between them is searched again
_REACH = 1.5  # half legs from a corner within which a pass is looked at
_WITHIN = 0.25  # of a lap or a path: how far the plan may be from a corner


class Corner(NamedTuple):
    """A corner of a polyline: its point, unit vectors along both legs, (d,) each, and the lengths of these."""

    point: Array
    arriving: Array
    leaving: Array
    before: float
    after: float

    @property
    def turn(self) -> float:
        """The angle between the legs' directions [rad]."""
        apart, sum_ = self.arriving - self.leaving, self.arriving + self.leaving
        return float(2 * np.arctan2(np.linalg.norm(apart), np.linalg.norm(sum_)))


def find_corners(path: PathTask, space: ComparedSpace, polyline: ArrayLike | None) -> list[Corner]:
    """Return the corners of a given ``polyline`` (k, d), or of the one that the path was made from, in order.

    That is :attr:`PathTask.polyline`, or for a :class:`ToolpathTask` the straight parts of its contours. Corners that
    turn by less than 45° are bends, and none.

    Raises:
        InputError: the polyline has another shape, or points that are the same.
    """
    if polyline is not None:
        return _corners_of(_check_polyline(polyline, path, space), path.period is not None)
    if not space.is_made_for(path):
        return []
    if path.polyline is not None:
        return _corners_of(path.polyline, path.period is not None)
    if isinstance(path, ToolpathTask):
        contours = [contour for contour in dict.fromkeys(path.contours) if not contour.rapid]
        chains = [chain for contour in contours for chain in _straight_parts(contour)]
        return [corner for chain in chains for corner in _corners_of(chain, closed=False)]
    return []


def place_corners(corners: Sequence[Corner], path: PathTask, space: ComparedSpace, samples: int = 4096) -> Array:
    """Return the s of the path where it is nearest to each corner, (k,), among evenly spread ``samples``."""
    lower, upper = path.one_traverse
    s = np.linspace(lower, upper, samples, endpoint=path.period is None)
    x = space.move(path.q_d(s), path.dq_d(s))[0]
    return np.array([s[np.linalg.norm(x - corner.point, axis=-1).argmin()] for corner in corners])


def measure_corner(cycles: Sequence[Motion], corner: Corner, s: Array, span: float) -> tuple[float, float]:
    """Return round-off and overshoot of the mean of several cycles; NaN where no cycle passes.

    Args:
        cycles: the motions.
        corner: the corner.
        s: the parameter of the path there in each cycle, counting laps.
        span: length of a lap, or of an open path, in s.
    """
    passes = [part for motion, at in zip(cycles, s, strict=True) if (part := _cut_pass(motion, corner, at, span))]
    if not passes:
        return np.nan, np.nan
    middle = corner.arriving + corner.leaving
    middle = middle / np.linalg.norm(middle)
    reach = 0.5 * min(corner.before, corner.after) * float(middle @ corner.leaving)
    outside = corner.arriving - (corner.arriving @ corner.leaving) * corner.leaving

    def nearness(u: Array) -> Array:
        return -np.linalg.norm(_mean_pass(passes, corner.point, middle, u) - corner.point, axis=-1)

    def beyond(w: Array) -> Array:
        away = _mean_pass(passes, corner.point, corner.leaving, w) - corner.point - w[:, None] * corner.leaving
        size = np.linalg.norm(away, axis=-1)
        return np.where(np.isnan(size) | (away @ outside > 0), size, 0.0)

    return -_maximize(nearness, -reach, reach), _maximize(beyond, 0.0, 0.5 * corner.after)


def _cut_pass(motion: Motion, corner: Corner, s: float, span: float) -> Motion | None:
    """Return the part of a motion that passes a corner, or None where it does not."""
    rows = np.flatnonzero(np.abs(motion.s - s) <= _WITHIN * span)
    if len(rows) < 2:
        return None
    part = slice(rows[0], rows[-1] + 1)
    distance = np.linalg.norm(motion.x[part] - corner.point, axis=-1)
    far = distance > _REACH * 0.5 * max(corner.before, corner.after)
    nearest = int(distance.argmin())
    if far[nearest]:
        return None
    first = np.flatnonzero(far[:nearest])[-1] if far[:nearest].any() else 0
    last = nearest + np.flatnonzero(far[nearest:])[0] if far[nearest:].any() else len(far) - 1
    cut = slice(rows[0] + first, rows[0] + last + 1)
    return Motion(motion.time[cut], np.zeros(cut.stop - cut.start), motion.x[cut], motion.v[cut])


def _mean_pass(passes: Sequence[Motion], point: Array, normal: Array, places: Array) -> Array:
    """Return the mean of passes where each first crosses planes at ``places`` (m,) along a normal, (m, d)."""
    centre, tangent = point + places[:, None] * normal, np.broadcast_to(normal, (len(places), len(normal)))
    found = []
    for motion in passes:
        crossings = find_crossings(motion, np.zeros(len(places)), centre, tangent, 1.0)
        found.append(crossings.of(motion.time, motion.x, motion.v))
    return np.asarray(np.mean(found, axis=0))


def _maximize(function: Callable[[Array], Array], low: float, high: float) -> float:
    """Return the largest value of a function of places (m,), found by grids ever finer; NaN where it has none."""
    best = np.nan
    for _ in range(_ROUNDS):
        places = np.linspace(low, high, _POINTS)
        values = function(places)
        if np.isnan(values).all():
            return best
        i = int(np.nanargmax(values))
        best = float(np.fmax(best, values[i]))
        low, high = places[max(i - 1, 0)], places[min(i + 1, _POINTS - 1)]
    return best


def _check_polyline(polyline: ArrayLike, path: PathTask, space: ComparedSpace) -> Array:
    """Check the given polyline; return its points, (k, d)."""
    points, d = check_finite("polyline", as_array("polyline", polyline)), 3 if space.tool is not None else path.n
    if points.ndim != 2 or len(points) < 3 or points.shape[1] != d:
        raise InputError(
            f"polyline has shape {points.shape}, expected (k, {d}) with k ≥ 3 points [{space.unit}]",
            argument="polyline",
            value=polyline,
        )
    ring = np.concatenate([points, points[:1]]) if path.period is not None else points
    if (np.diff(ring, axis=0) == 0).all(-1).any():
        raise InputError(
            "polyline has neighbours that are the same point; leave one of them out",
            argument="polyline",
            value=polyline,
        )
    return points


def _corners_of(points: Array, closed: bool) -> list[Corner]:
    """Return the corners of a polyline that turn by 45° or more."""
    ring = np.concatenate([points, points[:2]]) if closed else points
    legs = np.diff(ring, axis=0)
    lengths = np.linalg.norm(legs, axis=-1)
    units = legs / lengths[:, None]
    found = [
        Corner(ring[i + 1], units[i], units[i + 1], float(lengths[i]), float(lengths[i + 1]))
        for i in range(len(units) - 1)
    ]
    return [corner for corner in found if corner.turn >= LEAST_TURN - _ROUNDING]


def _straight_parts(contour: Contour) -> list[Array]:
    """Return the straight parts of a contour as polylines (k, 3); where it begins and ends the arm rests."""
    chains: list[list[Array]] = [[]]
    for segment in contour.segments:
        if not isinstance(segment, Polyline):
            chains.append([])
        elif chains[-1]:
            chains[-1].extend(segment.points[1:])
        else:
            chains[-1].extend(segment.points)
    return [np.array(chain) for chain in chains if len(chain) > 2]
