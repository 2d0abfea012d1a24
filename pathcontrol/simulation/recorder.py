"""The recorder of a simulation, which stores a sample at a time."""

from __future__ import annotations

from math import prod

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import ControlOutput
from pathcontrol.errors import InputError
from pathcontrol.simulation.arm.sensors import Reading
from pathcontrol.simulation.record_memory import new_block
from pathcontrol.simulation.variables import RECORDED

_LARGEST = 2**31 - 1  # bytes of a sample, which NumPy's types of records allow
_ROOM = 1 << 30  # bytes reserved at first; pages that are not written take no memory


class Recorder:
    """Arrays (time, rollout, …) that grow a sample at a time, returned as (rollout, time, …).

    A sample of all variables and rollouts lies together in memory: one block of it takes few page faults where an array
    for each variable takes many.

    Args:
        rollouts: number of rollouts.
        joints: number of joints.
        samples: largest number of samples.

    Raises:
        InputError: a sample takes 2 GiB or more.
    """

    def __init__(self, rollouts: int, joints: int, samples: int) -> None:
        self._most, self._samples = samples, 0
        whole = {"rollout": rollouts, "joint": joints}
        shapes = {name: tuple(whole[dim] for dim in dims if dim in whole) for name, (dims, _, _) in RECORDED.items()}
        fields = [(name, bool if name == "regular" else np.float64, shape) for name, shape in shapes.items()]
        if sum(8 * prod(shape) for shape in shapes.values()) > _LARGEST:
            raise InputError(
                f"{rollouts} rollouts of {joints} joints at once, expected less than 2 GiB a sample; simulate them in "
                "parts with first_rollout, or by sweep",
                value=rollouts,
            )
        sample = np.dtype(fields, align=True)
        self._use_block(new_block(min(samples, max(1, _ROOM // max(1, sample.itemsize))), sample))

    def write(self, q: Array, qd: Array, reading: Reading, out: ControlOutput, tau: Array) -> None:
        """Store one more sample: true state, measurement, output of the law and the torque that acts."""
        if self._samples >= len(self._block):
            self._reserve_block(1)
        values = (q, qd, *reading, out.tau, tau, out.s, out.sdot, out.e_p, out.e_v, out.regular)  # as in RECORDED
        for column, value in zip(self._columns, values, strict=True):
            column[self._samples] = value
        self._samples += 1

    @property
    def samples(self) -> int:
        """The number of samples stored."""
        return self._samples

    def reserve(self, samples: int) -> dict[str, Array]:
        """Return views of the room for the next ``samples``, (samples, rollout, …), to be written and then added."""
        block = self._reserve_block(samples)
        return {name: block[name] for name in RECORDED}

    def add(self, samples: int) -> None:
        """Count ``samples`` that have been written into the room for them."""
        self._samples += samples

    def cut(self, samples: int) -> None:
        """Drop all but the first ``samples``."""
        self._samples = min(self._samples, samples)

    def arrays(self) -> dict[str, Array]:
        """Return all samples, rollouts first; room that was not written takes no memory."""
        return {name: self._block[name][: self._samples].swapaxes(0, 1) for name in RECORDED}

    def _reserve_block(self, samples: int) -> Array:
        """Return the room for the next ``samples``; it doubles, as a run may end long before its duration."""
        room = len(self._block)
        while self._samples + samples > room:
            room = min(2 * room, self._most)
        if room > len(self._block):
            larger = new_block(room, self._block.dtype)
            larger[: self._samples] = self._block[: self._samples]
            self._use_block(larger)
        return self._block[self._samples : self._samples + samples]

    def _use_block(self, block: Array) -> None:
        """Store samples in ``block``, a variable in each of its columns."""
        self._block = block
        self._columns = [block[name] for name in RECORDED]
