"""The columns of a sweep's table, as figures show them."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.readable import reading
from pathcontrol.analysis.run_metrics import LABELS
from pathcontrol.errors import InputError, UnknownNameError
from pathcontrol.sweeps import objectives as goals
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.view.figures.ticks import label_plainly

_DECADES = 30.0  # ratio of the largest to the smallest value from which a scale is logarithmic


def table_of(sweep: SweepResult | xr.Dataset) -> xr.Dataset:
    """Return the table of a sweep, or the table itself.

    Raises:
        InputError: it is something else, or empty.
    """
    expect("sweep", sweep, SweepResult, xr.Dataset, also=" or its table")
    table = sweep.table() if isinstance(sweep, SweepResult) else sweep
    if "sample" not in table.dims:
        raise InputError(f"sweep = {sweep!r}, expected a SweepResult or its table", argument="sweep", value=sweep)
    if not table.sizes["sample"]:
        raise InputError("the sweep has no finished samples yet", argument="sweep")
    return table


def column_of_parameter(table: xr.Dataset, name: str) -> Array:
    """Return a parameter that is a number, (sample,); from a vector one component, as ``q[0]``.

    Raises:
        UnknownNameError: there is no such parameter.
    """
    numbers: dict[str, Any] = {}
    for known, values in table.coords.items():
        if known != "sample" and values.dtype.kind in "iuf":
            many = values.ndim == 2
            numbers |= {f"{known}[{i}]": v for i, v in enumerate(values.T)} if many else {str(known): values}
    if name not in numbers:
        raise UnknownNameError(
            f"parameter {name!r}: expected one of {', '.join(numbers)}", value=name, choices=tuple(numbers)
        )
    return np.asarray(numbers[name], dtype=np.float64)


def readable_metric(table: xr.Dataset, name: str) -> tuple[Array, str]:
    """Return a metric (sample,) in the unit in which a person reads it, NaN where not finite, and that unit.

    Raises:
        UnknownNameError: there is no such metric.
    """
    values = goals.metric(table, name)
    factor, unit = readable_factor(table, name)
    return np.where(np.isfinite(values), factor * values, np.nan), unit


def readable_factor(table: xr.Dataset, name: str) -> tuple[float, str]:
    """Return the factor of a metric to the unit in which a person reads it, and that unit."""
    return reading(table[name].attrs.get("units", ""), goals.metric(table, name))


def never(table: xr.Dataset, metric: str) -> Array:
    """Return the samples whose metric is infinite, as the settling time of what never settles, (sample,)."""
    return np.isinf(goals.metric(table, metric))


def wide(values: Array) -> bool:
    """Return whether a scale of these values is logarithmic."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0 and known.max() > _DECADES * known.min())


def set_scales(axes: Axes, right: Array, up: Array) -> None:
    """Set the scales of both axes for these values: logarithmic where they are :func:`wide`."""
    axes.set(**{f"{letter}scale": "log" if wide(values) else "linear" for letter, values in (("x", right), ("y", up))})
    for axis in (axes.xaxis, axes.yaxis):
        label_plainly(axis)


def colour_bar(figure: Figure, points: Any, axes: Axes, words: str) -> None:
    """Draw the scale of the colours of ``points`` beside the axes."""
    bar = figure.colorbar(points, ax=axes, label=words)
    bar.outline.set_visible(False)
    label_plainly(bar.ax.yaxis)


def label(metric: str, unit: str) -> str:
    """Return the label of a metric on an axis."""
    return LABELS.get(metric, metric) + (f" [{unit}]" if unit else "")
