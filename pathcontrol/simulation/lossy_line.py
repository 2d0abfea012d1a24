"""The line between the arm and its law, on which dropouts lose ticks and measurements."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.control.base import ControlOutput
from pathcontrol.simulation.arm.dropout import Dropouts
from pathcontrol.simulation.arm.sensors import Reading
from pathcontrol.simulation.divergence import Divergence


class LossyLine:
    """The measurements that come to a law, and the outputs that come of it.

    Args:
        dropouts: what is lost.
        reading: the first measurement, which comes in any case.
    """

    def __init__(self, dropouts: Dropouts, reading: Reading) -> None:
        self._dropouts, self._seen = dropouts, reading
        self._missed: NDArray[np.bool_] = np.zeros(len(reading.q), dtype=bool)
        self._silent, self._tau = self._missed, np.zeros_like(reading.q)
        self._said: ControlOutput | None = None

    def receive(self, tick: int, reading: Reading) -> Reading:
        """Return what the law sees at a tick of the loop: the measurement, or the last one that came."""
        if not self._dropouts.any:
            return reading
        at = np.array([tick])
        (self._missed,), (self._silent,) = self._dropouts.missed(at), self._dropouts.silent(at)
        away = (self._missed | self._dropouts.stale(at)[0])[:, None]
        self._seen = Reading(*(np.where(away, old, new) for old, new in zip(self._seen, reading, strict=True)))
        return self._seen

    def send(self, out: ControlOutput, begins: bool) -> ControlOutput:
        """Return the output in use: that of the law, or where it misses the tick, the last one.

        A law that ``begins`` with a tick that it misses has said nothing before but its state; the torque is that of
        the law before it, or none.
        """
        if not self._dropouts.any:
            return out
        if self._missed.any():
            last = out if begins or self._said is None else self._said
            pairs: list[tuple[Any, Any]] = list(zip(last[:-1], out[:-1], strict=True))
            kept = [_choose(self._missed, old, new) for old, new in pairs]
            out = ControlOutput._make([*kept, out.observation])  # which counts where the tick is not missed
            tau = np.where(self._silent[:, None], 0.0, _choose(self._missed, self._tau, out.tau))
            out = out._replace(tau=tau, regular=out.regular & ~self._missed)
        self._said, self._tau = out, out.tau
        return out

    def keep(self, z: Array, advanced: Array) -> Array:
        """Return the law's state after a tick: the ``advanced`` one, or where the tick is missed still z."""
        return _choose(self._missed, z, advanced) if self._dropouts.any and self._missed.any() else advanced

    def reset(self, lost: Divergence) -> None:
        """Put the measurements of lost rollouts back to their initial states."""
        self._seen = Reading(*lost.reset_lost(*self._seen))


def _choose(missed: NDArray[np.bool_], old: Array, new: Array) -> Array:
    """Return the old values (N, …) of rollouts that have missed a tick, and the new ones of all others."""
    return np.where(missed.reshape(-1, *[1] * (np.ndim(new) - 1)), old, new)
