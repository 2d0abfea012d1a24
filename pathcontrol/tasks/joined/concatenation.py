"""The concatenation of open paths to a single path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._expect import expect
from pathcontrol.errors import InputError
from pathcontrol.geometry.arc_length import drop_coincident
from pathcontrol.geometry.hermite import hermite_polynomials
from pathcontrol.tasks.base import PathPoint, refuse_batch
from pathcontrol.tasks.joined.junction import explain_gap, explain_jump, gap
from pathcontrol.tasks.lengths import length_along
from pathcontrol.tasks.regularity import check_regular
from pathcontrol.tasks.task import PathTask

_SLOWEST = 1e-3  # of the speed at its ends


def concatenated(paths: Sequence[PathTask], blend: float | None = None) -> ConcatenatedPath:
    """Join open paths one after another to a single path, whose parameter begins as that of the first.

    Where one ends and the next begins with the same posture, direction, curvature and speed (to 1e-6), they are
    joined: the parameter u of each is scaled, du/ds = c, so that q_d' is continuous, and if q_d'' is then continuous
    too nothing else is changed. Elsewhere a ``blend`` replaces the last of the one and the first of the other by a
    quintic with the q_d, q_d' and q_d'' of both, over as much of s as it replaces.

    Every path keeps its velocities: the rate of s is ϑ(u)/c. In a blend ln ϑ is the cubic with the ϑ and ϑ' of both.

    Args:
        paths: two or more open paths for the same joints.
        blend: arc length [rad] that each side gives up at a junction that is not smooth.

    Raises:
        InputError: a path is not open; two do not meet, or not smoothly and there is no blend; a path is too short for
            its blends; a blend would turn straight back.
        TaskError: a path is not regular.
    """
    return ConcatenatedPath(paths, blend)


class _Piece(NamedTuple):
    """The stretch of ``path`` from ``first`` to ``last``, u = first + rate (s − start)."""

    path: PathTask
    first: float
    last: float
    start: float
    rate: float

    @property
    def end(self) -> float:
        """The parameter s at the end of the piece."""
        return self.start + (self.last - self.first) / self.rate

    def at(self, u: Array) -> PathPoint:
        return _rescale(self.path.at(u), self.rate)


class ConcatenatedPath(PathTask):
    """Several open paths as one; see :func:`concatenated`."""

    def __init__(self, paths: Sequence[PathTask], blend: float | None = None) -> None:
        self.blend = 0.0 if blend is None else as_scalar("blend", blend, positive=True)
        self.paths = _check_paths(paths)
        self.keep_tool(*self.paths)
        self.s0 = self.paths[0].s0
        self._pieces = self._join()
        self._starts = np.array([piece.start for piece in self._pieces])
        self.s_end = self._pieces[-1].end

    def q_d(self, s: Array) -> Array:
        return self._assemble(s, lambda piece, u: [piece.path.q_d(u)])[0]

    def dq_d(self, s: Array) -> Array:
        return self._assemble(s, lambda piece, u: [piece.rate * piece.path.dq_d(u)])[0]

    def ddq_d(self, s: Array) -> Array:
        return self._assemble(s, lambda piece, u: [piece.rate**2 * piece.path.ddq_d(u)])[0]

    def theta(self, s: Array) -> Array:
        return self._assemble(s, lambda piece, u: [np.zeros_like(u) + piece.path.theta(u) / piece.rate])[0]

    def dtheta(self, s: Array) -> Array:
        return self._assemble(s, lambda piece, u: [np.zeros_like(u) + piece.path.dtheta(u)])[0]

    def at(self, s: Array) -> PathPoint:
        return PathPoint(*self._assemble(s, _Piece.at))

    @property
    def knots(self) -> Array:
        return self._collect_knots("knots")

    @property
    def profile_knots(self) -> Array:
        return self._collect_knots("profile_knots")

    def _collect_knots(self, which: str) -> Array:
        """Return the junctions of the pieces and the knots of each of them."""
        ends = [np.append(self._starts, self.s_end)]
        for piece in self._pieces:
            knots = getattr(piece.path, which)
            if knots is not None:
                within = knots[(knots > piece.first) & (knots < piece.last)]
                ends.append(piece.start + (within - piece.first) / piece.rate)
        return drop_coincident(np.unique(np.concatenate(ends)))

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"paths": [path.describe() for path in self.paths]}

    # --- inside ---------------------------------------------------------------------------------------------

    def _assemble(self, s: Array, evaluate: Callable[[_Piece, Array], Sequence[Array]]) -> list[Array]:
        """Evaluate each s (*batch,) in the piece that holds it, and put the values together."""
        s = np.asarray(s, dtype=np.float64)
        flat = s.ravel()
        index = np.maximum(np.searchsorted(self._starts, flat, side="right") - 1, 0)
        order = np.argsort(index, kind="stable")
        rows = np.split(order, np.searchsorted(index[order], np.arange(1, len(self._pieces))))
        # one empty piece gives an empty batch its shape
        present = [i for i in range(len(rows)) if rows[i].size] or [0]
        values = [self._within(self._pieces[i], flat[rows[i]], evaluate) for i in present]
        back = np.argsort(np.concatenate([rows[i] for i in present]))
        whole = [np.concatenate([parts[k] for parts in values])[back] for k in range(len(values[0]))]
        return [value.reshape(s.shape + value.shape[1:]) for value in whole]

    def _within(self, piece: _Piece, s: Array, evaluate: Callable[[_Piece, Array], Sequence[Array]]) -> Sequence[Array]:
        """Evaluate a piece at s."""
        u = piece.first + piece.rate * (s - piece.start)
        return evaluate(piece, np.clip(u, piece.first, piece.last))

    def _join(self) -> list[_Piece]:
        """Return the pieces, with blends between them where they are needed."""
        blended = [self._needs_blend(i) for i in range(len(self.paths) - 1)]
        cuts = [self._cut(i, *ends) for i, ends in enumerate(zip([False, *blended], [*blended, False], strict=True))]
        pieces = [_Piece(self.paths[0], *cuts[0], self.s0, 1.0)]
        for i, needed in enumerate(blended):
            here, path, cut = pieces[-1], self.paths[i + 1], cuts[i + 1]
            start, before, after = here.end, here.at(np.asarray(here.last)), path.at(np.asarray(cut[0]))
            speed = float(np.linalg.norm(before.dq_d))
            rate = speed / float(np.linalg.norm(after.dq_d))
            if needed:
                bridge = self._bridge(i, before, _rescale(after, rate), speed)
                pieces.append(_Piece(bridge, 0.0, bridge.s_end, start, 1.0))
                start = pieces[-1].end
            pieces.append(_Piece(path, *cut, start, rate))
        return pieces

    def _needs_blend(self, i: int) -> bool:
        """Return whether paths i and i + 1 join only by a blend."""
        before, after = self.paths[i : i + 2]
        distance = gap(before, after)
        reason = explain_gap(before, after) if distance else explain_jump(before, after)
        if reason and (not self.blend or distance > self.blend):
            raise InputError(
                f"paths[{i}] and paths[{i + 1}] do not join: {reason}", argument=f"paths[{i + 1}]", value=after
            )
        return reason is not None

    def _cut(self, i: int, at_start: bool, at_end: bool) -> tuple[float, float]:
        """Return the ends of path i between its blends."""
        path = self.paths[i]
        if not (at_start or at_end):
            return path.s0, path.s_end
        length = length_along(path, path.s0, path.s_end)
        if length.total <= self.blend * (at_start + at_end):
            raise InputError(
                f"paths[{i}] has the length {length.total:.3g} rad and gives up {self.blend:g} rad to each of its "
                f"{at_start + at_end} blends; make blend less than {length.total / (at_start + at_end):.3g}",
                argument="blend",
                value=self.blend,
                limit=length.total / (at_start + at_end),
            )
        first, last = length.inverse(np.array([self.blend * at_start, length.total - self.blend * at_end]))
        return float(first), float(last)

    def _bridge(self, i: int, before: PathPoint, after: PathPoint, speed: float) -> Blend:
        span = 2 * self.blend + gap(*self.paths[i : i + 2])
        try:
            return Blend(before, after, span / speed)
        except InputError as error:
            raise InputError(
                f"paths[{i}] and paths[{i + 1}] do not join: {error}", **error.details_with(argument=f"paths[{i + 1}]")
            ) from error


def _rescale(point: PathPoint, rate: float) -> PathPoint:
    """Return the point for another parameter s with du/ds = ``rate``."""
    return PathPoint(point.q_d, rate * point.dq_d, rate**2 * point.ddq_d, point.theta / rate, point.dtheta)


def _check_paths(paths: Sequence[PathTask]) -> list[PathTask]:
    """Check that there are two or more open paths for the same joints."""
    checked = list(paths)
    if len(checked) < 2:
        raise InputError(f"{len(checked)} paths are given, expected two or more", argument="paths", value=checked)
    for i, path in enumerate(checked):
        expect(f"paths[{i}]", path, PathTask)
        refuse_batch(f"paths[{i}]", path)
        if path.closed or path.s_end == np.inf:
            kind = "is closed" if path.closed else "has no end"
            raise InputError(
                f"paths[{i}], a {type(path).__name__}, {kind}; expected open paths: cut a stretch of it with "
                "between(s0, s_end)",
                argument=f"paths[{i}]",
                value=path,
            )
        if path.n != checked[0].n:
            raise InputError(
                f"paths[{i}] has {path.n} joints and paths[0] has {checked[0].n}, expected the same",
                argument=f"paths[{i}]",
                value=path,
            )
        check_regular(path)
    return checked


class Blend(PathTask):
    """The quintic with given q_d, q_d' and q_d'' at both ends; ln ϑ is the cubic with given ϑ and ϑ'.

    Args:
        before: the path before it, at s = 0.
        after: the path after it, at ``s_end``.
        s_end: its range of the parameter.

    Raises:
        InputError: the quintic comes to a standstill, because the paths run against each other.
    """

    def __init__(self, before: PathPoint, after: PathPoint, s_end: float) -> None:
        self.s_end = float(s_end)
        ends, both = np.array([0.0, self.s_end]), (before, after)
        path = hermite_polynomials(ends, np.stack([[p.q_d, p.dq_d, p.ddq_d] for p in both], axis=1))
        rate = hermite_polynomials(
            ends, np.stack([[np.log(p.theta), p.dtheta / p.theta] for p in both], axis=1)[..., None]
        )
        self._path, self._rate = [path, path.derivative(1), path.derivative(2)], [rate, rate.derivative(1)]
        speed = np.linalg.norm(self.dq_d(np.linspace(0.0, self.s_end, 65)), axis=-1)
        if speed.min() < _SLOWEST * speed[0]:
            raise InputError(
                "the path turns straight back there, so that a blend would stand still; run the two paths one after "
                "the other instead, or put a path between them"
            )

    def q_d(self, s: Array) -> Array:
        return self._path[0](s)

    def dq_d(self, s: Array) -> Array:
        return self._path[1](s)

    def ddq_d(self, s: Array) -> Array:
        return self._path[2](s)

    def theta(self, s: Array) -> Array:
        return np.exp(self._rate[0](s)[..., 0])

    def dtheta(self, s: Array) -> Array:
        return self.theta(s) * self._rate[1](s)[..., 0]
