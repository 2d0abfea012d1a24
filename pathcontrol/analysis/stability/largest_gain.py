"""The largest gain with which a law stays on its path."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array, check_whole
from pathcontrol.analysis.stability.gain_growth import GainGrowth, Loop
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.law_gains import largest_entry
from pathcontrol.errors import InputError
from pathcontrol.simulation.loops import SampledLoop

_STEP, _CONTINUOUS_STEP = 2.0, 8.0  # factors between gains that are tried, in a sampled loop and in continuous time
_TOGETHER, _MOST = 8, 40  # gains that are tried at once, and at most in either direction
_MOST_CONTINUOUS = 8  # in continuous time, beyond which rounding is larger than the slowest rates


def largest_gain(law: Controller, gain: str, loop: Loop = None, *, settle: int = 3) -> float:
    """Return the largest value of a gain with which a law on its closed path is stable, its other gains as they are.

    From the law's own value upwards, where that is stable, and else downwards, gains are tried that double (in
    continuous time eight times as large); the boundary max |μ| = 1 between two of them is found as by
    :func:`stability_map`, to 1e-6. It is that of the linearised loop: deviations that are not small may need a smaller
    gain.

    Args:
        law: the law, with one closed path and one set of gains; its own model is the arm.
        gain: the gain, by the name of the law's argument; in all joints the same.
        loop: how the loop is closed, as for :func:`floquet`; ``None`` for continuous time.
        settle: laps of a sampled loop before it is linearised.

    Returns:
        The gain, in its own unit; infinity where the loop is stable up to 2⁴⁰ times the law's own, in continuous time
        up to 2²⁴ times.

    Raises:
        UnknownNameError: the law has no such gain.
        InputError: the loop is unstable with any value of the gain, or as of :func:`floquet`.
    """
    check_controller("law", law)
    own = largest_entry(law, gain) or 1.0
    grow = GainGrowth(law, [gain], loop, check_whole("settle", settle, 1))
    step, most = (_STEP, _MOST) if isinstance(loop, SampledLoop) else (_CONTINUOUS_STEP, _MOST_CONTINUOUS)
    if grow(np.array([[own]]))[0][0] < 0:
        found = _search(grow, own, step, most, stable=False)
        if found is None:
            return np.inf
        low, high = found / step, found
    else:
        found = _search(grow, own, 1 / step, most, stable=True)
        if found is None:
            raise InputError(
                f"{type(law).__name__} is unstable with any {gain} up to {own:g}; its other gains do not suit the loop",
                argument=gain,
                value=own,
            )
        low, high = found, found * step
    return float(grow.find_roots(np.array([[low]]), np.array([[high]]))[0, 0])


def _search(grow: GainGrowth, own: float, factor: float, most: int, stable: bool) -> float | None:
    """Return the first of ``most`` gains own · factorⁱ that is ``stable`` or not, or ``None`` if there is none."""
    for begin in range(1, most + 1, _TOGETHER):
        tried: Array = own * factor ** np.arange(begin, begin + _TOGETHER)
        is_wanted = (grow(tried[:, None])[0] < 0) == stable
        if is_wanted.any():
            return float(tried[int(is_wanted.argmax())])
    return None
