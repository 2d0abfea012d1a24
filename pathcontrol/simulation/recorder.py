"""The recorder of a simulation, which stores a sample at a time."""

from __future__ import annotations

from math import prod

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import ControlOutput
from pathcontrol.simulation.arm.sensors import Reading
from pathcontrol.simulation.variables import VARIABLES

_ROOM = 1 << 30  # bytes reserved at first; pages that are not written take no memory


class Recorder:
    """Arrays (time, rollout, …) that grow a sample at a time, returned as (rollout, time, …).

    Args:
        rollouts: number of rollouts.
        joints: number of joints.
        samples: largest number of samples.
    """

    def __init__(self, rollouts: int, joints: int, samples: int) -> None:
        self._most, self._samples = samples, 0
        whole = {"rollout": rollouts, "joint": joints}
        shapes = {name: [whole[dim] for dim in dims if dim in whole] for name, (dims, _, _) in VARIABLES.items()}
        bytes_a_sample = sum(8 * prod(shape) for shape in shapes.values())
        self._room = min(samples, max(1, _ROOM // bytes_a_sample))
        self._arrays = {
            name: np.empty((self._room, *shape), dtype=bool if name == "regular" else np.float64)
            for name, shape in shapes.items()
        }

    def write(self, q: Array, qd: Array, reading: Reading, out: ControlOutput, tau: Array) -> None:
        """Store one more sample: true state, measurement, output of the law and the torque that acts."""
        if self._samples == self._room:
            self._grow()
        i = self._samples
        values = (q, qd, *reading, out.tau, tau, out.s, out.sdot, out.e_p, out.e_v, out.regular)  # as in VARIABLES
        for array, value in zip(self._arrays.values(), values, strict=True):
            array[i] = value
        self._samples += 1

    @property
    def samples(self) -> int:
        """The number of samples stored."""
        return self._samples

    def reserve(self, samples: int) -> dict[str, Array]:
        """Return views of the room for the next ``samples``, (samples, rollout, …), to be written and then added."""
        while self._samples + samples > self._room:
            self._grow()
        return {name: array[self._samples : self._samples + samples] for name, array in self._arrays.items()}

    def add(self, samples: int) -> None:
        """Count ``samples`` that have been written into the room for them."""
        self._samples += samples

    def cut(self, samples: int) -> None:
        """Drop all but the first ``samples``."""
        self._samples = min(self._samples, samples)

    def arrays(self) -> dict[str, Array]:
        """Return all samples, rollouts first, and release the room that was not needed."""
        self._room = self._samples
        for array in self._arrays.values():
            array.resize((self._samples, *array.shape[1:]), refcheck=False)
        return {name: np.moveaxis(array, 0, 1) for name, array in self._arrays.items()}

    def _grow(self) -> None:
        """Double the room; a run may end long before its duration."""
        self._room = min(2 * self._room, self._most)
        for name, array in self._arrays.items():
            larger = np.empty((self._room, *array.shape[1:]), dtype=array.dtype)
            larger[: self._samples] = array[: self._samples]
            self._arrays[name] = larger
