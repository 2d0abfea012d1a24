"""The demands of all limits on ϑ along one path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_joint_array, as_scalar
from pathcontrol.errors import InputError
from pathcontrol.profiles.limited.grid import excess
from pathcontrol.profiles.limited.motion_limit import MotionLimit
from pathcontrol.profiles.limited.tangential import Tangential
from pathcontrol.profiles.motion import growth
from pathcontrol.tasks.profile import Path

_START, _END = (
    2.5e-3,
    2.5e-4,
)  # s, of acceleration from rest before the start, and of deceleration after the end, of an open path
_MAX_EXCESS = 1.05  # of a chord over a ceiling that it resolves


class Demands:
    """Ceilings of ϑ² and tangential limits along a path; see :func:`limited` for the arguments."""

    def __init__(
        self, path: Path, limits: Sequence[MotionLimit], velocity: ArrayLike | None, start_rate: float | None
    ) -> None:
        self.path, self.limits = path, limits
        self.velocity = _check_velocity(velocity, path.dq_d(np.asarray(path.s0)).shape[-1])
        self.first, self.last = np.inf, np.inf
        if path.period is None:
            first = self._rate_after(_START, path.s0)
            self.first = first if start_rate is None else as_scalar("start_rate", start_rate, positive=True)
            self.last = self._rate_after(_END, path.s_end)

    def at(self, s: Array) -> tuple[Array, list[Tangential]]:
        """Return the largest ϑ² [1/s²] for speeds, curvatures and ends, (cells, k), and the tangential limits."""
        dq = self.path.dq_d(s)
        rates = np.select([s == self.path.s0, s == self.path.s_end], [self.first, self.last], np.inf)
        with np.errstate(divide="ignore"):
            rates = np.minimum(rates, (self.velocity / np.abs(dq)).min(-1))
        ceilings, tangential = [rates**2], []
        for limit in self.limits:
            dp, ddp = limit.motion.along(self.path, s)
            ceilings.append(limit.ceiling(dp, ddp))
            if limit.tangential is not None:
                length = np.linalg.norm(dp, axis=-1)
                tangential.append(Tangential(limit.motion, limit.tangential, s, length, growth(dp, ddp)))
        return np.minimum.reduce(ceilings), tangential

    def resolved(self, s: Array) -> NDArray[np.bool_]:
        """Return whether cells with the points s (cells, 5) are small enough for all limits, (cells,)."""
        ceiling, tangential = self.at(s)
        return np.logical_and.reduce([excess(ceiling) <= _MAX_EXCESS, *(limit.resolved for limit in tangential)])

    def _rate_after(self, time: float, s: float) -> float:
        """Return the ϑ [1/s] that is reached from rest at s in a ``time`` [s]; ``inf`` without tangential limits."""
        _, limits = self.at(np.full((1, 1), s))
        with np.errstate(divide="ignore"):
            return min((float(limit.largest * time / limit.length[0, 0]) for limit in limits), default=np.inf)


def _check_velocity(velocity: ArrayLike | None, n: int) -> Array:
    """Check the velocity limits of the joints, (n,); ``inf`` for none."""
    fastest = as_joint_array("velocity", np.full(n, np.inf) if velocity is None else velocity, n)
    if not (fastest > 0).all():
        raise InputError(f"velocity = {fastest.tolist()}, expected speeds greater than 0; inf for no limit")
    return fastest
