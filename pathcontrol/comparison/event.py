"""The event of a scenario: from when to when its disturbances and its operator do something."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.arm.disturbance import Disturbance, TimedDisturbance, list_terms


def find_event(disturbance: Disturbance | None, duration: float, override: Any = None) -> tuple[float, float] | None:
    """Return from when to when some disturbances and an override act [s], ``None`` where none has a time.

    An event lasts until the end of the run, ``duration`` [s], where one of them does, or another one has no time.
    """
    terms = list_terms(disturbance)
    times = [
        (float(np.min(term.start)), float(np.max(term.start + term.duration)))
        for term in terms
        if isinstance(term, TimedDisturbance)
    ]
    timeless = len(times) < len(terms) or (override is not None and np.ndim(override) < 2)
    if np.ndim(override) == 2:
        times += _find_steps(np.asarray(override), duration)
    if not times:
        return None
    begin, end = max(0.0, min(begin for begin, _ in times)), max(end for _, end in times)
    if begin >= duration:  # for the error that says so
        return (begin, end)
    return (begin, duration if timeless else min(end, duration))


def _find_steps(steps: Array, duration: float) -> list[tuple[float, float]]:
    """Return from when to when the steps [[t, u], …] ask for another speed than that of the profile, or nothing."""
    changed = np.flatnonzero(steps[:, 1] != 1.0)
    if not changed.size:
        return []
    last = changed[-1] + 1
    return [(float(steps[changed[0], 0]), float(steps[last, 0]) if last < len(steps) else duration)]
