"""The numbers and figures of a sweep for its report."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from pathcontrol.analysis.run_metrics import LABELS
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.view.figures.columns import never, readable_metric
from pathcontrol.view.figures.overview import overview
from pathcontrol.view.report.pictures import picture
from pathcontrol.view.report.summary import Cell, Row

_NOT_METRICS = ("finish_time", "diverged_time")


def sweep_content(sweep: SweepResult) -> dict[str, Any]:
    """Return the content of the section of a sweep: a sentence, a row for each metric, and figures."""
    table = sweep.table()
    names = [str(name) for name, v in table.data_vars.items() if v.dtype.kind == "f" and name not in _NOT_METRICS]
    return {
        "said": _describe_sweep(sweep, table),
        "rows": [row for name in names if (row := _row(table, name)) is not None],
        "pictures": [picture(figure, caption) for caption, figure in overview(table, names, sweep.kept_by)],
    }


def _describe_sweep(sweep: SweepResult, table: xr.Dataset) -> str:
    """Return the sentence about a sweep."""
    statuses = table["status"].to_numpy().tolist()
    counts = ", ".join(f"{statuses.count(status)} {status}" for status in sorted(set(statuses)))
    finished = (
        f"{sweep.finished} of {sweep.samples} samples" if sweep.finished < sweep.samples else f"{sweep.samples} samples"
    )
    return f"{finished}: {counts}. It keeps {len(sweep.kept)} histories; above are the worst of them, the worst first."


def _row(table: xr.Dataset, name: str) -> Row | None:
    """Return the row of a metric with at least one value over all samples."""
    values, unit = readable_metric(table, name)
    if np.isnan(values).all():
        return None
    largest, endless = int(np.nanargmax(values)), int(never(table, name).sum())
    numbers = [np.nanmin(values), np.nanmedian(values), values[largest]]
    texts = (f"{number:#.4g}".rstrip(".") for number in numbers)
    cells = [*texts, str(int(table["sample"][largest])), f"{endless} never" if endless else ""]
    return Row(LABELS.get(name, name), unit, tuple(map(Cell, cells)))
