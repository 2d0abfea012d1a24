"""The chart of the power balance: how fast the Lyapunov function of a law decays, and by which causes."""

from __future__ import annotations

import numpy as np

from pathcontrol.analysis.power.power_balance_table import find_power_balance, list_causes, relative_rates
from pathcontrol.view.animation.charts.chart import Curve, Entry
from pathcontrol.view.animation.drawn_rollout import DrawnRollout

_WINDOWS = 200


def power_balance_curves(drawn_rollout: DrawnRollout, index: int, several: bool) -> list[Entry]:
    """Return the relative rates of V [1/s] over windows of time, of several runs the measured one.

    There is none for a law without a theorem.
    """
    recording = drawn_rollout.recording
    balance = find_power_balance(recording.run.with_robot(recording.robot))
    if balance is None:
        return []
    middles, rates = relative_rates(balance, windows=_WINDOWS)
    times = np.concatenate([recording.time[:1], middles[1:-1] - balance.time[0], recording.time[-1:]])
    rates = {name: rate if len(times) == len(rate) else rate[[0, -1]] for name, rate in rates.items()}
    if several:
        return [("Lyapunov function, V̇/V", "1/s", [Curve(recording.name, times, rates["measured"], index)])]
    curves = [Curve("predicted", times, rates["predicted"], index, "reference")]
    names = ["measured", *list_causes(rates)]
    curves += [Curve(name, times, rates[name], index, shade=i) for i, name in enumerate(names)]
    return [("Lyapunov function, V̇/V by cause", "1/s", curves)]
