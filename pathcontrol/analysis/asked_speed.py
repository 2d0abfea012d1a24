"""The factor of the speed along the path that an operator asked for, by the configuration of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.config import first_rollout, laws
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.summaries import is_whole


def asked_factor(run: Run) -> Array | None:
    """Return |w| at each sample as an override asks for it, broadcasts to (rollout, time); None where there is none.

    After a step of u the factor w comes to it at the acceleration of the override. It is None, too, for an override
    that is a function, of which a configuration has no values.
    """
    law = laws(run.config)[0]
    given = law.get("override")
    if given is None or not is_whole(given):
        return None
    try:
        values = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if values.ndim == 2 and values.shape[1] == 2:
        steps = np.append(1.0, values[:, 1])[np.searchsorted(values[:, 0], run.time, side="right")]
        values = _follow(steps, run.time, law.get("acceleration"))
    elif values.ndim == 1 and len(values):
        values = values[(run.array("rollout").astype(int) - first_rollout(run.config)) % len(values), None]
    return np.abs(values) if values.ndim < 3 and values.size else None


def _follow(u: Array, time: Array, acceleration: Any) -> Array:
    """Return what follows u (k,) from its first value on, at no more than an acceleration [1/s], (k,)."""
    most = float(acceleration) if isinstance(acceleration, int | float) else np.inf
    w = u.copy()
    for i, reach in enumerate(most * np.diff(time)):
        w[i + 1] = w[i] + min(max(u[i] - w[i], -reach), reach)
    return w
