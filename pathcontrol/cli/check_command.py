"""The command ``pathcontrol check``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import json_option, package_option
from pathcontrol.errors import UrdfError


@click.command("check")
@click.argument("file", type=click.Path(exists=False))
@click.option("--lock", multiple=True, metavar="JOINT", help="A joint that will be locked; repeat for more.")
@click.option("--keep", multiple=True, metavar="JOINT", help="A joint that stays free while all others are locked.")
@click.option("--tip", metavar="FRAME", help="A link or joint: all joints that do not move it are locked.")
@package_option
@json_option
def command(
    file: str,
    lock: tuple[str, ...],
    keep: tuple[str, ...],
    tip: str | None,
    package_dir: tuple[Path, ...],
    as_json: bool,
) -> None:
    """Report what is wrong or odd in a URDF.

    FILE is a URDF file or the name of a known robot. Exits with 1 on errors.
    """
    if not file.isidentifier():  # it is no name of a known robot
        check_file(Path(file).expanduser(), "a robot")
    from pathcontrol.robot.catalogue import find_urdf
    from pathcontrol.robot.urdf import check_urdf

    urdf = find_urdf(file, package_dir)
    locked = _select_locked(urdf.text, lock, keep, tip)
    report = check_urdf(urdf.text, base_dir=urdf.base_dir, package_dirs=urdf.package_dirs, allow_mimic=locked)
    if as_json:
        click.echo(json.dumps(report.as_dict()))
    else:
        free = len(set(report.joints) - set(locked))
        also = f" and {len(locked)} locked" if locked else ""
        click.echo(f"{report.name or file}: {len(report.links)} links, {free} movable joints{also}")
        for finding in report.findings:
            click.echo(f"  {finding}")
        click.echo("usable" if report.ok else "not usable")
    sys.exit(0 if report.ok else 1)


def _select_locked(text: str, lock: tuple[str, ...], keep: tuple[str, ...], tip: str | None) -> tuple[str, ...]:
    """Return the joints that will be locked; their values do not matter here."""
    from pathcontrol.robot.urdf import parse_urdf
    from pathcontrol.robot.urdf.locking import locked_angles

    try:
        root = parse_urdf(text)
    except UrdfError:
        return ()  # the report says why
    return tuple(locked_angles(root, dict.fromkeys(lock, 0.0), keep, tip))
