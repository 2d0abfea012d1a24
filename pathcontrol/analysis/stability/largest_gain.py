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
    tried = own * step ** np.arange(1.0 + most)
    rates = _grow_while(grow, tried, stable=True)
    if not rates[0] < 0:
        tried = own / step ** np.arange(1.0 + most)
        rates = _grow_while(grow, tried, stable=False)
    stable = rates < 0
    if stable.all():
        return np.inf
    if not stable.any():
        raise InputError(
            f"{type(law).__name__} is unstable with any {gain} up to {own:g}; its other gains do not suit the loop",
            argument=gain,
            value=own,
        )
    change = int((stable != stable[0]).argmax())
    low, high = sorted([change - 1, change], key=lambda i: tried[i])
    ends = rates[[low]], rates[[high]]
    return float(grow.find_roots(tried[[low], None], tried[[high], None], ends)[0, 0])


def _grow_while(grow: GainGrowth, tried: Array, *, stable: bool) -> Array:
    """Return the growth rates of the gains in ``tried``, some at once, until one is not ``stable`` or is."""
    rates = np.zeros(0)
    for begin in range(0, len(tried), _TOGETHER):
        rates = np.append(rates, grow(tried[begin : begin + _TOGETHER, None])[0])
        if ((rates < 0) != stable).any():
            break
    return rates
