"""A sequence of paths, with a stop after each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, freeze
from pathcontrol._expect import expect
from pathcontrol.errors import InputError
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.regularity import check_regular
from pathcontrol.tasks.task import PathTask

_MEET = 1e-3  # rad


class PathSequence(PathTask):
    """A sequence of open paths, each begun when the arm has come to rest at the end of the one before.

    Their parameters are strung together: path i holds s ∈ [S_i, S_{i+1}], S_0 = 0. q_d is continuous there, its
    derivatives are not, so no controller follows a whole sequence at once: :func:`simulate_sequence` gives it the
    paths one by one. As a task the sequence serves figures, animations and metrics.

    Args:
        paths: open paths of one arm.
        gaps: whether a path may begin elsewhere than where the one before it ends.

    Attributes:
        paths: the paths.
        starts: S_i, and at last the end of all, (len(paths) + 1,).

    Raises:
        InputError: a path is closed or endless, is for another number of joints, or does not begin where the one
            before it ends and ``gaps`` are not allowed.
        TaskError: a path is not regular.
    """

    def __init__(self, paths: Sequence[PathTask], *, gaps: bool = False) -> None:
        self.paths, self.gaps = tuple(paths), gaps
        if not self.paths:
            raise InputError("a sequence needs at least one path", argument="paths", value=[])
        for i, path in enumerate(self.paths):
            expect(f"paths[{i}]", path, PathTask)
            refuse_batch(f"path {i} of the sequence", path, f"paths[{i}]")
            if path.closed or not np.isfinite(path.s_end):
                raise InputError(
                    f"path {i} of the sequence does not end; take a part of it, as path.between(s0, s_end)",
                    argument=f"paths[{i}]",
                    value=path,
                )
            check_regular(path)
        self._check_meeting()
        self.keep_tool(*self.paths)
        lengths = [path.s_end - path.s0 for path in self.paths]
        self.starts = freeze(np.concatenate([[0.0], np.cumsum(lengths)]))
        self.s0, self.s_end = 0.0, float(self.starts[-1])

    def __iter__(self) -> Iterator[PathTask]:
        return iter(self.paths)

    def __len__(self) -> int:
        return len(self.paths)

    def q_d(self, s: Array) -> Array:
        return self._evaluate("q_d", s, (self.n,))

    def dq_d(self, s: Array) -> Array:
        return self._evaluate("dq_d", s, (self.n,))

    def ddq_d(self, s: Array) -> Array:
        return self._evaluate("ddq_d", s, (self.n,))

    def theta(self, s: Array) -> Array:
        return self._evaluate("theta", s, ())

    def dtheta(self, s: Array) -> Array:
        return self._evaluate("dtheta", s, ())

    def index(self, s: ArrayLike) -> Array:
        """Return the index of the path that holds s, (*batch,); at a junction that of the later one."""
        found = np.searchsorted(self.starts, as_array("s", s), side="right") - 1
        return np.clip(found, 0, len(self.paths) - 1)

    @property
    def n(self) -> int:
        return self.paths[0].n

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        q = as_array("q", q)
        if near is not None:
            return self._project(q, np.broadcast_to(as_array("near", near), q.shape[:-1]))
        local = np.stack([path.sigma_bar(q) for path in self.paths])
        distance = [np.linalg.norm(path.q_d(s) - q, axis=-1) for path, s in zip(self.paths, local, strict=True)]
        best = np.argmin(distance, axis=0)
        s0 = np.array([path.s0 for path in self.paths])
        return np.take_along_axis(local, best[None], axis=0)[0] + self.starts[best] - s0[best]

    def describe(self) -> dict[str, Any]:
        return {"task": "PathSequence", "paths": [path.describe() for path in self.paths]}

    def _project(self, q: Array, near: Array) -> Array:
        """Return σ̄ on the path that holds ``near``."""
        which, s = self.index(near), np.empty(near.shape)
        for i in np.unique(which):
            rows, shift = which == i, self.starts[i] - self.paths[i].s0
            s[rows] = self.paths[i].sigma_bar(q[rows], near=near[rows] - shift) + shift
        return s

    def _evaluate(self, name: str, s: Array, shape: tuple[int, ...]) -> Array:
        """Evaluate a method of the path that holds s, at s (*batch,)."""
        s = np.asarray(s, dtype=np.float64)
        which, values = self.index(s), np.empty(s.shape + shape)
        for i in np.unique(which):
            rows, path = which == i, self.paths[i]
            local = np.clip(s[rows] - self.starts[i] + path.s0, path.s0, path.s_end)
            values[rows] = getattr(path, name)(local)
        return values

    def _check_meeting(self) -> None:
        """Check that each path begins where the one before it ends."""
        for i, (path, after) in enumerate(zip(self.paths[:-1], self.paths[1:], strict=True)):
            if path.n != after.n:
                raise InputError(
                    f"path {i} is for {path.n} joints, path {i + 1} for {after.n}",
                    argument=f"paths[{i + 1}]",
                    value=after,
                )
            if self.gaps:
                continue
            end, start = path.q_d(np.array(path.s_end)), after.q_d(np.array(after.s0))
            gap = np.abs(end - start)
            if gap.max() > _MEET:
                joint = int(np.argmax(gap))
                raise InputError(
                    f"path {i + 1} begins {gap[joint]:.3g} rad away from the end of path {i}, at joint {joint + 1}: at "
                    f"{start[joint]:.6g} after {end[joint]:.6g}, expected at most {_MEET:g} rad; put a path in "
                    "between, begin it with the posture at that end (start=…), or allow it by gaps=True",
                    argument=f"paths[{i + 1}]",
                    value=gap[joint],
                    limit=_MEET,
                )
