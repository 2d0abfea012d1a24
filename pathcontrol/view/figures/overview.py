"""The first figures of a sweep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from pathcontrol.analysis.run_metrics import LABELS
from pathcontrol.view.figures.pareto_figure import pareto_figure
from pathcontrol.view.figures.sweep_columns import readable_metric
from pathcontrol.view.figures.sweep_figures import basin_figure, robustness_figure

_MOST = 6  # parameters with a figure each
_COSTS = ("tau_noise", "tau_demand_ratio", "tau_demand_peak", "tau_peak")  # the price of small errors


def overview(table: xr.Dataset, metrics: Sequence[str], first: str) -> Iterator[tuple[str, Figure]]:
    """Yield figures with their captions: a metric over each parameter and over two, and its trade-off with another.

    Args:
        table: of the sweep.
        metrics: those in it that may be drawn.
        first: the one that matters, if it is there.
    """
    known = [name for name in metrics if np.isfinite(readable_metric(table, name)[0]).any()]
    if not known:
        return
    metric, varied = first if first in known else known[0], _list_varied(table)
    called = LABELS.get(metric, metric)
    for name in varied[:_MOST]:
        yield f"{called}, over {name}", robustness_figure(table, name, metric)
    if len(varied) > 1:
        yield (
            f"{called}, over {varied[0]} and {varied[1]}",
            basin_figure(table, varied[0], varied[1], metric),
        )
    others = [name for name in (*_COSTS, *known) if name in known and name != metric]
    if others:
        yield f"Pareto front, with {LABELS.get(others[0], others[0])}", pareto_figure(table, metric, others[0])


def _list_varied(table: xr.Dataset) -> list[str]:
    """Return the parameters that are numbers and differ, of vectors their components."""
    found = []
    for name, values in table.coords.items():
        if name == "sample" or values.dtype.kind not in "iuf":
            continue
        columns = values.to_numpy().reshape(table.sizes["sample"], -1).T
        said = [f"{name}[{i}]" for i in range(len(columns))] if values.ndim == 2 else [str(name)]
        found += [one for one, column in zip(said, columns, strict=True) if np.ptp(column) > 0]
    return found
