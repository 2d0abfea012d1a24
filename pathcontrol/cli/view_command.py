"""The command ``pathcontrol view``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from pathcontrol._suffixes import check_suffix
from pathcontrol.cli.group import import_all, json_option, open_option, open_page, package_option, printable
from pathcontrol.cli.saved import (
    check_out,
    check_runs,
    load_runs,
    robot_option,
    run_file,
    runs_argument,
    sweep_of,
    worst_option,
)

if TYPE_CHECKING:
    from pathcontrol.simulation.run import Run

_NONE: Mapping[str, Any] = MappingProxyType({})

layout_option = click.option(
    "--layout",
    type=click.Choice(["beside", "ghosted"]),
    default="beside",
    show_default=True,
    help="Arms of several runs next to one another, or in one place, all but the first see-through.",
)


@click.command("view")
@runs_argument
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.html",
    help="The page to write. Default: the run's name with .html, of several runs comparison.html, beside the first.",
)
@click.option("--mp4", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.mp4", help="Write a video.")
@layout_option
@click.option("--rollout", type=int, default=0, show_default=True, help="Which rollout of each run, from 0.")
@click.option("--tool", metavar="FRAME", help="The frame whose path is drawn. Default: that of the task, or the last.")
@worst_option
@robot_option
@package_option
@open_option
@json_option
def command(
    runs: tuple[Path, ...],
    out: Path | None,
    mp4: Path | None,
    layout: str,
    rollout: int,
    tool: str | None,
    worst: int | None,
    robot: str | None,
    package_dir: tuple[Path, ...],
    opened: bool,
    as_json: bool,
) -> None:
    """Write the animation of saved runs, or of a robot: one HTML page.

    The page plays in any browser and needs no network. A RUN is a file that Run.save or `pathcontrol run` has written
    (.nc, .mcap), or the folder of one. Several move side by side. Of the folder of a sweep the histories that it
    has kept are shown, the worst first, as histories.html there. A URDF file, or the name of a known robot, is
    shown with its joints moving in turn; --package-dir says where its meshes are. With --mp4 a video is written,
    which needs the extra `video` and a Chromium, Chrome or Edge on this machine; the page is then written only if
    --out or --open asks for it.
    """
    check_runs(runs, robots=True)
    import_all()
    from pathcontrol.view.animation.record import record

    check_out(out, runs)
    if mp4 is not None:
        check_suffix(mp4, "a video (H.264 in MP4)", ".mp4", name="mp4")
    loaded = load_runs(runs, robot, worst, package_dir)
    animation = record(one_or_all(loaded), rollout=rollout, layout=layout, tool=tool)  # type: ignore[arg-type]
    written = {}
    if out is not None or opened or mp4 is None:
        written["html"] = animation.save(_default(runs) if out is None else out)
    if mp4 is not None:
        from pathcontrol.view.video import save_video

        written["video"] = save_video(animation, mp4)
    print_results(loaded, written, as_json)
    if opened:
        open_page(written["html"])


def one_or_all(runs: Mapping[str, Run]) -> Run | Mapping[str, Run]:
    """Return the only run by itself, as it needs no name, or all of them."""
    return next(iter(runs.values())) if len(runs) == 1 else runs


def _default(runs: tuple[Path, ...]) -> Path:
    """Return the default file of the page."""
    if sweep_of(runs) is not None:
        return runs[0] / "histories.html"
    first = run_file(runs[0])
    return first.with_suffix(".html") if len(runs) == 1 else first.with_name("comparison.html")


def print_results(
    runs: Mapping[str, Run], written: Mapping[str, Path], as_json: bool, numbers: Mapping[str, Any] = _NONE
) -> None:
    """Print which runs were shown, what must not be overlooked in them, and which files were written.

    As JSON ``numbers`` are printed as well.
    """
    from pathcontrol.analysis.run_remarks import remarks
    from pathcontrol.cli.tables import remark_lines

    if as_json:
        files = {kind: str(path) for kind, path in written.items()}
        said = {name: found for name, run in runs.items() if (found := remarks(run))}
        content = {"runs": {name: repr(run) for name, run in runs.items()}, "written": files, **numbers}
        click.echo(json.dumps(content | ({"remarks": said} if said else {})))
        return
    for name, run in runs.items():
        click.echo(printable(f"{name}: {run!r}"))
        for line in remark_lines(run):
            click.echo(f"  {line}")
    for kind, path in written.items():
        click.echo(f"  {kind}: {path} ({path.stat().st_size / 1e6:.1f} MB)")
