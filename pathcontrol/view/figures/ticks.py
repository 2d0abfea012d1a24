"""Numbers along an axis that stand apart, however many figures they have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from matplotlib.axis import Axis, XAxis
from matplotlib.ticker import AutoLocator, LogFormatterSciNotation, ScalarFormatter

_DIGIT = 0.64  # width of a digit in the default font, of its size
_GAP = 1.2  # digits between numbers
_MATHEMATICS = (r"$\mathdefault{", "}$")  # the marks that Matplotlib puts around numbers
_PREFERRED = "3264"  # first digits of numbers between powers of ten, that which divides the decade best first
_PLAIN = (1e-3, 1e4)  # range in which numbers along a logarithmic axis are written out


class SpacedLocator(AutoLocator):
    """Round numbers along a horizontal axis, fewer of them where they have many figures.

    Args:
        size: of the numbers [pt].
    """

    def __init__(self, size: float) -> None:
        super().__init__()
        self._size = size

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        for least, intervals in product((2, 1), ("auto", 5, 4, 3, 2, 1)):  # one number, where two have no room
            self.set_params(nbins=intervals, min_n_ticks=least)
            ticks = super().tick_values(vmin, vmax)
            if len(ticks) < 3 or self._apart(np.asarray(ticks), abs(vmax - vmin)):
                break
        return ticks

    def _apart(self, ticks: np.ndarray, span: float) -> bool:
        step = float(ticks[1] - ticks[0])
        assert self.axis is not None
        length = self.axis.get_tick_space() * 3 * self._size  # pt, which Matplotlib divides by three sizes
        return (_figures(ticks, step) + _GAP) * _DIGIT * self._size <= length * step / max(span, step)


class PlainFormatter(ScalarFormatter):
    """Numbers along a linear axis as plain text, which is laid out many times faster than mathematics.

    The power of ten that they have in common is written as mathematics, ``×10⁻³``.
    """

    def __init__(self) -> None:
        super().__init__(useMathText=True)

    def __call__(self, x: float, pos: int | None = None) -> str:
        return super().__call__(x, pos).removeprefix(_MATHEMATICS[0]).removesuffix(_MATHEMATICS[1])


class PlainLogFormatter(LogFormatterSciNotation):
    """Numbers along a logarithmic axis as one writes them, ``6`` or ``0.02``; only far from 1 as powers of ten.

    Args:
        between: whether they stand between powers of ten; of those along a horizontal axis some are left out where not
            all have room.
    """

    def __init__(self, between: bool = False) -> None:
        super().__init__(labelOnlyBase=not between)
        self._between = between

    def format_ticks(self, values: list[float]) -> list[str]:
        texts = super().format_ticks(values)
        return _thin(self.axis, values, texts) if self._between and isinstance(self.axis, XAxis) else texts

    def __call__(self, x: float, pos: int | None = None) -> str:
        text = super().__call__(x, pos)
        return f"{x:.4g}" if text and _PLAIN[0] <= abs(x) < _PLAIN[1] else text


def _thin(axis: XAxis, values: Sequence[float], texts: list[str]) -> list[str]:
    """Return the texts at values between powers of ten without those that would touch another one."""
    low, high = np.log10(sorted(axis.get_view_interval()))
    width = (high - low) * _DIGIT / (3 * max(1, axis.get_tick_space()))  # of a digit, in decades
    powers = range(math.ceil(low - 1e-9), math.floor(high + 1e-9) + 1)
    taken = [(float(power), len(f"{10.0**power:.4g}")) for power in powers]
    kept = [""] * len(texts)
    for i in sorted(range(len(texts)), key=lambda i: _PREFERRED.find(f"{values[i]:e}"[0]) % 10):
        place = math.log10(values[i])
        if texts[i] and all(abs(place - at) >= width * ((len(texts[i]) + n) / 2 + _GAP) for at, n in taken):
            taken.append((place, len(texts[i])))
            kept[i] = texts[i]
    return kept


def label_plainly(axis: Axis) -> None:
    """Write plain numbers along an axis; of a logarithmic one between powers of ten too where these are few."""
    if axis.get_scale() == "log":
        axis.set_major_formatter(PlainLogFormatter())
        axis.set_minor_formatter(PlainLogFormatter(between=True))
    else:
        axis.set_major_formatter(PlainFormatter())


def _figures(ticks: np.ndarray, step: float) -> int:
    """Return the length of the longest number; those far from one share a power of ten."""
    largest = float(np.abs(ticks).max())
    if not 1e-4 <= largest < 1e5:
        ticks, step = ticks / largest, step / largest
    decimals = next((d for d in range(12) if math.isclose(round(step, d), step, rel_tol=1e-6)), 12)
    return max(len(f"{tick:.{decimals}f}") for tick in ticks)
