"""Where a simulation writes what it sees, a sample at a time."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import ControlOutput
from pathcontrol.simulation.sensors import Reading

_ROOM = 1024  # samples at first


class Recorder:
    """Arrays (time, rollout, …) that grow a sample at a time, handed out as (rollout, time, …)."""

    def __init__(self) -> None:
        self._samples, self._room = 0, 0
        self._arrays: dict[str, Array] = {}

    def write(self, q: Array, qd: Array, reading: Reading, out: ControlOutput, tau: Array) -> None:
        """Store one more sample: the true state, what was measured, what the law said and the torque that acts."""
        values = {
            "q": q,
            "qd": qd,
            "q_measured": reading.q,
            "qd_measured": reading.qd,
            "tau_demand": out.tau,
            "tau": tau,
            "s": out.s,
            "sdot": out.sdot,
            "e_p": out.e_p,
            "e_v": out.e_v,
            "regular": out.regular,
        }
        if self._samples == self._room:
            self._grow(values)
        for name, value in values.items():
            self._arrays[name][self._samples] = value
        self._samples += 1

    def arrays(self) -> dict[str, Array]:
        """Everything stored, rollouts first."""
        return {name: np.moveaxis(array[: self._samples], 0, 1) for name, array in self._arrays.items()}

    def _grow(self, values: dict[str, Array]) -> None:
        """Twice the room; a run may end long before the time it was given."""
        self._room = 2 * self._room or _ROOM
        for name, value in values.items():
            larger = np.empty((self._room, *value.shape), dtype=value.dtype)
            if self._samples:
                larger[: self._samples] = self._arrays[name]
            self._arrays[name] = larger
