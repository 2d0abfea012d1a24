"""The command ``pathcontrol tune``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pathcontrol._interrupts import delay_interrupt
from pathcontrol._json import to_json
from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import engine_option, json_option
from pathcontrol.cli.sweep_command import chunk_option, out_option, resume_option

if TYPE_CHECKING:
    from pathcontrol.simulation.engines import Engine
    from pathcontrol.tuning.tuning_result import Candidate, Tuning


@click.command("tune")
@click.argument("file", type=click.Path(exists=False, path_type=Path))
@out_option
@resume_option
@chunk_option
@engine_option
@json_option
def command(file: Path, out: Path | None, resume: bool, chunk: int, engine: Engine | None, as_json: bool) -> None:
    """Search what the [tune] in FILE.toml asks for.

    Prints the best candidates and what the limits cost, and draws the front as front.svg and front.png in the folder,
    where every rollout is noted. After Ctrl-C it tells what was found, and --resume goes on.
    """
    check_file(file, "an experiment")
    with delay_interrupt():
        from pathcontrol.experiments.tune_runner import run_tune
        from pathcontrol.view.figures.pareto_figure import pareto_figure
        from pathcontrol.view.figures.style import save_figure
    out = Path("results") / file.stem if out is None else out
    tuning = run_tune(file, out, chunk=chunk, resume=resume, engine=engine)
    figures = []
    if len(tuning.directions) > 1 and tuning.front().sizes["sample"]:
        figures = [str(path) for path in save_figure(pareto_figure(tuning), out / "front")]
    if as_json:
        click.echo(json.dumps(_content(tuning) | {"out": str(out), "figures": figures}))
        return
    click.echo(str(tuning))
    for path in figures:
        click.echo(f"  figure: {path}")


def _content(tuning: Tuning) -> dict[str, Any]:
    """Return the result as JSON has it."""
    front = tuning.front()["sample"].to_numpy().tolist()
    return {
        "candidates": tuning.table().sizes["sample"],
        "feasible": tuning.feasible().sizes["sample"],
        "best": {name: _describe(tuning.best(name)) for name in tuning.objectives},
        "nearest": _describe(tuning.nearest()),
        "front": [_describe(tuning.candidate(int(i))) for i in front],
        "activity": {name: active._asdict() for name, active in tuning.activity().items()},
    }


def _describe(one: Candidate | None) -> dict[str, Any] | None:
    """Return a candidate as JSON has it; values that are not finite are null."""
    if one is None:
        return None
    return to_json({"number": one.number, "parameters": one.parameters, "metrics": one.metrics})
