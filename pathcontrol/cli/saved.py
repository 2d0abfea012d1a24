"""The saved runs that a command line names, with their names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pathcontrol._suffixes import check_suffix
from pathcontrol.cli.files import check_file
from pathcontrol.errors import InputError, PathControlError

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run
    from pathcontrol.sweeps.result import SweepResult

_DEFAULT = "run.nc"  # the default name of experiments

runs_argument = click.argument(
    "runs", nargs=-1, required=True, type=click.Path(exists=False, path_type=Path), metavar="RUN..."
)
robot_option = click.option(
    "--robot", metavar="FILE", help="The URDF file or known name of the arm, for runs that do not know theirs."
)
worst_option = click.option(
    "--worst", type=click.IntRange(1), metavar="N", help="Of the histories that a sweep has kept, the N worst ones."
)


def check_runs(paths: Sequence[Path], robots: bool = False) -> None:
    """Check that the files of runs exist and are no other files, ``robots`` aside, before much is loaded for them.

    Raises:
        InputError: one is missing, or is something else.
    """
    for path in paths:
        if path.is_dir():
            continue
        if is_robot(path) and not robots:
            raise InputError(
                f"{str(path)!r} is a robot and no run; look at it with `pathcontrol view`, or name a run",
                file=str(path),
            )
        if robots and not path.exists() and not is_robot(path):
            expected = "a saved run, a URDF or the name of a known robot"
            raise InputError(f"there is no file {str(path)!r}, expected {expected}", file=str(path))
        if not is_robot(path) or path.suffix:
            check_file(path, "a robot" if is_robot(path) else "a saved run")


def load_runs(
    paths: Sequence[Path], robot: str | None, worst: int | None = None, package_dirs: Sequence[Path] = ()
) -> dict[str, Run]:
    """Load the runs by the shortest names that tell them apart: of their files, or of the folders of ``run.nc``.

    Of a sweep, alone, its ``worst`` histories, by their samples. A URDF, with ``package_dirs``, the
    folders of its meshes, or a known robot may take the place of a run: its joints move in turn.

    Raises:
        InputError: a file is missing, is no run, or is named twice, or a run does not know its robot.
    """
    from pathcontrol.robot.loading import load_robot
    from pathcontrol.simulation.run import Run

    if (sweep := sweep_of(paths)) is not None:
        return sweep.histories(worst)
    files = [run_file(path) for path in paths]
    twice = [path for path, file in zip(paths, files, strict=True) if files.count(file) > 1]
    if twice:
        raise InputError(
            f"{', '.join(repr(str(path)) for path in twice)} are one run; name each run once",
            value=[str(path) for path in twice],
        )
    arm = None if robot is None else load_robot(robot)
    called = dict(zip(names(files), files, strict=True))
    return {
        name: _make_tour(file, package_dirs) if is_robot(file) else _add_robot(Run.load(file), file, arm)
        for name, file in called.items()
    }


def sweep_of(paths: Sequence[Path]) -> SweepResult | None:
    """Return the sweep whose folder is named, if one is.

    Raises:
        InputError: something else is named beside it.
    """
    from pathcontrol.sweeps.manifest import MANIFEST
    from pathcontrol.sweeps.result import SweepResult

    found = [path for path in paths if (path / MANIFEST).is_file()]
    if found and len(paths) > 1:
        raise InputError(
            f"{str(found[0])!r} is a sweep, expected it alone; name runs in its folder runs/ one by one",
            file=str(found[0]),
        )
    return SweepResult(found[0]) if found else None


def check_out(out: Path | None, paths: Sequence[Path]) -> None:
    """Check that the output is a page, and none of the inputs.

    Raises:
        InputError: ``out`` is the file of one of the runs, or its name is that of another format.
    """
    if out is None:
        return
    sweep = sweep_of(paths)
    files = [run_file(path) for path in paths] if sweep is None else [sweep.history(i) for i in sweep.kept]
    if out.resolve() in [file.resolve() for file in files]:
        raise InputError(
            f"{str(out)!r} is the run itself, which would be lost; name another file to write",
            argument="out",
            file=str(out),
        )
    check_suffix(out, "a page", ".html", ".htm", name="out")


def run_file(path: Path) -> Path:
    """Return the file of a run, which may be named by its folder.

    Raises:
        InputError: the folder holds no run, or several and none of them is called ``run.nc``.
    """
    if not path.is_dir():
        return path
    found = [path / _DEFAULT] if (path / _DEFAULT).is_file() else sorted([*path.glob("*.nc"), *path.glob("*.mcap")])
    if not found:
        raise InputError(
            f"the folder {str(path)!r} holds no run; expected a file run.nc, as `pathcontrol run` writes",
            file=str(path),
        )
    if len(found) > 1:
        raise InputError(
            f"the folder {str(path)!r} holds several runs; name those you mean: {_list_files(found)}", file=str(path)
        )
    return found[0]


def names(files: Sequence[Path]) -> list[str]:
    """Return a name for each run: that of its file, with as many folders as tell it from the others."""
    parts = [_parts(file.resolve()) for file in files]
    depths = [1] * len(files)
    while True:
        called = ["/".join(part[-depth:]) for part, depth in zip(parts, depths, strict=True)]
        count = Counter(called)
        longer = [min(d + (count[c] > 1), len(p)) for d, c, p in zip(depths, called, parts, strict=True)]
        if longer == depths:
            return called
        depths = longer


def _parts(file: Path) -> tuple[str, ...]:
    """Return the parts of the name of a run."""
    folders = file.parent.parts[1:]
    return folders if file.name == _DEFAULT and folders else (*folders, file.stem)


def is_robot(file: Path) -> bool:
    """Return whether a URDF or a known robot is named, and not a run."""
    if file.suffix.lower() in (".urdf", ".xacro"):
        return True
    if file.exists() or not str(file).isidentifier():
        return False
    from pathcontrol.robot.catalogue import known_robots

    return str(file) in known_robots()


def _make_tour(file: Path, package_dirs: Sequence[Path]) -> Run:
    """Return a run in which the joints of a robot move in turn; those that mimic each other do not move."""
    from pathcontrol.robot.catalogue import find_urdf
    from pathcontrol.robot.loading import load_robot
    from pathcontrol.view.tour import joints_to_show, tour

    source = file if file.suffix else str(file)
    folders = tuple(package_dirs)
    return tour(load_robot(source, keep=joints_to_show(find_urdf(source, folders).text), package_dirs=folders))


def _add_robot(run: Run, file: Path, robot: RobotModel | None) -> Run:
    """Return the run, with ``robot`` if it does not know its own; errors name its file."""
    from pathcontrol.view.animation.rollout import check_filmed

    try:
        _ = run.robot
    except PathControlError as error:
        if robot is None:
            raise InputError(f"{str(file)!r}: {error}", **error.details_with(file=str(file))) from error
        run = run.with_robot(robot)
    try:
        check_filmed(run, run.robot, run.task)
    except PathControlError as error:
        raise InputError(f"{str(file)!r}: {error}", **error.details_with(file=str(file))) from error
    return run


def _list_files(files: Sequence[Path]) -> str:
    """Return files in words."""
    return ", ".join(str(file) for file in files)
