"""The motion along a path, computed once at each place."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.profiles.motion import Motion
from pathcontrol.tasks.profile import Path


class KnownMotion:
    """The curve p(s) of a motion along a path, remembered where it was asked for.

    A grid that is refined asks for the ends of a cell twice, and for all cells again once they are small enough; the
    kinematics of a tool there is most of the time that a profile takes.
    """

    def __init__(self, motion: Motion, path: Path) -> None:
        self._motion, self._path = motion, path
        self._s, self._derivatives = np.empty(0), np.empty((2, 0, 0))

    def at(self, s: Array) -> tuple[Array, Array]:
        """Return p'(s) and p''(s), (*batch, m), for s (*batch,)."""
        asked, place = np.unique(s, return_inverse=True)
        new = np.setdiff1d(asked, self._s, assume_unique=True)
        if new.size:
            found = np.stack(self._motion.along(self._path, new))
            before = self._derivatives if self._s.size else found[:, :0]
            every = np.concatenate([self._s, new])
            order = np.argsort(every)
            self._s, self._derivatives = every[order], np.concatenate([before, found], axis=1)[:, order]
        dp, ddp = self._derivatives[:, np.searchsorted(self._s, asked)[place]]
        return dp, ddp
