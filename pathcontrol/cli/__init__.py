"""The command line: a thin layer over the library. Heavy imports wait until a command needs them."""

from __future__ import annotations

import click

from pathcontrol.cli import (
    check_command,
    compare_command,
    export_command,
    identify_command,
    report_command,
    reproduce_command,
    run_command,
    sil_command,
    stability_command,
    sweep_command,
    toolpath_command,
    tune_command,
    view_command,
)
from pathcontrol.cli.group import Group


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pathcontrol")
def main() -> None:
    """Path control of robot arms: tasks as a path and a velocity profile, not as a schedule."""


for _part in (
    reproduce_command,
    run_command,
    sweep_command,
    tune_command,
    compare_command,
    view_command,
    report_command,
    check_command,
    toolpath_command,
    export_command,
    identify_command,
    stability_command,
    sil_command,
):
    main.add_command(_part.command)
