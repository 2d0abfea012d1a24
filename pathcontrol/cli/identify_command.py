"""The command ``pathcontrol identify``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pathcontrol._suffixes import refuse_suffix
from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import import_all, json_option
from pathcontrol.cli.saved import robot_option

if TYPE_CHECKING:
    from pathcontrol.analysis.friction_identification import FrictionEstimate


@click.command("identify")
@click.argument("run", type=click.Path(path_type=Path), metavar="RUN")
@click.option(
    "--form",
    type=click.Choice(["viscous", "coulomb", "stribeck"]),
    default="coulomb",
    show_default=True,
    help="Viscous friction alone, with Coulomb levels by direction, or with a Stribeck curve.",
)
@click.option("--window", type=float, default=0.05, show_default=True, metavar="S", help="Length of the windows.")
@click.option(
    "--min-speed", type=float, default=0.02, show_default=True, metavar="RAD/S", help="Slowest speed that counts."
)
@robot_option
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write the figure and friction.json to this folder.",
)
@json_option
def command(
    run: Path, form: str, window: float, min_speed: float, robot: str | None, out: Path | None, as_json: bool
) -> None:
    """Estimate the friction of all joints from a saved run in which they move to and fro at several speeds."""
    check_file(run, "a saved run")
    out = None if out is None else refuse_suffix(out, "a folder", name="out")
    import_all()
    from pathcontrol.analysis.friction_identification import identify_friction
    from pathcontrol.robot.loading import load_robot
    from pathcontrol.simulation.run import Run

    arm = None if robot is None else load_robot(robot)
    estimate = identify_friction(Run.load(run), arm, form=form, window=window, min_speed=min_speed)  # type: ignore[arg-type]
    written = {} if out is None else _write(estimate, out)
    if as_json:
        click.echo(json.dumps(estimate.to_dict() | {"written": written}, allow_nan=False))
        return
    _print_results(estimate)
    for name, path in written.items():
        click.echo(f"  {name}: {path}")


def _write(estimate: FrictionEstimate, out: Path) -> dict[str, str]:
    """Write figure and numbers; return the files by what they are."""
    from pathcontrol._files import write_whole
    from pathcontrol.view.figures.friction_figure import friction_figure
    from pathcontrol.view.figures.style import save_figure

    svg, png = save_figure(friction_figure(estimate), out / "friction")
    text = json.dumps(estimate.to_dict(), indent=2, allow_nan=False) + "\n"
    numbers = write_whole(out / "friction.json", text.encode())
    return {"figure-svg": str(svg), "figure-png": str(png), "numbers": str(numbers)}


def _print_results(estimate: FrictionEstimate) -> None:
    """Print a table of coefficients with their standard errors."""
    from rich.console import Console
    from rich.table import Table

    table = Table("joint", *(name.replace("_", " ") for name in estimate.coefficients), "left (rms)", "windows")
    for i, joint in enumerate(estimate.joints):
        values = [f"{v[i]:.4g} ± {estimate.errors[name][i]:.2g}" for name, v in estimate.coefficients.items()]
        if joint in estimate.remarks:
            values = ["?"] * len(values)
        table.add_row(joint, *values, f"{estimate.residual[i]:.3g}", str(len(estimate.windows[i].torque)))
    Console().print(table)
    for remark in estimate.remarks.values():
        click.echo(f"  {remark}")
