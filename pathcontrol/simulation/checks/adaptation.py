"""The warning of an adaptation that is too fast for the period of a loop."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.adaptive_slotine_li import AdaptiveSlotineLi
from pathcontrol.control.base import Controller
from pathcontrol.simulation.checks.too_fast import TooFast
from pathcontrol.tasks.batch.task_batch import TaskBatch

_SAMPLES = 17  # of a path
_MOST = 4096  # starts that are looked at
_FAST = 2.0  # h times the rate from which on a loop may be unstable; it lost its path at 4 to 12 in simulations


def check_adaptation(law: Controller, period: float, q: Array, qd: Array) -> Iterator[TooFast]:
    """Yield the warning of an adaptation that is too fast for a ``period`` [s], for starts at q and q̇, (N, n) each.

    With θ̂ and x both advanced by Euler's method, x⁺ = x − hM⁻¹(K_d x − Yθ̃) and θ̃⁺ = θ̃ − hΓYᵀx for one joint, the
    product of the eigenvalues is 1 − hK_d/M + h²YΓYᵀ/M, which is below 1 where hYΓYᵀ < K_d.
    """
    if not isinstance(law, AdaptiveSlotineLi):
        return
    places = {}
    if len(q) <= _MOST:
        places["at the start, which is so far from the path"] = law.learning_rate(q, qd, law.start(q, qd))
    several = any(np.ndim(getattr(law, name)) > (name != "k") for name in law.gains)  # k has no joints
    if not isinstance(law.task, TaskBatch) and not several:
        places["on the path"] = _rates_on_path(law)
    fastest = {where: float(np.max(rates, initial=0.0)) for where, rates in places.items()}
    where = max(fastest, key=lambda place: fastest[place], default="")
    if where and (rate := fastest[where]) * period > _FAST:
        most = float(np.max(law.adaptation)) * _FAST / (rate * period)
        yield TooFast(
            "adaptation",
            rate * period,
            f"adaptation = {np.max(law.adaptation):g} learns at {rate:.3g} 1/s {where}, too fast for a period of "
            f"{period:g} s: the loop may be unstable; take adaptation below {most:.2g}, shorten the period, or "
            'begin nearer to the path, as with start="nearest"',
        )


def _rates_on_path(law: AdaptiveSlotineLi) -> Array:
    """Return the rates [1/s] at places of the path, for an arm on it at its velocity."""
    s = np.linspace(*law.task.sampled_interval, _SAMPLES)
    point = law.task.at(s)
    z = np.array(law.start(point.q_d, point.velocity))
    z[:, 0] = s
    return law.learning_rate(point.q_d, point.velocity, z)
