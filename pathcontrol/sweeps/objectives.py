"""What is wanted of metrics: objectives that are to be small or large, and limits that are to be kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.pareto import non_dominated
from pathcontrol.errors import InputError, UnknownNameError

#: one metric, several, or several with ``"min"`` or ``"max"`` for each; small is better unless told
Objectives = str | Sequence[str] | Mapping[str, str]
#: of metrics the largest value allowed, or the smallest and the largest, None where there is none
Limits = Mapping[str, Any]

#: the statuses of samples that are never the best
FAILED = ("diverged", "unfinished")
_SIGNS = {"min": 1.0, "max": -1.0}


def check_objectives(objectives: Objectives) -> dict[str, str]:
    """``"min"`` or ``"max"`` by metric.

    Raises:
        InputError: there are none, or one is to be something else.
    """
    named = [objectives] if isinstance(objectives, str) else objectives
    given = dict(named) if isinstance(named, Mapping) else dict.fromkeys(named, "min")
    if not given or not all(isinstance(goal, str) and goal in _SIGNS for goal in given.values()):
        raise InputError(f"objectives = {objectives!r}, expected names of metrics, or {{name: 'min' or 'max'}}")
    return given


def check_limits(limits: Limits | None) -> dict[str, tuple[float, float]]:
    """The smallest and the largest value allowed by metric; infinite where there is none.

    Raises:
        InputError: one is no number, or allows nothing.
    """
    return {name: _ends(name, given) for name, given in (limits or {}).items()}


def _ends(name: str, given: Any) -> tuple[float, float]:
    listed = given.tolist() if isinstance(given, np.ndarray) else given
    ends = tuple(listed) if isinstance(listed, list | tuple) else (None, listed)
    try:
        if any(isinstance(end, str | bool) for end in ends):
            raise TypeError
        low, high = (otherwise if e is None else float(e) for e, otherwise in zip(ends, (-np.inf, np.inf), strict=True))
    except (TypeError, ValueError):
        low = high = np.nan
    if not low <= high or not (np.isfinite(low) or np.isfinite(high)):
        raise InputError(
            f"limits: {name} = {given!r}, expected the largest value allowed, or (smallest, largest) of which one may "
            "be None"
        )
    return low, high


def costs(table: xr.Dataset, objectives: Objectives) -> Array:
    """What is to be small, (sample, d): metrics, negative where they are to be large; inf where one is not known.

    Raises:
        UnknownNameError: there is no such metric.
    """
    signed = [_SIGNS[goal] * metric(table, name) for name, goal in check_objectives(objectives).items()]
    values = np.stack(signed, axis=-1)
    return np.where(np.isfinite(values), values, np.inf)


def excess(values: Array, ends: tuple[float, float]) -> Array:
    """How far values are outside a limit, as a share of it; not above 0 inside, inf where one is not known."""
    low, high = ends
    over = [sign * (values - end) / (abs(end) or 1.0) for sign, end in ((-1.0, low), (1.0, high)) if np.isfinite(end)]
    return np.where(np.isnan(values), np.inf, np.max(over, axis=0))


def within(table: xr.Dataset, limits: Limits | None) -> NDArray[np.bool_]:
    """Which samples keep all limits, (sample,); none that diverged, or did not get as far as it was to.

    Raises:
        UnknownNameError: there is no such metric.
    """
    kept = np.ones(table.sizes["sample"], dtype=bool)
    if "status" in table:
        kept &= ~failed(table)
    for name, ends in check_limits(limits).items():
        kept &= excess(metric(table, name), ends) <= 0
    return kept


def failed(table: xr.Dataset) -> NDArray[np.bool_]:
    """Which samples diverged or did not get there, (sample,): an arm that stands still has the smallest errors."""
    return np.isin(table["status"].to_numpy().astype(str), FAILED)


def front(table: xr.Dataset, objectives: Objectives, limits: Limits | None = None) -> xr.Dataset:
    """The samples within limits that no other one of these beats in all objectives, in order of the first of them.

    Raises:
        UnknownNameError: there is no such metric.
    """
    values = np.where(within(table, limits)[:, None], costs(table, objectives), np.inf)
    rows = np.flatnonzero(non_dominated(values))
    return table.isel(sample=rows[np.lexsort(values[rows].T[::-1])])


def metric(table: xr.Dataset, name: str) -> Array:
    """A metric, (sample,).

    Raises:
        UnknownNameError: there is no such metric.
    """
    known = [str(key) for key, values in table.data_vars.items() if values.dtype.kind in "fiu"]
    if name not in known:
        raise UnknownNameError(f"metric {name!r}: expected one of {', '.join(known)}")
    return table[name].to_numpy().astype(np.float64)
