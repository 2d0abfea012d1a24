"""Arcs of G-code from a start to an end about a centre, given by I J K or R."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.modes import Modes
from pathcontrol.toolpaths.gcode.units import Unit
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.segment import SAME_POINT
from pathcontrol.toolpaths.text import MAX_COORDINATE

#: axes of each plane, first, second and normal: counter-clockwise, seen from the normal's tip, is from first to second
PLANES = {170: (0, 1, 2), 180: (2, 0, 1), 190: (1, 2, 0)}
_NAMES = {170: "G17", 180: "G18", 190: "G19"}
_LEAST_RADIUS = 1.27e-6  # m, LinuxCNC's radius tolerance
_MOST_TURNS = 1000


def arcs(
    start: Sequence[float], end: Sequence[float], words: Mapping[str, float], modes: Modes, *, clockwise: bool
) -> list[Arc]:
    """Return the arc from ``start`` to ``end`` [m], (3,), turn by turn; a helix if they differ along the normal.

    By I J K the radii at the ends may differ, since files are rounded: by 0.005 mm or 0.0005 in, or by 0.1 % of the
    radius up to a hundred times that (LinuxCNC, G-Codes, Center Format Arcs), or by the tolerance in ``modes``. The
    difference grows in along the arc, which meets both ends. P is the number of turns, the last of them the rest.

    Args:
        start: where it begins.
        end: where it ends; the same point in the plane is a full turn.
        words: I, J and K, or R, in the file's unit, and P.
        modes: the plane, how centres are meant, the unit and the tolerance.
        clockwise: G2 and not G3, seen from the positive end of the axis normal to the plane.

    Raises:
        ToolpathError: there is no such arc.
    """
    a, b, normal = PLANES[modes.plane]
    first, last = (start[a], start[b]), (end[a], end[b])
    by_radius = "R" in words
    center = (_center_by_radius if by_radius else _center_by_offsets)(first, last, words, modes, clockwise)
    if not all(abs(coordinate) <= MAX_COORDINATE for coordinate in center):  # false for NaN too
        raise ToolpathError(
            f"the arc's centre is further than {MAX_COORDINATE:g} m from the origin; write a line, G1",
            value=center,
            limit=MAX_COORDINATE,
        )
    if not by_radius:
        _check_normal(start[normal], end[normal], words, modes)
        _check_radii(first, last, center, words, modes)
    x, y, middle, rise = [0.0] * 3, [0.0] * 3, list(start), [0.0] * 3
    (x[a], x[b]), (middle[a], middle[b]) = (first[0] - center[0], first[1] - center[1]), center
    y[a], y[b] = -x[b], x[a]
    sweep = _sweep(first, last, center, clockwise)
    turns = _turns(words)
    sweep += math.copysign(math.tau * (turns - 1), sweep)
    cos, sin = math.cos(sweep), math.sin(sweep)
    for axis in (a, b, normal):
        rise[axis] = end[axis] - (middle[axis] + cos * x[axis] + sin * y[axis])
    share = [coordinate / turns for coordinate in rise]
    middles = [[c + k * r for c, r in zip(middle, share, strict=True)] for k in range(turns)]
    return [Arc(m, x, y, k * sweep / turns, sweep / turns, share) for k, m in enumerate(middles)]  # type: ignore[arg-type]


def _turns(words: Mapping[str, float]) -> int:
    """Return the number of turns of an arc, the last of which is the rest."""
    value = words.get("P", 1.0)
    if not 1 <= value <= _MOST_TURNS or value % 1:
        raise ToolpathError(
            f"P{value:g} is no number of turns of an arc, expected 1 to {_MOST_TURNS}",
            value=value,
            limit=(1, _MOST_TURNS),
        )
    return int(value)


def _check_normal(start: float, end: float, words: Mapping[str, float], modes: Modes) -> None:
    """Check that I, J and K do not move the centre along the normal of the plane."""
    letter = "IJK"[PLANES[modes.plane][2]]
    value = modes.length(letter, words.get(letter, 0.0))
    allowed = (0.0, start, end) if modes.absolute_centers else (0.0,)
    if min(abs(value - level) for level in allowed) > SAME_POINT:
        raise ToolpathError(
            f"{letter}{words[letter]:g} leads out of the plane of {_NAMES[modes.plane]}, where the arc's centre is: "
            "leave it out; the pitch of a helix follows from its end",
            value=words[letter],
        )


def _sweep(first: Sequence[float], last: Sequence[float], center: Sequence[float], clockwise: bool) -> float:
    """Return the angle from the first to the last point about the centre [rad], counter-clockwise positive, never 0."""
    begin = math.atan2(first[1] - center[1], first[0] - center[0])
    angle = math.atan2(last[1] - center[1], last[0] - center[0]) - begin
    sweep = (-angle if clockwise else angle) % math.tau
    if sweep * math.dist(first, center) <= SAME_POINT:
        sweep = math.tau
    return -sweep if clockwise else sweep


def _center_by_offsets(
    first: Sequence[float], last: Sequence[float], words: Mapping[str, float], modes: Modes, clockwise: bool
) -> tuple[float, float]:
    """Return the centre of an arc given by I J K."""
    letters = ["IJK"[axis] for axis in PLANES[modes.plane][:2]]
    given = [letter for letter in letters if letter in words]
    if not given or (modes.absolute_centers and len(given) < 2):
        found = [letter for letter in "IJK" if letter in words]
        raise ToolpathError(
            f"an arc in the plane of {_NAMES[modes.plane]} with {' and '.join(found) or 'no centre'}, expected "
            f"{(' and ' if modes.absolute_centers else ' or ').join(letters)}, or R, in the line of each arc"
        )
    return _center(first, words, modes, modes.absolute_centers)


def _center(first: Sequence[float], words: Mapping[str, float], modes: Modes, absolute: bool) -> tuple[float, float]:
    """Return the centre by I J K [m], absolute or relative to the start."""
    a, b = (modes.length("IJK"[axis], words.get("IJK"[axis], 0.0)) for axis in PLANES[modes.plane][:2])
    return (a, b) if absolute else (first[0] + a, first[1] + b)


def _check_radii(
    first: Sequence[float], last: Sequence[float], center: Sequence[float], words: Mapping[str, float], modes: Modes
) -> None:
    """Check that the centre is as far from the start as from the end of the arc."""
    radii = math.dist(first, center), math.dist(last, center)
    if min(radii) < _LEAST_RADIUS:
        raise ToolpathError("the arc's centre is its start or its end, expected a radius greater than 0")
    if not _are_equal(*radii, modes):
        other = _center(first, words, modes, not modes.absolute_centers)
        raise ToolpathError(
            _explain_unequal(*radii, modes, meant=_are_equal(math.dist(first, other), math.dist(last, other), modes))
        )


def _are_equal(first: float, last: float, modes: Modes) -> bool:
    """Return whether the radii at the ends of an arc [m] are the same up to rounding."""
    error, unit = abs(first - last), modes.known_unit("the arc")
    if error <= max(unit.tolerance, modes.arc_tolerance or 0.0):
        return True
    return error <= 100 * unit.tolerance and error <= 1e-3 * max(first, last)


def _explain_unequal(first: float, last: float, modes: Modes, *, meant: bool) -> str:
    """Return advice about radii [m] that differ, and whether the centre may be meant the other way."""
    unit, error = modes.known_unit("the arc"), abs(first - last)
    if meant:
        advice = "as a centre relative to the start, G91.1, or an absolute one, G90.1, it would be: say which before it"
    elif error <= 0.1 * max(first, last):
        advice = _advise_rounding(error, unit)
    else:
        advice = "are its centre, I J K, and its end those of one arc?"
    return (
        f"the arc's radius is {unit.text(first)} at its start and {unit.text(last)} at its end, expected the same; "
        f"{advice}"
    )


def _advise_rounding(length: float, unit: Unit) -> str:
    """Return the advice to allow for rounding by a length [m], which is rounded up to two digits."""
    step = 10.0 ** (math.floor(math.log10(length)) - 1)
    most = math.ceil(1.001 * length / step) * step
    return f"if the program's numbers are rounded, by up to {unit.text(most)}, read it with arc_tolerance={most:.3g}"


def _center_by_radius(
    first: Sequence[float], last: Sequence[float], words: Mapping[str, float], modes: Modes, clockwise: bool
) -> tuple[float, float]:
    """Return the centre of an arc given by R."""
    if not words.keys().isdisjoint("IJK"):
        raise ToolpathError("an arc with R and with I, J or K, expected one of the two")
    unit = modes.known_unit("the arc")
    radius, chord = unit.scale * words["R"], math.dist(first, last)
    if chord <= SAME_POINT:
        raise ToolpathError("an arc with R ends in the plane where it begins; write a full circle with its centre")
    half = min(chord / 2, abs(radius))
    missing = chord / 2 - half
    if missing > max(_LEAST_RADIUS, modes.arc_tolerance or 0.0):
        raise ToolpathError(
            f"an arc of radius {unit.text(abs(radius))} between points {unit.text(chord)} apart, expected a radius of "
            f"at least half of that{f'; {_advise_rounding(missing, unit)}' if missing < 0.1 * half else ''}",
            value=radius,
            limit=chord / 2,
        )
    height = math.sqrt((abs(radius) - half) * (abs(radius) + half)) / chord
    left = -height if clockwise == (radius > 0) else height
    return (
        (first[0] + last[0]) / 2 - left * (last[1] - first[1]),
        (first[1] + last[1]) / 2 + left * (last[0] - first[0]),
    )
