"""The command ``pathcontrol stability``."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pathcontrol._json import to_json
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import import_all, json_option
from pathcontrol.errors import InputError

if TYPE_CHECKING:
    from pathcontrol.analysis.stability.floquet import Floquet
    from pathcontrol.analysis.stability.stability_map import StabilityMap

_NEUTRAL = 1e-4  # of a deviation in a lap; ticks do not fit into a lap, and rates are known to about this
_DECADES = 10.0  # ratio of ends from which values are spaced by factors


@click.command("stability")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE.toml")
@click.option(
    "--gain",
    "gains",
    type=(str, float, float),
    multiple=True,
    metavar="NAME FROM TO",
    help="Map the stability over this gain; once or twice.",
)
@click.option("--points", type=click.IntRange(2), default=12, show_default=True, metavar="N", help="Along each gain.")
@click.option("--largest", multiple=True, metavar="NAME", help="Find the largest value of this gain; may be repeated.")
@click.option(
    "--settle", type=click.IntRange(1), default=1, show_default=True, metavar="N", help="Laps before the linearisation."
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write the figure of the map to this folder.",
)
@json_option
def command(
    file: Path,
    gains: tuple[tuple[str, float, float], ...],
    points: int,
    largest: tuple[str, ...],
    settle: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """Say how fast errors decay on the closed path of an experiment, and with which gains its loop is stable."""
    check_file(file, "an experiment")
    out = None if out is None else refuse_suffix(out, "a folder", name="out")
    if out is not None and not gains:
        raise click.UsageError("--out is for the figure of a map: give --gain NAME FROM TO")
    import_all()
    from pathcontrol.analysis.stability.floquet import floquet
    from pathcontrol.analysis.stability.largest_gain import largest_gain
    from pathcontrol.analysis.stability.smooth_loop import make_smooth
    from pathcontrol.analysis.stability.stability_map import stability_map
    from pathcontrol.experiments.runner import load_setup

    setup = load_setup(file)
    if len(setup.controllers) > 1:
        raise InputError("the experiment is a sequence of paths, expected one closed path")
    law, loop, left_out = make_smooth(setup.controller, setup.loop)
    own = floquet(law, loop, settle)
    found = {name: largest_gain(law, name, loop, settle=settle) for name in largest}
    grid = {name: _space_values(name, low, high, points) for name, low, high in gains}
    stability = stability_map(law, grid, loop, settle=settle, progress=not as_json) if grid else None
    written = {} if stability is None or out is None else _write(stability, out)
    if as_json:
        values: dict[str, Any] = {"decay_rate": own.decay_rate, "stable": own.stable, "lap": own.period}
        values |= {"largest": to_json(found)}
        values |= {"left_out": left_out, "map": stability and _describe(stability), "written": written}
        click.echo(json.dumps(values, allow_nan=False))
        return
    _print_results(own, left_out)
    for name, value in found.items():
        click.echo(f"largest {name}: " + (f"{value:.6g}" if math.isfinite(value) else "none, however large"))
    for point in [] if stability is None else _describe(stability)["boundary"]:
        click.echo("boundary at " + ", ".join(f"{name} = {value:.6g}" for name, value in point.items()))
    for name, path in written.items():
        click.echo(f"  {name}: {path}")


def _space_values(name: str, low: float, high: float, points: int) -> Any:
    """Return values of a gain from one end to the other, spaced by factors where the ends are far apart."""
    if not -math.inf < low < high < math.inf:
        raise InputError(f"--gain {name} {low:g} {high:g}: expected FROM below TO", argument="gain", value=(low, high))
    import numpy as np

    far = low > 0 and high >= _DECADES * low
    return np.geomspace(low, high, points) if far else np.linspace(low, high, points)


def _describe(stability: StabilityMap) -> dict[str, Any]:
    """Return a map in plain values."""
    return {
        "gains": {name: grid.tolist() for name, grid in zip(stability.names, stability.grids, strict=True)},
        "decay_rate": stability.decay_rate.tolist(),
        "boundary": [dict(zip(stability.names, point, strict=True)) for point in stability.boundary.tolist()],
    }


def _write(stability: StabilityMap, out: Path) -> dict[str, str]:
    """Write the figure; return its files by what they are."""
    from pathcontrol.view.figures.stability_figure import stability_figure
    from pathcontrol.view.figures.style import save_figure

    svg, png = save_figure(stability_figure(stability), out / "stability")
    return {"figure-svg": str(svg), "figure-png": str(png)}


def _print_results(own: Floquet, left_out: list[str]) -> None:
    """Print how fast errors decay with the experiment's own gains."""
    what = f"{'decays' if own.stable else 'grows'} at {abs(own.decay_rate):.4g} 1/s"
    if abs(own.decay_rate) * own.period < _NEUTRAL:
        what = f"neither decays nor grows, to {_NEUTRAL:g} of it in a lap"
    click.echo(f"a lap takes {own.period:.4g} s; the slowest deviation {what}")
    if left_out:
        click.echo(f"left out, for want of a derivative: {', '.join(left_out)}")
