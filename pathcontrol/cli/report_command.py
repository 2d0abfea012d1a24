"""The command ``pathcontrol report``."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pathcontrol.cli.group import import_all, json_option, open_option, open_page
from pathcontrol.cli.saved import check_out, check_runs, load_runs, robot_option, runs_argument, sweep_of, worst_option
from pathcontrol.cli.view_command import layout_option, one_or_all, print_results

if TYPE_CHECKING:
    from pathcontrol.simulation.run import Run


@click.command("report")
@runs_argument
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default=Path("report.html"),
    show_default=True,
    help="The page to write.",
)
@click.option("--title", help="Heads the page.  [default: robot, controller and duration]")
@layout_option
@worst_option
@robot_option
@open_option
@json_option
def command(
    runs: tuple[Path, ...],
    out: Path,
    title: str | None,
    layout: str,
    worst: int | None,
    robot: str | None,
    opened: bool,
    as_json: bool,
) -> None:
    """Write a report on saved runs: one HTML page.

    A RUN is a file that Run.save or `pathcontrol run` has written (.nc, .mcap), or the folder of one. Several are
    compared. Of the folder of a sweep, its numbers and figures, and the histories that it has kept, the worst first.
    The page has the animation, the metrics, the figures, the whole configuration and how to make the runs again; it
    needs no network, so that it can be kept and sent.
    """
    check_runs(runs)
    import_all()
    from pathcontrol.view.report.report import report

    check_out(out, runs)
    loaded = load_runs(runs, robot, worst)
    words = ["pathcontrol", "report", *map(str, runs), "--out", str(out)]
    different = layout if layout != "beside" else None
    for option, value in (("--title", title), ("--layout", different), ("--worst", worst), ("--robot", robot)):
        words += [option, str(value)] if value is not None else []
    details = {"title": title, "command": shlex.join(words), "sweep": sweep_of(runs)}
    page = report(one_or_all(loaded), out, layout=layout, **details)  # type: ignore[arg-type]
    print_results(loaded, {"report": page}, as_json, _analyse(loaded) if as_json else {})
    if opened:
        open_page(page)


def _analyse(runs: Mapping[str, Run]) -> dict[str, Any]:
    """Return accuracy and power balance of each run that has them, as JSON takes them."""
    from pathcontrol.analysis.lap_accuracy.accuracy_table import find_accuracy
    from pathcontrol.analysis.power.power_balance_table import find_power_balance

    kinds: dict[str, Callable[[Run], Any]] = {"accuracy": find_accuracy, "power_balance": find_power_balance}
    found = {kind: {name: find(run) for name, run in runs.items()} for kind, find in kinds.items()}
    return {kind: {n: one.to_dict() for n, one in each.items() if one is not None} for kind, each in found.items()}
