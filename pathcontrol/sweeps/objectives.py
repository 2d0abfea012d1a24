"""Objectives, metrics that are to be small or large, and limits that they are to keep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.pareto import non_dominated
from pathcontrol.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    import xarray as xr

#: one metric, several, or several with ``"min"`` or ``"max"`` for each; ``"min"`` by default
Objectives = str | Sequence[str] | Mapping[str, str]
#: by metric the largest value allowed, or the smallest and the largest, None where there is none
Limits = Mapping[str, Any]

#: the statuses of samples that are never the best
FAILED = ("diverged", "unfinished")
_SIGNS = {"min": 1.0, "max": -1.0}


def check_objectives(objectives: Objectives) -> dict[str, str]:
    """Check the objectives; return ``"min"`` or ``"max"`` by metric.

    Raises:
        InputError: there are none, or one is to be something else.
    """
    named = [objectives] if isinstance(objectives, str) else objectives
    given = dict(named) if isinstance(named, Mapping) else dict.fromkeys(named, "min")
    if not given or not all(isinstance(goal, str) and goal in _SIGNS for goal in given.values()):
        raise InputError(
            f"objectives = {objectives!r}, expected names of metrics, or {{name: 'min' or 'max'}}",
            argument="objectives",
            value=objectives,
        )
    return given


def check_limits(limits: Limits | None) -> dict[str, tuple[float, float]]:
    """Check the limits; return the smallest and the largest value allowed by metric, infinite where there is none.

    Raises:
        InputError: one is no number, or allows nothing.
    """
    return {name: _parse_limit(name, given) for name, given in (limits or {}).items()}


def _parse_limit(name: str, given: Any) -> tuple[float, float]:
    """Return the smallest and the largest value of one limit."""
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
            "be None",
            argument="limits",
            value=given,
        )
    return low, high


def costs(table: xr.Dataset, objectives: Objectives) -> Array:
    """Return costs to minimise, (sample, d): metrics, negative where they are to be large; inf where unknown.

    Raises:
        UnknownNameError: there is no such metric.
    """
    signed = [_SIGNS[goal] * metric(table, name) for name, goal in check_objectives(objectives).items()]
    values = np.stack(signed, axis=-1)
    return np.where(np.isfinite(values), values, np.inf)


def excess(values: Array, ends: tuple[float, float]) -> Array:
    """Return how far values are outside a limit, as a share of it; ≤ 0 inside, inf where unknown."""
    low, high = ends
    over = [sign * (values - end) / (abs(end) or 1.0) for sign, end in ((-1.0, low), (1.0, high)) if np.isfinite(end)]
    return np.where(np.isnan(values), np.inf, np.max(over, axis=0))


def within(table: xr.Dataset, limits: Limits | None) -> NDArray[np.bool_]:
    """Return which samples keep all limits, (sample,); none that diverged or did not finish.

    Raises:
        UnknownNameError: there is no such metric.
    """
    kept = np.ones(table.sizes["sample"], dtype=bool)
    if "status" in table:
        kept &= ~has_failed(table)
    for name, ends in check_limits(limits).items():
        kept &= excess(metric(table, name), ends) <= 0
    return kept


def has_failed(table: xr.Dataset) -> NDArray[np.bool_]:
    """Return which samples diverged or did not finish, (sample,): an arm that stands still has the smallest errors."""
    return np.isin(table["status"].to_numpy().astype(str), FAILED)


def front(table: xr.Dataset, objectives: Objectives, limits: Limits | None = None) -> xr.Dataset:
    """Return the samples within limits that no other one dominates, in order of the first objective.

    Raises:
        UnknownNameError: there is no such metric.
    """
    values = np.where(within(table, limits)[:, None], costs(table, objectives), np.inf)
    rows = np.flatnonzero(non_dominated(values))
    return table.isel(sample=rows[np.lexsort(values[rows].T[::-1])])


def metric(table: xr.Dataset, name: str) -> Array:
    """Return a metric, (sample,).

    Raises:
        UnknownNameError: there is no such metric.
    """
    known = [str(key) for key, values in table.data_vars.items() if values.dtype.kind in "fiu"]
    if name not in known:
        raise UnknownNameError(f"metric {name!r}: expected one of {', '.join(known)}", value=name, choices=tuple(known))
    return table[name].to_numpy().astype(np.float64)
