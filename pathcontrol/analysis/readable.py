"""Metrics as a person reads them: degrees for radians, millimetres or micrometres for metres."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.run_metrics import UNITS
from pathcontrol.simulation.run import Run

_NOTHING = 1e-7  # of the largest of several numbers
_ROUNDING = 1e-9  # rad, m, N m, …: what an arm of these sizes has by the digits of floats alone
_VARIABLES = {"rad": "q", "rad/s": "qd", "N m": "tau_demand"}


def reading(unit: str, values: Array) -> tuple[float, str]:
    """The factor to, and the name of, the unit in which a person reads values of a unit."""
    if unit in ("rad", "rad/s"):
        return 180 / np.pi, unit.replace("rad", "deg")
    if unit == "m/s":
        return 1e3, "mm/s"
    if unit == "m":
        return (1e3, "mm") if np.abs(values[np.isfinite(values)]).max(initial=0.0) >= 1e-3 else (1e6, "µm")
    return 1.0, unit


def without_rounding(values: Array) -> Array:
    """Return values in SI units with 0 where they are smaller than a billionth, which is rounding on an arm."""
    return np.where(np.abs(values) < _ROUNDING, 0.0, values)


def in_degrees(values: Array, unit: str) -> tuple[Array, str]:
    """Values over time, and their unit: degrees for angles; unchanged where joints slide, too."""
    if unit.split("/")[0] != "rad" or " or " in unit:
        return values, unit
    return np.rad2deg(values), unit.replace("rad", "deg")


def readable_number(value: float, unit: str) -> str:
    """A number with its unit, as a person reads it."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "never" if unit == "s" else "∞"
    value = float(without_rounding(np.array(value)))
    factor, name = reading(unit, np.array([value]))
    return f"{factor * value:.4g} {name}".strip()


def unit_of(metric: str, run: Run) -> str:
    """The unit of a metric; that of the run where joints slide."""
    unit = UNITS[metric]
    if metric == "orientation_error_peak":  # an angle whatever the joints do
        return unit
    if unit == "N m/rad":
        return " or ".join(map("/".join, zip(*(_units(part, run) for part in ("N m", "rad")), strict=True)))
    return " or ".join(_units(unit, run))


def _units(unit: str, run: Run) -> list[str]:
    """What stands for a unit where joints turn, slide, or both."""
    return run.unit(_VARIABLES[unit]).split(" or ") if _VARIABLES.get(unit, "") in run else [unit]


def readable_parameters(parameters: Mapping[str, Any], digits: int = 4) -> str:
    """Parameters in as many digits, by name; of dotted keys by the last part, where that tells them apart."""
    last = [name.rpartition(".")[2] for name in parameters]
    names = last if len(set(last)) == len(last) else list(parameters)
    return ", ".join(
        f"{name} = {_value(value, digits)}" for name, value in zip(names, parameters.values(), strict=True)
    )


def counted(number: int, word: str) -> str:
    """A number of things: ``"1 path"``, ``"2 paths"``."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def _value(value: Any, digits: int) -> str:
    if np.ndim(value):
        # what is next to nothing beside the others is 0 but for rounding
        numbers = np.asarray(value)
        if numbers.dtype.kind == "f":
            numbers = np.where(np.abs(numbers) < _NOTHING * np.abs(numbers).max(initial=0.0), 0.0, numbers)
        return f"[{', '.join(_value(one, digits) for one in numbers)}]"
    if np.asarray(value).dtype.kind != "f":
        return str(value)
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits}g}"
