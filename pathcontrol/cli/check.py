"""``pathcontrol check``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from pathcontrol.cli.group import json_option, package_option, uninterrupted
from pathcontrol.errors import UnknownNameError


@click.command("check")
@click.argument("file", type=click.Path(exists=False))
@click.option("--lock", multiple=True, metavar="JOINT", help="A joint that will be locked; repeat for more.")
@package_option
@json_option
def command(file: str, lock: tuple[str, ...], package_dir: tuple[Path, ...], as_json: bool) -> None:
    """Report what is wrong or odd in a URDF.

    FILE is a URDF file or the name of a known robot. Exits with 1 on errors.
    """
    from pathcontrol.robot.catalogue import find_urdf
    from pathcontrol.robot.urdf import check_urdf

    with uninterrupted():
        import yourdfpy  # noqa: F401
    urdf = find_urdf(file, package_dir)
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
