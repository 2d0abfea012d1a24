"""``python -m benchmarks``: the speed of simulations beside a plain loop, Pinocchio alone and other simulators."""

from __future__ import annotations

import json
from pathlib import Path

import click

from benchmarks.measure import measure
from benchmarks.table import show, write_page


@click.command(help=__doc__)
@click.option("--json", "as_json", is_flag=True, help="Print the ratios as JSON.")
@click.option("--page", type=click.Path(path_type=Path, exists=True), help="Write the tables into docs/benchmarks.md.")
def main(as_json: bool, page: Path | None) -> None:
    results = measure()
    if page is not None:
        write_page(results, page)
    if as_json:
        click.echo(json.dumps({"ratios": results.ratios}, indent=2))
    else:
        show(results)


if __name__ == "__main__":
    main()
