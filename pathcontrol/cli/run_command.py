"""The command ``pathcontrol run``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import engine_option, import_all, json_option, open_option, open_page

if TYPE_CHECKING:
    from pathcontrol.experiments.runner import Outcome
    from pathcontrol.simulation.engines import Engine


@click.command("run")
@click.argument("file", type=click.Path(exists=False, path_type=Path), required=False)
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="Default: results/ and the file's name.")
@click.option("--example", is_flag=True, help="Print a commented experiment file and stop.")
@engine_option
@open_option
@json_option
def command(
    file: Path | None, out: Path | None, example: bool, engine: Engine | None, opened: bool, as_json: bool
) -> None:
    """Run the experiment that FILE.toml describes."""
    if example:
        from pathcontrol.experiments.template import example_text

        click.echo(example_text(), nl=False)
        return
    if file is None:
        raise click.UsageError("give an experiment file; --example prints one to start from")
    check_file(file, "an experiment")
    import_all()
    from pathcontrol.experiments.runner import run_experiment

    out = Path("results") / file.stem if out is None else out
    done = run_experiment(file, out, engine=engine)
    if opened and "html" not in done.written:  # requested by the option, not by the file
        done.written["html"] = _animation(done, out)
    _print_results(done, as_json)
    if opened:
        open_page(done.written["html"])


def _animation(done: Outcome, out: Path) -> Path:
    """Write the animation."""
    from pathcontrol.view.animation.record import record

    return record(done.run).save(out / "run.html")


def _print_results(done: Outcome, as_json: bool) -> None:
    """Print the results."""
    from rich.console import Console

    from pathcontrol.analysis.run_remarks import remarks
    from pathcontrol.analysis.window import describe_window
    from pathcontrol.cli.tables import contour_tables, metric_lines, remark_lines

    written = {name: str(path) for name, path in done.written.items()}
    if as_json:
        click.echo(
            json.dumps(
                {"run": repr(done.run), "metrics": done.metrics, "remarks": remarks(done.run), "written": written}
            )
        )
        return
    click.echo(repr(done.run))
    cuts = "path_time" in done.metrics and "tool_deviation_peak" in done.metrics
    click.echo(
        f"  errors are of {'the cuts' if cuts else describe_window()}, torques and shares of limits of all of it"
    )
    if posture := getattr(done.run.task, "posture", ""):
        click.echo(f"  posture: {posture}")
    for line in metric_lines(done.metrics, done.run):
        click.echo(f"  {line}")
    console = Console()
    for table in contour_tables(done.run, console.width):
        console.print(table)
    for line in remark_lines(done.run):
        click.echo(f"  {line}")
    for name, path in written.items():
        click.echo(f"  {name}: {path}")
