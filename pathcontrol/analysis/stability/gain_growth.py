"""The growth of the slowest transverse mode of a law with many sets of gains, which go round their path together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.stability.floquet import check_path, slowest_growth
from pathcontrol.control.adaptive_slotine_li import AdaptiveSlotineLi
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.law_gains import with_gains
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import InputError
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop

Loop = SampledLoop | ContinuousTime | None

_NUMBERS = 2e7  # of the steps of all laps that are kept at once
_PRECISION = 1e-6  # of a gain on the boundary


class GainGrowth:
    """The growth of the slowest transverse mode of a law as a function of some of its gains.

    Args:
        law: the law.
        names: the gains that vary.
        loop: how the loop is closed; ``None`` for continuous time.
        settle: laps of a sampled loop before it is linearised.

    Raises:
        InputError: the law learns parameters, or as of :func:`floquet`.
    """

    def __init__(self, law: Controller, names: Sequence[str], loop: Loop, settle: int) -> None:
        check_controller("law", law)
        if loop is not None:
            expect("loop", loop, SampledLoop, ContinuousTime)
        if isinstance(unwrap(law), AdaptiveSlotineLi):
            raise InputError(
                "parameters that an adaptive law learns, and that do not show on the path, neither decay nor grow with "
                "any gain, so that there is no boundary of stability; floquet(law).exponents has all rates, and "
                "SlotineLi with the same gains a boundary",
                argument="law",
                value=law,
            )
        self._law, self._names, self._loop, self._settle = law, tuple(names), loop, settle
        self._task = check_path(law)
        ticks = 2000.0
        if isinstance(loop, SampledLoop):
            s = np.linspace(*self._task.one_traverse, 64, endpoint=False)
            ticks = float(np.ptp(self._task.one_traverse) * np.mean(1 / self._task.theta(s)) / loop.period)
        self._batch = int(np.clip(_NUMBERS / ticks / (6 * law.robot.n + 3) ** 2, 1, 256))

    def __call__(self, values: Array, update: Callable[[float], None] = lambda done: None) -> tuple[Array, Array]:
        """Return the growth rates [1/s] and the multipliers |μ|, (N,) each, for gains (N, names).

        Args:
            values: the gains.
            update: called with the number of those that are done.
        """
        parts = []
        for begin in range(0, len(values), self._batch):
            some = values[begin : begin + self._batch]
            parts.append(self._grow(some))
            update(begin + len(some))
        rates, multipliers = np.concatenate(parts, axis=1)
        return rates, multipliers

    def find_roots(self, low: Array, high: Array, ends: tuple[Array, Array]) -> Array:
        """Return the gains (N, names) between ``low`` and ``high``, (N, names) each, at which nothing grows or decays.

        One of the ends is stable and the other is not; the root is found by Chandrupatla's method, to 1e-6 of it.

        Args:
            low: gains at one end.
            high: gains at the other.
            ends: growth rates at both, (N,) each.
        """
        from scipy.optimize.elementwise import find_root

        def rates(share: Array, row: Array) -> Array:
            for end, known in enumerate(ends):  # which the method asks for first
                if (share == end).all():
                    return known[row]
            at = low[row] + share[:, None] * (high - low)[row]
            return self(at)[0]

        rows = np.arange(len(low))
        if not len(rows):
            return low
        width = np.abs(high - low).max(-1) / np.maximum(np.abs(high), np.abs(low)).max(-1)
        precision = {"xatol": _PRECISION / max(float(width.max()), _PRECISION), "xrtol": 0.0}
        found = find_root(rates, (np.zeros(len(rows)), np.ones(len(rows))), args=(rows,), tolerances=precision)
        return low + found.x[:, None] * (high - low)

    def _grow(self, values: Array) -> tuple[Array, Array]:
        """Return rates and multipliers of gains that fit together into memory."""
        gains = dict(zip(self._names, values.T, strict=True))
        return slowest_growth(
            lambda rows: with_gains(self._law, {name: each[rows, None] for name, each in gains.items()}),
            len(values),
            self._task,
            self._loop,
            self._settle,
        )
