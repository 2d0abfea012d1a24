"""The sections of a report, from templates in which every name is text and never markup."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

import jinja2
import numpy as np
import xarray as xr
from markupsafe import Markup, escape

from pathcontrol.analysis.contours import contour_table
from pathcontrol.analysis.lap_accuracy.accuracy_table import accuracy_table
from pathcontrol.analysis.lap_table import lap_table
from pathcontrol.analysis.power.power_balance_table import power_balance_table
from pathcontrol.analysis.readable import describe_outcomes
from pathcontrol.analysis.run_metrics import LABELS, UNITS
from pathcontrol.analysis.run_remarks import remarks
from pathcontrol.analysis.window import describe_window
from pathcontrol.simulation.run import Run
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.view.figures.overview import overview
from pathcontrol.view.figures.sweep_columns import never, readable_metric
from pathcontrol.view.page.html import Section
from pathcontrol.view.report.downloads import Download, json_file, signals_file
from pathcontrol.view.report.pictures import picture, pictures
from pathcontrol.view.report.reproduction import recipe, versions
from pathcontrol.view.report.run_summary import Cell, Row, facts, measure, rows
from pathcontrol.view.report.settings_table import settings

_NOT_METRICS = ("finish_time", "diverged_time")


def sections(runs: Mapping[str, Run], made_by: str, sweep: SweepResult | None = None) -> list[Section]:
    """Return the sections below the animation: summary, figures, configuration, and reproduction.

    Args:
        runs: the runs by their names.
        made_by: the call or the command that makes this page.
        sweep: what the runs are histories of, if they are.
    """
    numbers = {name: measure(run) for name, run in runs.items()}
    configs = [run.config for run in runs.values()]
    configuration = configs[0] if len(runs) == 1 else {name: run.config for name, run in runs.items()}
    return [
        *([] if sweep is None else [_section("Sweep", **sweep_content(sweep))]),
        _section(
            "Summary",
            runs=runs,
            facts=facts(runs),
            rows=rows(runs, numbers),
            remarks=[(name, sentence) for name, run in runs.items() for sentence in remarks(run)],
            contours=[(name, table) for name, run in runs.items() if (table := contour_table(run))],
            accuracy=[(name, table) for name, run in runs.items() if (table := accuracy_table(run))],
            power=[(name, table) for name, run in runs.items() if (table := power_balance_table(run))],
            laps=[(name, table) for name, run in runs.items() if (table := lap_table(run))],
            window=describe_window(),
            files=[_metrics_file(numbers), json_file("configuration.json", configuration), *_signals(runs)],
        ),
        _section("Figures", pictures=pictures(runs)),
        _section("Configuration", runs=runs, groups=settings(configs), json=_json(configuration)),
        _section(
            "How to reproduce",
            runs=runs,
            recipes=[recipe(name, run) for name, run in runs.items()],
            versions=versions(configs),
            made_by=made_by,
        ),
    ]


def _section(title: str, **content: Any) -> Section:
    """Return a section from its template."""
    template = templates().get_template(f"{title.lower().replace(' ', '_')}.html")
    return Section(title, Markup(template.render(content)))


@cache
def templates() -> jinja2.Environment:
    """Return the templates of reports, in which every name is text and never markup."""
    found = jinja2.Environment(
        loader=jinja2.PackageLoader("pathcontrol.view.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["symbols"] = _symbols
    return found


def _symbols(text: str) -> Markup:
    """Return ``text`` with the letters after underscores as indices, as in e_p."""
    return Markup(re.sub(r"_(\w)", r"<sub>\1</sub>", str(escape(text))))


def _metrics_file(numbers: Mapping[str, Mapping[str, Any]]) -> Download:
    """Return the file of metrics."""
    units = {key: UNITS[key] for values in numbers.values() for key in values}
    return json_file("metrics.json", {"metrics": numbers, "units": units})


def _signals(runs: Mapping[str, Run]) -> list[Download]:
    """Return the files of signals."""
    return [signals_file(f"{name}-signals.csv" if len(runs) > 1 else "signals.csv", run) for name, run in runs.items()]


def _json(value: Any) -> str:
    """Return a value as JSON."""
    return json.dumps(value, indent=2, ensure_ascii=False)


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
    finished = (
        f"{sweep.finished} of {sweep.samples} samples" if sweep.finished < sweep.samples else f"{sweep.samples} samples"
    )
    kept = f"It keeps {len(sweep.kept)} histories; above are the worst of them, the worst first."
    return f"{finished}: {describe_outcomes(statuses)}. {kept}"


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
