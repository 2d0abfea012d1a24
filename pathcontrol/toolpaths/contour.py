"""Contours, and the toolpath that they form, in the order and at the feed of the file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_rigid
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.segments.bezier_columns import measure_bounds, measure_lengths
from pathcontrol.toolpaths.segments.nearest import Cubics, is_cubic
from pathcontrol.toolpaths.segments.segment import SAME_POINT, Polyline, Segment


@dataclass(frozen=True, eq=False, repr=False)
class Contour:
    """A contour: segments one after another, along which the tool is not lifted [m].

    Attributes:
        segments: the pieces; each begins where the one before ends.
        closed: whether the last ends where the first begins.
        feed: speed of the tool [m/s], or None where the file gives none.
        rapid: a positioning move, not a cut.
        name: what the file calls it: a layer, an id, a line number.
        normals: tool axes given with the points of the only segment, a polyline: unit vectors (k + 1, 3), or None.
    """

    segments: tuple[Segment, ...]
    closed: bool = False
    feed: float | None = None
    rapid: bool = False
    name: str = ""
    normals: Array | None = None

    def __post_init__(self) -> None:
        if not self.segments:
            raise InputError("a contour needs at least one segment")
        if self.feed is not None and not 0 < self.feed < np.inf:
            raise InputError(
                f"feed = {self.feed!r} m/s, expected a number greater than 0, or None",
                argument="feed",
                value=self.feed,
                limit=0.0,
            )
        ends, starts = self._ends
        gap = np.linalg.norm(ends[:-1] - starts[1:], axis=-1).max(initial=0.0)
        if self.closed:
            gap = max(gap, float(np.linalg.norm(ends[-1] - starts[0])))
        if gap > SAME_POINT * (1 + np.abs(starts).max()):
            raise InputError(
                f"the segments of contour {self.name!r} do not meet: there is a gap of {gap:g} m", value=gap
            )

    def __repr__(self) -> str:
        kind = "rapid" if self.rapid else "no feed" if self.feed is None else f"{self.feed:.4g} m/s"
        closed = ", closed" if self.closed else ""
        segments = f"{len(self.segments)} segment{'s' * (len(self.segments) > 1)}"
        return f"Contour({self.name!r}; {segments}, {self.length:.4g} m, {kind}{closed})"

    @property
    def length(self) -> float:
        """Arc length [m]."""
        measure_lengths(self.segments)
        return sum(segment.length for segment in self.segments)

    @property
    def start(self) -> Array:
        """First point [m], (3,)."""
        return self._ends[1][0]

    @property
    def end(self) -> Array:
        """Last point [m], (3,)."""
        return self._ends[0][-1]

    @property
    def points(self) -> int:
        """Number of points that delimit the segments and the edges of polylines."""
        return 1 + sum(len(s.edges) if isinstance(s, Polyline) else 1 for s in self.segments)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of the bounding box [m], each (3,)."""
        measure_bounds(self.segments)
        lower, upper = zip(*(segment.bounds for segment in self.segments), strict=True)
        return np.min(lower, axis=0), np.max(upper, axis=0)

    def distance(self, x: ArrayLike) -> Array:
        """Return the distance from points x (*batch, 3) to the contour [m], (*batch,)."""
        x = as_array("x", x)
        flat = x.reshape(-1, 3)
        best = np.where(np.isfinite(flat).all(-1), np.inf, np.nan)
        cubics, others = self._by_kind
        if cubics is not None:
            best = np.minimum(best, cubics.distance(flat))
        if others and flat.size:
            measure_bounds(others)
            boxes = np.stack([_distance_to_box(flat, *segment.bounds) for segment in others])
            for rank in np.argsort(boxes.min(1)):
                near = boxes[rank] < best
                if near.any():
                    best[near] = np.minimum(best[near], others[rank].distance(flat[near]))
        return best.reshape(x.shape[:-1])

    def placed(self, pose: ArrayLike) -> Contour:
        """Return the contour moved from the workpiece's frame by a homogeneous transform (4, 4)."""
        transform = check_rigid("pose", pose)
        normals = None if self.normals is None else self.normals @ transform[:3, :3].T
        return replace(self, segments=tuple(s.placed(transform) for s in self.segments), normals=normals)

    def reversed(self) -> Contour:
        """Return the contour from its end to its start."""
        normals = None if self.normals is None else self.normals[::-1]
        return replace(self, segments=tuple(s.reversed() for s in self.segments[::-1]), normals=normals)

    @cached_property
    def _by_kind(self) -> tuple[Cubics | None, tuple[Segment, ...]]:
        """The segments that are searched for the nearest point together, and those searched one by one."""
        cubics = [segment for segment in self.segments if is_cubic(segment)]
        others = tuple(segment for segment in self.segments if not is_cubic(segment))
        return Cubics(cubics) if cubics else None, others

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """The last and the first points of the segments, each (k, 3)."""
        return np.array([s.last for s in self.segments]), np.array([s.first for s in self.segments])


@dataclass(frozen=True, eq=False, repr=False)
class Toolpath:
    """The contours of a file [m], in its order; iterating goes through them.

    Attributes:
        contours: cuts and rapids.
        source: the file they come from.
        unit: the file's unit of length, as it is called there: ``"mm"``, ``"in"``, …
        notes: what the reader passed over or took for granted, one sentence each; :func:`read_toolpath` warns of them.
    """

    contours: tuple[Contour, ...]
    source: str = ""
    unit: str = "m"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.contours:
            raise InputError(f"there is no contour in {self.source or 'this toolpath'}")

    def __repr__(self) -> str:
        rapids = [contour for contour in self.contours if contour.rapid]
        kinds = [("cut", self.cuts), ("rapid", rapids)]
        counted = [_count(name, contours) for name, contours in kinds if contours]
        return f"Toolpath({'; '.join([repr(self.source), *counted, f'file in {self.unit}'])})"

    def __iter__(self) -> Iterator[Contour]:
        return iter(self.contours)

    def __len__(self) -> int:
        return len(self.contours)

    def __getitem__(self, index: int) -> Contour:
        return self.contours[index]

    @property
    def cuts(self) -> tuple[Contour, ...]:
        """The contours that are not rapids."""
        return tuple(contour for contour in self.contours if not contour.rapid)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of the bounding box [m], each (3,)."""
        lower, upper = zip(*(contour.bounds for contour in self.contours), strict=True)
        return np.min(lower, axis=0), np.max(upper, axis=0)

    def placed(self, pose: ArrayLike) -> Toolpath:
        """Return the toolpath moved from the workpiece's frame to the base frame by a transform (4, 4)."""
        return replace(self, contours=tuple(contour.placed(pose) for contour in self.contours))

    def distance(self, x: ArrayLike, contours: Sequence[Contour] | None = None) -> Array:
        """Return the distance from points x (*batch, 3) to the nearest contour, by default a cut [m], (*batch,)."""
        chosen = self.cuts if contours is None else contours
        return np.min([contour.distance(x) for contour in chosen], axis=0)


def _count(name: str, contours: Sequence[Contour]) -> str:
    """Write number and length of contours: ``"2 cuts, 0.19 m"``."""
    length = sum(contour.length for contour in contours)
    return f"{len(contours)} {name}{'s' * (len(contours) > 1)}, {length:.4g} m"


def _distance_to_box(x: Array, lower: Array, upper: Array) -> Array:
    """Return the distance from x (N, 3) to a box [m], (N,), rounded down a little: bounds of curves are sampled."""
    outside = np.linalg.norm(np.maximum(np.maximum(lower - x, x - upper), 0.0), axis=-1)
    return outside - 1e-5 * float(np.linalg.norm(upper - lower))
