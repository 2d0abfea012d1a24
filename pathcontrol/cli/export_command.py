"""The command ``pathcontrol export``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pathcontrol.cli.files import recognise_file
from pathcontrol.cli.group import import_all, json_option
from pathcontrol.errors import InputError

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.trajectory import Trajectory


@click.command("export")
@click.argument("file", type=click.Path(path_type=Path), metavar="RUN|FILE.toml")
@click.option(
    "--format",
    "name",
    type=click.Choice(["csv", "ros", "urscript"]),
    default="csv",
    show_default=True,
    help="A table, a ROS 2 JointTrajectory, or a program for Universal Robots.",
)
@click.option("--rate", type=float, default=100.0, show_default=True, metavar="HZ", help="Samples per second.")
@click.option("--out", type=click.Path(path_type=Path), metavar="PATH", help="Default: the name of FILE.")
@click.option("--rollout", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Of a run.")
@click.option(
    "--duration", type=float, metavar="S", help="Of a task. Default: to its end, or once round a closed path."
)
@click.option(
    "--limits",
    type=click.Choice(["refuse", "warn"]),
    default="refuse",
    show_default=True,
    help="What to do with a trajectory beyond a limit of the arm.",
)
@json_option
def command(
    file: Path,
    name: str,
    rate: float,
    out: Path | None,
    rollout: int,
    duration: float | None,
    limits: str,
    as_json: bool,
) -> None:
    """Write the motion of a run, or the plan of an experiment's task, for a controller of an arm."""
    if not file.is_file():
        raise InputError(
            f"there is no file {str(file)!r}, expected a saved run or an experiment", argument="file", file=str(file)
        )
    import_all()
    from pathcontrol.export.export import export_trajectory

    trajectory, robot = _load(file, rate, rollout, duration)
    target = file.with_suffix("") if out is None else out
    path = export_trajectory(trajectory, target, name, robot, limits)  # type: ignore[arg-type]
    if as_json:
        numbers = {"samples": len(trajectory.time), "duration": trajectory.duration, "joints": list(trajectory.joints)}
        click.echo(json.dumps({"written": str(path), "format": name} | numbers))
        return
    click.echo(f"{len(trajectory.time)} samples of {trajectory.duration:g} s for {', '.join(trajectory.joints)}")
    click.echo(f"  {name}: {path}")


def _load(file: Path, rate: float, rollout: int, duration: float | None) -> tuple[Trajectory, RobotModel | None]:
    """Return the trajectory of a file and its arm, None where a run does not know it."""
    if recognise_file(file) == "an experiment":
        from pathcontrol.experiments.runner import load_setup
        from pathcontrol.export.plan import plan_trajectory

        setup = load_setup(file)
        return plan_trajectory(setup.task, rate, duration, setup.plant), setup.plant
    from pathcontrol.analysis.limit_shares import list_robots
    from pathcontrol.simulation.run import Run

    if duration is not None:
        raise click.UsageError("--duration is for an experiment; a run has its own")
    run = Run.load(file)
    return run.to_trajectory(rate, rollout), list_robots(run)[rollout]
