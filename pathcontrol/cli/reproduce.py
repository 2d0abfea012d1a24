"""``pathcontrol reproduce``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from pathcontrol.cli.group import import_all, json_option, open_option, open_page


@click.command("reproduce")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=Path("results"), show_default=True)
@open_option
@json_option
def command(out: Path, opened: bool, as_json: bool) -> None:
    """Run the paper's two experiments on the bundled arm."""
    import_all()
    from pathcontrol.experiments.reproduce import PAPER
    from pathcontrol.experiments.reproduce import reproduce as run_both

    summary = run_both(out)
    if as_json:
        click.echo(json.dumps(summary))
    else:
        _tell(summary, out)
    if opened:
        for name in PAPER:
            open_page(out / f"{name}.html")


def _tell(summary: dict[str, Any], out: Path) -> None:
    from rich.console import Console

    from pathcontrol.cli.tables import peaks_table

    console = Console()
    console.print(peaks_table(summary))
    console.print(f"Figures 7 to 10, data, animations and summary.json are in {out}/ ({summary['seconds']} s).")
