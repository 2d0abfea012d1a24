"""The command line: a thin layer over the library. Heavy imports wait until a command needs them."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from pathcontrol.errors import PathControlError, UnknownNameError


class _Group(click.Group):
    """Turns the library's errors into one message and exit code 2, and Ctrl-C into exit code 130."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except PathControlError as error:
            click.echo(f"error: {_printable(str(error))}", err=True)
            sys.exit(2)
        except KeyboardInterrupt:
            click.echo("interrupted; no half-written file is left behind", err=True)
            sys.exit(130)


def _printable(message: str) -> str:
    """``message`` without the control characters that a file may have put into it, which a terminal would obey."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in message)


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Holds Ctrl-C back until the block is over: compiled modules do not survive it while they are imported."""
    pressed: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt


def _import_all() -> None:
    """Everything that a command which simulates and draws will need."""
    with _uninterrupted():
        import pathcontrol.experiments.reproduce
        import pathcontrol.experiments.runner
        import pathcontrol.view.figures.run
        import pathcontrol.view.film.recorder  # noqa: F401


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object on stdout, nothing else.")


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pathcontrol")
def main() -> None:
    """Path control of robot arms: tasks as a path and a velocity profile, not as a schedule."""


@main.command()
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=Path("results"), show_default=True)
@json_option
def reproduce(out: Path, as_json: bool) -> None:
    """Run the paper's two experiments on the bundled arm."""
    _import_all()
    from pathcontrol.experiments.reproduce import reproduce as run_both

    summary = run_both(out)
    if as_json:
        click.echo(json.dumps(summary))
        return
    from rich.console import Console

    from pathcontrol.cli.tables import peaks_table

    console = Console()
    console.print(peaks_table(summary))
    console.print(f"Figures 7 to 10, data, animations and summary.json are in {out}/ ({summary['seconds']} s).")


@main.command()
@click.argument("file", type=click.Path(exists=False, path_type=Path), required=False)
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="Default: results/ and the file's name.")
@click.option("--example", is_flag=True, help="Print a commented experiment file and stop.")
@json_option
def run(file: Path | None, out: Path | None, example: bool, as_json: bool) -> None:
    """Run the experiment that FILE.toml describes."""
    if example:
        from pathcontrol.experiments.template import example_text

        click.echo(example_text(), nl=False)
        return
    if file is None:
        raise click.UsageError("give an experiment file; --example prints one to start from")
    _import_all()
    from pathcontrol.analysis.metrics import UNITS
    from pathcontrol.experiments.runner import run_experiment

    done = run_experiment(file, Path("results") / file.stem if out is None else out)
    written = {name: str(path) for name, path in done.written.items()}
    if as_json:
        click.echo(json.dumps({"run": repr(done.run), "metrics": done.metrics, "written": written}))
        return
    click.echo(repr(done.run))
    for name, values in done.metrics.items():
        click.echo(f"  {name:22} {', '.join('never' if v is None else f'{v:.4g}' for v in values)} {UNITS[name]}")
    for name, path in written.items():
        click.echo(f"  {name}: {path}")


@main.command()
@click.argument("file")
@click.option("--lock", multiple=True, metavar="JOINT", help="A joint that will be locked; repeat for more.")
@json_option
def check(file: str, lock: tuple[str, ...], as_json: bool) -> None:
    """Report what is wrong or odd in a URDF: a FILE.urdf, or the name of a known robot. Exits with 1 on errors."""
    from pathcontrol.robot.loading import find_urdf
    from pathcontrol.robot.urdf import check_urdf

    with _uninterrupted():
        import yourdfpy  # noqa: F401
    urdf = find_urdf(file)
    report = check_urdf(urdf.text, base_dir=urdf.base_dir, package_dirs=urdf.package_dirs, allow_mimic=lock)
    unknown = sorted(set(lock) - set(report.joints))
    if unknown and report.joints:
        raise UnknownNameError(f"no movable joint {', '.join(unknown)} to lock; there are {', '.join(report.joints)}")
    if as_json:
        click.echo(json.dumps(report.as_dict()))
    else:
        free = len(set(report.joints) - set(lock))
        locked = f" and {len(lock)} locked" if lock else ""
        click.echo(f"{report.name or file}: {len(report.links)} links, {free} movable joints{locked}")
        for finding in report.findings:
            click.echo(f"  {finding}")
        click.echo("usable" if report.ok else "not usable")
    sys.exit(0 if report.ok else 1)


@main.command()
@click.argument("file", type=click.Path(exists=False, path_type=Path))
@click.option("--unit", metavar="UNIT", help="Unit of length of a file that does not say: mm, in, …")
@click.option("--layer", "layers", multiple=True, metavar="LAYER", help="A layer of a DXF file; repeat for more.")
@click.option("--ppi", type=float, help="Pixels per inch of an SVG file.  [default: 96]")
@click.option("--feed", type=float, metavar="M/S", help="Feed of contours for which the file gives none.")
@click.option("--start", type=float, nargs=3, metavar="X Y Z", help="Where a G-code program finds the tool, in metres.")
@click.option(
    "--plot", type=click.Path(dir_okay=False, path_type=Path), help="Draw it: writes this name as SVG and PNG."
)
@json_option
def toolpath(file: Path, layers: tuple[str, ...], plot: Path | None, as_json: bool, **options: Any) -> None:
    """Show what is in a toolpath FILE: CSV, G-code, SVG or DXF."""
    from pathcontrol.cli.tables import toolpath_table
    from pathcontrol.toolpaths.read import GCODE, read_toolpath
    from pathcontrol.toolpaths.summary import summary

    given = {name: value for name, value in (options | {"layers": list(layers) or None}).items() if value is not None}
    if file.suffix.lower() in GCODE:  # which has feeds of its own, or is refused
        given.pop("feed", None)
    read = read_toolpath(file, **given)
    content = summary(read)
    if plot is not None:
        with _uninterrupted():
            from pathcontrol.view.figures.style import save_figure
            from pathcontrol.view.figures.toolpath import toolpath_figure
        content["figures"] = [str(path) for path in save_figure(toolpath_figure(read), plot)]
    if as_json:
        click.echo(json.dumps(content))
        return
    from rich.console import Console
    from rich.text import Text

    console = Console()
    for part in toolpath_table(content):
        console.print(part)
    for name in content.get("figures", []):
        console.print(Text(f"  figure: {name}"))
