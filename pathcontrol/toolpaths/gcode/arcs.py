"""Arcs of G-code: from a start to an end about a centre, which I J K or R give."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.arc import Arc
from pathcontrol.toolpaths.gcode.modes import Modes
from pathcontrol.toolpaths.gcode.units import Unit
from pathcontrol.toolpaths.text import MAX_COORDINATE

#: axes of each plane, first, second and normal: counter-clockwise, seen from the normal's tip, is from first to second
PLANES = {170: (0, 1, 2), 180: (2, 0, 1), 190: (1, 2, 0)}
_NAMES = {170: "G17", 180: "G18", 190: "G19"}
_LEAST_RADIUS = 1.27e-6  # m, LinuxCNC's radius tolerance
_NOTHING = 1e-9  # m


def arc(
    start: Sequence[float], end: Sequence[float], words: Mapping[str, float], modes: Modes, *, clockwise: bool
) -> Arc:
    """The arc from ``start`` to ``end`` [m], (3,), a helix where they differ along the plane's normal.

    By I J K the radii at the ends may differ, since files are rounded: by 0.005 mm or 0.0005 in, or by 0.1 % of the
    radius up to a hundred times that (LinuxCNC, G-Codes, Center Format Arcs). The difference grows in along the arc,
    which meets both ends.

    Args:
        start: where it begins.
        end: where it ends; the same point in the plane is a full turn.
        words: I, J and K, or R, in the file's unit.
        modes: the plane, how centres are meant, and the unit.
        clockwise: G2 and not G3, seen from the positive end of the axis normal to the plane.

    Raises:
        ToolpathError: there is no such arc.
    """
    a, b, normal = PLANES[modes.plane]
    first, last = (start[a], start[b]), (end[a], end[b])
    if "R" in words:
        center = _by_radius(first, last, words, modes, clockwise)
    else:
        center = _by_offsets(first, last, words, modes)
    if not all(abs(coordinate) <= MAX_COORDINATE for coordinate in center):  # nor is a NaN
        raise ToolpathError(f"the arc's centre is further than {MAX_COORDINATE:g} m from the origin; write a line, G1")
    x, y, middle, rise = [0.0] * 3, [0.0] * 3, list(start), [0.0] * 3
    (x[a], x[b]), (middle[a], middle[b]) = (first[0] - center[0], first[1] - center[1]), center
    y[a], y[b] = -x[b], x[a]
    sweep = _sweep(first, last, center, clockwise)
    cos, sin = math.cos(sweep), math.sin(sweep)
    for axis in (a, b, normal):
        rise[axis] = end[axis] - (middle[axis] + cos * x[axis] + sin * y[axis])
    return Arc(middle, x, y, 0.0, sweep, rise)  # type: ignore[arg-type]


def _sweep(first: Sequence[float], last: Sequence[float], center: Sequence[float], clockwise: bool) -> float:
    """Angle from the first to the last point about the centre [rad], counter-clockwise positive, never 0."""
    begin = math.atan2(first[1] - center[1], first[0] - center[0])
    angle = math.atan2(last[1] - center[1], last[0] - center[0]) - begin
    sweep = (-angle if clockwise else angle) % math.tau
    if sweep * math.dist(first, center) <= _NOTHING:
        sweep = math.tau
    return -sweep if clockwise else sweep


def _by_offsets(
    first: Sequence[float], last: Sequence[float], words: Mapping[str, float], modes: Modes
) -> tuple[float, float]:
    letters = ["IJK"[axis] for axis in PLANES[modes.plane][:2]]
    given = [letter for letter in "IJK" if letter in words]
    if not given or not set(given) <= set(letters) or (modes.absolute_centers and len(given) < 2):
        raise ToolpathError(
            f"an arc in the plane of {_NAMES[modes.plane]} with {' and '.join(given) or 'no centre'}, expected "
            f"{(' and ' if modes.absolute_centers else ' or ').join(letters)}, or R, in the line of each arc"
        )
    offset = [modes.length(letter, words.get(letter, 0.0)) for letter in letters]
    center = (offset[0], offset[1]) if modes.absolute_centers else (first[0] + offset[0], first[1] + offset[1])
    _check_radii(math.dist(first, center), math.dist(last, center), modes.known_unit("the arc"))
    return center


def _check_radii(first: float, last: float, unit: Unit) -> None:
    if min(first, last) < _LEAST_RADIUS:
        raise ToolpathError("the arc's centre is its start or its end, expected a radius greater than 0")
    error = abs(first - last)
    if error > 100 * unit.tolerance or (error > unit.tolerance and error > 1e-3 * max(first, last)):
        raise ToolpathError(
            f"the arc's radius is {unit.text(first)} at its start and {unit.text(last)} at its end, expected the same; "
            "is the centre relative to the start, G91.1, or absolute, G90.1?"
        )


def _by_radius(
    first: Sequence[float], last: Sequence[float], words: Mapping[str, float], modes: Modes, clockwise: bool
) -> tuple[float, float]:
    if not words.keys().isdisjoint("IJK"):
        raise ToolpathError("an arc with R and with I, J or K, expected one of the two")
    unit = modes.known_unit("the arc")
    radius, chord = unit.scale * words["R"], math.dist(first, last)
    if chord <= _NOTHING:
        raise ToolpathError("an arc with R ends in the plane where it begins; write a full circle with its centre")
    half = min(chord / 2, abs(radius))
    if chord / 2 - half > _LEAST_RADIUS:
        raise ToolpathError(
            f"an arc of radius {unit.text(abs(radius))} between points {unit.text(chord)} apart, expected a radius of "
            "at least half of that"
        )
    height = math.sqrt((abs(radius) - half) * (abs(radius) + half)) / chord
    left = -height if clockwise == (radius > 0) else height
    return (
        (first[0] + last[0]) / 2 - left * (last[1] - first[1]),
        (first[1] + last[1]) / 2 + left * (last[0] - first[0]),
    )
