"""Metrics in units for a reader: degrees for radians, millimetres or micrometres for metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.run_metrics import UNITS
from pathcontrol.simulation.run import Run

_NOTHING = 1e-7  # share of the largest of several numbers that counts as 0
_ROUNDING = 1e-9  # rad, m, N m, …: rounding of floats for an arm of usual size
_OUTCOMES = {"running": "ran until the time was up", "unfinished": "did not get as far as asked for"}
_VARIABLES = {"rad": "q", "rad/s": "qd", "N m": "tau_demand"}


def reading(unit: str, values: Array) -> tuple[float, str]:
    """Return the factor to the unit in which a person reads values of a unit, and its name."""
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
    """Return values over time, and their unit, in degrees if they are angles; unchanged where joints slide, too."""
    if unit.split("/")[0] != "rad" or " or " in unit:
        return values, unit
    return np.rad2deg(values), unit.replace("rad", "deg")


def readable_number(value: float, unit: str) -> str:
    """Return a number with its unit as a text."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "never" if unit == "s" else "∞"
    value = float(without_rounding(np.array(value)))
    factor, name = reading(unit, np.array([value]))
    return f"{factor * value:.4g} {name}".strip()


def describe_outcomes(statuses: Sequence[str]) -> str:
    """Return how many rollouts of each status there are, in words."""
    return ", ".join(f"{statuses.count(status)} {_OUTCOMES.get(status, status)}" for status in sorted(set(statuses)))


def unit_of(metric: str, run: Run) -> str:
    """Return the unit of a metric, as it is for the joints of the run."""
    unit = UNITS[metric]
    if metric == "orientation_error_peak":  # an angle for joints of any kind
        return unit
    if unit == "N m/rad":
        return " or ".join(map("/".join, zip(*(_units(part, run) for part in ("N m", "rad")), strict=True)))
    return unit_of_joints(unit, run)


def unit_of_joints(unit: str, run: Run) -> str:
    """Return a unit of turning joints as it is for the joints of the run: ``"m"`` or ``"rad or m"`` for ``"rad"``."""
    return " or ".join(_units(unit, run))


def _units(unit: str, run: Run) -> list[str]:
    """Return the units where joints turn, slide, or both."""
    return run.unit(_VARIABLES[unit]).split(" or ") if _VARIABLES.get(unit, "") in run else [unit]


def readable_parameters(parameters: Mapping[str, Any], digits: int = 4) -> str:
    """Return parameters by name with ``digits`` digits; dotted keys by the last part if that is unique."""
    last = [name.rpartition(".")[2] for name in parameters]
    names = last if len(set(last)) == len(last) else list(parameters)
    return ", ".join(
        f"{name} = {_format_value(value, digits)}" for name, value in zip(names, parameters.values(), strict=True)
    )


def count_words(number: int, word: str) -> str:
    """Return a number of things in words: ``"1 path"``, ``"2 paths"``."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def _format_value(value: Any, digits: int) -> str:
    """Return a value as a text."""
    if np.ndim(value):
        # a value that is tiny beside the others is 0 up to rounding
        numbers = np.asarray(value)
        if numbers.dtype.kind == "f":
            numbers = np.where(np.abs(numbers) < _NOTHING * np.abs(numbers).max(initial=0.0), 0.0, numbers)
        return f"[{', '.join(_format_value(one, digits) for one in numbers)}]"
    if np.asarray(value).dtype.kind != "f":
        return str(value)
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits}g}"
