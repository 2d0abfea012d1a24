"""Chaining of loose curves that meet end to end into contours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.drawing.pieces import NOTHING, contour_of, drop_repeated, ends_of
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline, Segment

_NEAR, _NEAR_SHARE = 1e-6, 1e-4  # m and of the drawing's diagonal, how near ends that belong together lie
_WIDEST_TOLD = 5e-5  # m, larger gaps are not noted


class Strand(NamedTuple):
    """The curves that one entity draws.

    Attributes:
        name: for the contour.
        layer: only strands of one layer are chained.
        place: its place in the drawing.
        segments: each begins where the one before ends.
    """

    name: str
    layer: str
    place: int
    segments: list[Segment]

    @property
    def ends(self) -> tuple[Array, Array]:
        """The first and the last point [m], each (3,)."""
        return ends_of(self.segments[0])[0], ends_of(self.segments[-1])[1]

    @property
    def extent(self) -> float:
        """The diagonal of a box around all control points [m]."""
        return _size([self])

    def contour(self, source: str, feed: float | None) -> Contour:
        """Return the contour of the strand.

        Raises:
            ToolpathError: its segments make none.
        """
        try:
            return contour_of(self.segments, feed, self.name)
        except InputError as error:
            raise ToolpathError(f"{source}, {self.name}: {error}", **error.details_with(file=source)) from error


def checked_gap(gap: float | None) -> float | None:
    """Check the option ``gap`` [m], not less than 0 or None, and return it.

    Raises:
        InputError: it is something else.
    """
    if gap is not None and as_scalar("gap", gap) < 0:
        raise InputError(f"gap = {gap!r} m, expected a length not less than 0", argument="gap", value=gap, limit=0.0)
    return gap


def chain_strands(strands: Sequence[Strand], gap: float | None, passed: Notes) -> list[Strand]:
    """Join the strands whose ends meet, each chain in the place and direction of its first strand.

    Ends meet if they lie within the gap of each other and of no third one. Where they do not coincide both are moved
    half-way: the end of a line alone, a curve as a whole by an amount that fades towards its other end. A closed chain
    begins where its first strand does. Crumbs, smaller than the gap and 1 µm, are left out. What touches is joined
    before wider gaps are closed, so that short strands of a chain are no obstacle; what is still shorter than the gap
    stays alone.

    Args:
        strands: the curves.
        gap: [m]; by default 1 µm, or 0.01 % of the drawing's diagonal if that is less.
        passed: takes note of crumbs, and of gaps up to 50 µm that stay open.
    """
    near = min(_NEAR, _NEAR_SHARE * _size(strands))
    widest = max(near if gap is None else gap, NOTHING)
    chains = list(strands)
    for tolerance in sorted({max(min(near, widest), NOTHING), widest}):
        chains = _join_within(tolerance, chains, passed)
    _note_gaps(chains, widest, passed)
    return chains


def _join_within(tolerance: float, strands: Sequence[Strand], passed: Notes) -> list[Strand]:
    """Join the strands whose ends are within the ``tolerance`` [m] of each other, but for those that are shorter."""
    loose: dict[str, list[Strand]] = {}
    done = []
    for strand in strands:
        start, end = strand.ends
        apart = float(np.linalg.norm(end - start))
        extent = strand.extent if apart <= tolerance else np.inf
        if extent <= min(tolerance, _NEAR):
            passed.pass_over(f"a curve shorter than {1e6 * min(tolerance, _NEAR):.3g} µm", strand.name, "was left out")
        elif apart > NOTHING and extent > tolerance:
            loose.setdefault(strand.layer, []).append(strand)
        else:
            if apart > NOTHING:
                passed.pass_over(
                    f"a curve shorter than the gap of {1e6 * tolerance:.3g} µm", strand.name, "stays alone"
                )
            done.append(strand)
    chains = [chain for layer in loose.values() for chain in _chains(layer, tolerance)]
    return sorted([*done, *chains], key=lambda strand: strand.place)


def _note_gaps(chains: Sequence[Strand], tolerance: float, passed: Notes) -> None:
    """Note the gaps, up to 50 µm, that are left open, with the option that closes them."""
    layers: dict[str, list[Strand]] = {}
    for chain in chains:
        start, end = chain.ends
        if np.linalg.norm(end - start) > NOTHING:
            layers.setdefault(chain.layer, []).append(chain)
    gaps = [gap for layer in layers.values() for gap in _open_gaps(layer, tolerance)]
    if gaps:
        unit = 10.0 ** np.floor(np.log10(max(gaps)) - 1)
        suffices = float(f"{unit * np.ceil(1.001 * max(gaps) / unit):.2g}")
        passed.add(
            f"{len(gaps)} gap{'s' * (len(gaps) > 1)} between ends of contours, of up to {1e6 * max(gaps):.3g} µm, "
            f"stay{'s' * (len(gaps) == 1)} open: gap={suffices:g} closes gaps up to {1e6 * suffices:.3g} µm"
        )


def _open_gaps(strands: Sequence[Strand], tolerance: float) -> list[float]:
    """Return the widths [m] of the gaps between ends that a larger tolerance, up to 50 µm, would close."""
    ends = np.array([end for strand in strands for end in strand.ends])
    apart = cKDTree(ends).query(ends, k=2, distance_upper_bound=_WIDEST_TOLD)[0][:, 1]
    apart = apart[(apart > tolerance) & np.isfinite(apart)]
    for larger in (apart.max(initial=0.0), apart.min(initial=np.inf)):
        if tolerance < larger < np.inf:
            meets = _meets(ends, min(1.05 * larger, _WIDEST_TOLD))
            first = np.flatnonzero(meets > np.arange(len(meets)))
            widths = np.linalg.norm(ends[first] - ends[meets[first]], axis=-1).tolist()
            gaps = [
                gap for i, gap in zip(first, widths, strict=True) if not _is_short(strands, int(i), int(meets[i]), gap)
            ]
            if gaps:
                return gaps
    return []


def _is_short(strands: Sequence[Strand], end: int, other: int, apart: float) -> bool:
    """Return whether two ends are those of one strand hardly longer than their distance: nothing to be closed."""
    return end // 2 == other // 2 and strands[end // 2].extent < 2 * apart


def _chains(strands: Sequence[Strand], tolerance: float) -> list[Strand]:
    """Chain the strands whose ends are within a tolerance."""
    meets = _meets(np.array([end for strand in strands for end in strand.ends]), tolerance)
    taken, chains = np.zeros(len(strands), dtype=bool), []
    for first in range(len(strands)):
        if not taken[first]:
            order, closed = _chain(meets, first)
            taken[[end // 2 for end in order]] = True
            chain = [_enter(strands[end // 2], backwards=bool(end % 2)) for end in order]
            name = strands[first].name + (f" + {len(chain) - 1}" if len(chain) > 1 else "")
            chains.append(Strand(name, strands[first].layer, strands[first].place, _join(chain, closed)))
    return chains


def _meets(ends: Array, tolerance: float) -> Array:
    """Return for each end (2n, 3) the only other one that it meets, or −1. Ends 2i and 2i + 1 are those of strand i."""
    cells, cell = np.unique(np.floor(ends / (0.5 * tolerance)), axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    chosen = np.zeros(len(cells), dtype=int)
    chosen[cell[::-1]] = np.arange(len(ends))[::-1]  # the first end in each: crowds of ends at one place cost nothing
    pairs = cKDTree(ends[chosen]).query_pairs(tolerance, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    place = connected_components(links, directed=False)[1][cell]
    by_place = np.argsort(place, kind="stable")
    first = np.flatnonzero(np.diff(place[by_place], prepend=-1))
    couples = first[np.diff(np.append(first, len(ends))) == 2]
    meets = np.full(len(ends), -1)
    meets[by_place[couples]], meets[by_place[couples + 1]] = by_place[couples + 1], by_place[couples]
    return meets


def _chain(meets: Array, first: int) -> tuple[list[int], bool]:
    """Return the ends at which the strands of a chain are entered, in order, and whether it is closed."""
    after = _follow(meets, 2 * first + 1)
    if after and after[-1] // 2 == first:
        return [2 * first, *after[:-1]], True
    before = _follow(meets, 2 * first)
    return [*(end ^ 1 for end in reversed(before)), 2 * first, *after], False


def _follow(meets: Array, leaving: int) -> list[int]:
    """Return the ends entered one after another, up to a loose end or to the strand begun with."""
    entered, first = [], leaving // 2
    while (entering := int(meets[leaving])) >= 0:
        entered.append(entering)
        if entering // 2 == first:
            break
        leaving = entering ^ 1
    return entered


def _enter(strand: Strand, backwards: bool) -> list[Segment]:
    """Return the segments of a strand in the direction in which it is passed."""
    return [segment.reversed() for segment in reversed(strand.segments)] if backwards else list(strand.segments)


def _join(parts: list[list[Segment]], closed: bool) -> list[Segment]:
    """Return the segments of a chain, with the ends that meet moved together."""
    for i in range(len(parts) if closed else len(parts) - 1):
        before, after = parts[i], parts[(i + 1) % len(parts)]
        end, start = ends_of(before[-1])[1], ends_of(after[0])[0]
        if np.linalg.norm(end - start) > NOTHING:
            middle = 0.5 * (end + start)
            before[-1] = _shift(before[-1], np.zeros(3), middle - end)
            after[0] = _shift(after[0], middle - start, np.zeros(3))
    return [segment for part in parts for segment in part]


def _size(strands: Sequence[Strand]) -> float:
    """Return the diagonal of a box around all curves [m]."""
    corners = np.concatenate([_frame(segment) for strand in strands for segment in strand.segments])
    return float(np.linalg.norm(np.ptp(corners, axis=0)))


def _frame(segment: Segment) -> Array:
    """Return points whose bounding box holds the segment."""
    if isinstance(segment, Arc):
        return np.stack(segment.bounds)
    assert isinstance(segment, Polyline | Bezier)
    return segment.points


def _shift(segment: Segment, start: Array, end: Array) -> Segment:
    """Return the segment with its start and its end moved."""
    if isinstance(segment, Polyline):
        points = segment.points.copy()
        points[0] += start
        points[-1] += end
        points = drop_repeated(points)
        return Polyline(points) if len(points) > 1 else segment  # the contour refuses a gap there
    if isinstance(segment, Arc):
        return replace(segment, center=segment.center + start, rise=segment.rise + end - start)
    assert isinstance(segment, Bezier)
    share = np.linspace(0.0, 1.0, len(segment.points))[:, None]
    return replace(segment, points=segment.points + (1 - share) * start + share * end)
