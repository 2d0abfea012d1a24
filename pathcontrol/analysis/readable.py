"""Metrics as a person reads them: degrees for radians, millimetres or micrometres for metres."""

from __future__ import annotations

import numpy as np

from pathcontrol.analysis.metrics import UNITS
from pathcontrol.simulation.run import Run

_VARIABLES = {"rad": "q", "rad/s": "qd", "N m": "tau_demand"}


def readable_number(value: float, unit: str) -> str:
    """A number with its unit, as a person reads it: degrees for radians, millimetres or micrometres for metres."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "never" if unit == "s" else "∞"
    if unit in ("rad", "rad/s"):
        value, unit = float(np.rad2deg(value)), unit.replace("rad", "deg")
    elif unit == "m":
        value, unit = (1e6 * value, "µm") if abs(value) < 1e-3 else (1e3 * value, "mm")
    return f"{value:.4g} {unit}".strip()


def unit_of(metric: str, run: Run) -> str:
    """The unit of a metric; that of the run where joints slide."""
    unit = UNITS[metric]
    return str(run[_VARIABLES[unit]].attrs["units"]) if _VARIABLES.get(unit) in run.data else unit
