"""The power balance of runs for a reader: relative rates over windows of time, and a table of means."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.power.power_balance import SHARES, PowerBalance, power_balance
from pathcontrol.errors import PathControlError
from pathcontrol.simulation.run import Run

_RATES = ("predicted", "measured", *SHARES, "residual")
#: the rates in words
WORDS = {
    "predicted": "predicted by the theorem",
    "measured": "measured",
    "friction": "friction, not compensated",
    "saturation": "saturation",
    "sampling": "sampling: hold, delay, sensors",
    "model": "model: the arm is another one",
    "disturbance": "disturbances",
    "residual": "residual",
}
#: share of the largest relative rate below which a cause is left out of figures
NEGLIGIBLE = 5e-3
_WINDOWS = 60


def find_power_balance(run: Run) -> PowerBalance | None:
    """Return the power balance of the first rollout of a run; ``None`` where it has none.

    It has none where its law has no theorem or is not known, and where it lacks what is compared.
    """
    try:
        return power_balance(run.rollout(0))
    except PathControlError:
        return None


def relative_rates(balance: PowerBalance, rollout: int = 0, windows: int = _WINDOWS) -> tuple[Array, dict[str, Array]]:
    """Return the middles [s] of some windows of time, (w,), and the mean of each rate there over that of V [1/s].

    Rates are noisy from tick to tick, and V falls by decades; their quotient is how fast V decays, and why. NaN where
    the rollout has diverged or V is 0.
    """
    count = len(balance.middle)
    ends = np.unique(np.linspace(0, count, min(windows, count) + 1).astype(int))
    widths = np.diff(balance.time)
    V = 0.5 * (balance.V[rollout, 1:] + balance.V[rollout, :-1])

    def total(values: Array) -> Array:
        return np.add.reduceat(values * widths, ends[:-1])

    with np.errstate(invalid="ignore", divide="ignore"):
        level = total(V)
        rates = {name: total(getattr(balance, name)[rollout]) / level for name in _RATES}
    middles = total(balance.middle) / total(np.ones(count))
    return middles, {name: np.where(np.isfinite(rate), rate, np.nan) for name, rate in rates.items()}


def list_causes(rates: dict[str, Array]) -> list[str]:
    """Return the causes that are not negligible in relative rates, as they are called."""
    largest = max((np.abs(rate[np.isfinite(rate)]).max(initial=0.0) for rate in rates.values()), default=0.0)
    causes = (*SHARES, "residual")
    return [n for n in causes if np.abs(rates[n][np.isfinite(rates[n])]).max(initial=0.0) > NEGLIGIBLE * largest]


def power_balance_table(run: Run) -> list[list[str]]:
    """Return the mean rates of V of a run as rows of texts, heads first; empty where there are none."""
    balance = find_power_balance(run)
    if balance is None:
        return []
    half = 0.5 * (balance.time[0] + balance.time[-1])
    parts = [balance.means(), balance.means(begin=half)]
    rows = [["mean of V", *(_text(part["V"], balance.unit) for part in parts)]]
    rows += [[WORDS[name], *(_text(part[name], balance.rate_unit) for part in parts)] for name in _RATES]
    of = ", first rollout" if run.rollouts > 1 else ""
    return [["rate of V", f"all of the time{of}", f"second half{of}"], *rows]


def _text(values: Array, unit: str) -> str:
    """Return the value of the first rollout as a text."""
    shown = unit.replace("^2", "²").replace("^3", "³")
    return f"{values[0] + 0.0:.3g} {shown}" if np.isfinite(values[0]) else "–"
