"""The time that a stretch of a path takes by its velocity profile."""

from __future__ import annotations

import numpy as np

from pathcontrol.tasks.task import PathTask

_ACCURACY, _MOST_PIECES = 1e-6, 500  # of the quadrature: s and relative, and pieces in which it parts the path


def planned_time(task: PathTask, begin: float, end: float) -> float:
    """Return ∫ds/ϑ(s) [s] from ``begin`` to ``end``, inf where ϑ falls to 0 too fast for it to have a value."""
    from scipy.integrate import quad_vec  # takes a quarter of a second to load

    def slowness(s: float) -> float:
        with np.errstate(divide="ignore"):
            return float(1 / np.asarray(task.theta(np.array(s)), dtype=np.float64))

    with np.errstate(invalid="ignore"):  # of infinite values
        time, error = quad_vec(slowness, begin, end, epsabs=_ACCURACY, epsrel=_ACCURACY, limit=_MOST_PIECES)
    return time if error <= _ACCURACY * (1 + abs(time)) else float(np.copysign(np.inf, end - begin))
