"""Where a simulation writes what it sees, a sample at a time."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import ControlOutput
from pathcontrol.simulation.sensors import Reading


class Recorder:
    """Arrays (time, rollout, …) filled a sample at a time, handed out as (rollout, time, …)."""

    def __init__(self, samples: int) -> None:
        self._samples = samples
        self._arrays: dict[str, Array] = {}

    def write(self, sample: int, q: Array, qd: Array, reading: Reading, out: ControlOutput, tau: Array) -> None:
        """Store one sample: the true state, what was measured, what the law said and the torque that acts."""
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
        if not self._arrays:
            self._arrays = {name: np.empty((self._samples, *v.shape), dtype=v.dtype) for name, v in values.items()}
        for name, value in values.items():
            self._arrays[name][sample] = value

    def arrays(self) -> dict[str, Array]:
        """Everything stored, rollouts first."""
        return {name: np.moveaxis(array, 0, 1) for name, array in self._arrays.items()}
