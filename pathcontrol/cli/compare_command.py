"""The command ``pathcontrol compare``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pathcontrol._expect import nearest_choice
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import engine_option, import_all, json_option, open_option, open_page
from pathcontrol.errors import InputError

if TYPE_CHECKING:
    from pathcontrol.comparison.compare import Comparison
    from pathcontrol.comparison.scenarios import Scenario
    from pathcontrol.simulation.engines import Engine


@click.command("compare")
@click.argument("file", type=click.Path(path_type=Path), required=False, metavar="[FILE.toml]")
@click.option("--scenario", metavar="NAME", help="One of the scenarios that --list names, or a FILE.toml.")
@click.option("--list", "listed", is_flag=True, help="List the scenarios and stop.")
@click.option(
    "--law",
    "laws",
    multiple=True,
    metavar="NAME",
    help="Compare this law; repeat for more. Default: the five known ones and the scenario's own; 'all' for the whole "
    "family.",
)
@click.option(
    "--rollouts", type=click.IntRange(1), default=16, show_default=True, metavar="N", help="How many initial postures."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Seed of the postures.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write comparison.html, the figure and summary.json to this folder.",
)
@engine_option
@open_option
@json_option
def command(
    file: Path | None,
    scenario: str | None,
    listed: bool,
    laws: tuple[str, ...],
    rollouts: int,
    seed: int,
    out: Path | None,
    engine: Engine | None,
    opened: bool,
    as_json: bool,
) -> None:
    """Compare motion control and path control in one situation.

    The situation is a scenario of the library (--scenario NAME), or the experiment of a FILE.toml, whose [controller]
    is replaced by each law with gains that mean the same. Numbers are means over the initial postures, with their
    standard deviation.
    """
    if listed:
        _list(as_json)
        return
    source = _choose(file, scenario)
    if isinstance(source, Path):
        _check_no_scenario(source)
        check_file(source, "an experiment")
    from pathcontrol.comparison.compare import compare

    if opened and out is None:
        out = Path("results") / Path(source).stem
    if out is not None:
        out = refuse_suffix(out, "a folder", name="out")
        import_all()
    found = _load(source)
    compared = compare("all" if laws == ("all",) else laws or None, found, rollouts=rollouts, seed=seed, engine=engine)
    written = {} if out is None else _write(compared, out)
    _print_results(compared, written, as_json)
    if opened and out is not None:
        open_page(Path(written["html"]))


def _choose(file: Path | None, scenario: str | None) -> Path | str:
    """Return the file or the name of the scenario."""
    if (file is None) == (scenario is None):
        raise click.UsageError("give either --scenario NAME or an experiment file; --list shows the scenarios")
    if scenario is None or Path(scenario).suffix == ".toml":
        return Path(scenario or file or "")
    return scenario


def _check_no_scenario(file: Path) -> None:
    """Refuse a file that is not there and has the name of a scenario, or nearly so."""
    if file.exists() or file.suffix:
        return
    from pathcontrol.comparison.scenarios import known_scenarios

    if meant := nearest_choice(file.name, known_scenarios()):
        raise InputError(
            f"there is no file {str(file)!r}; `pathcontrol compare --scenario {meant}` compares in that scenario",
            file=str(file),
        )


def _load(source: Path | str) -> Scenario:
    """Return the scenario of a file or of a name."""
    if isinstance(source, Path):
        import_all()
        from pathcontrol.experiments.scenario_file import load_scenario

        return load_scenario(source)
    from pathcontrol.comparison.scenarios import make_scenario

    return make_scenario(source)


def _list(as_json: bool) -> None:
    """Print the scenarios."""
    from pathcontrol.comparison.scenarios import known_scenarios

    known = known_scenarios()
    if as_json:
        click.echo(json.dumps({"scenarios": known}))
        return
    for name, sentence in known.items():
        click.echo(f"{name:14} {sentence}")


def _write(compared: Comparison, out: Path) -> dict[str, str]:
    """Write page, figure and numbers; return the files by what they are."""
    from pathcontrol._files import write_whole
    from pathcontrol.view.figures.scenario_figure import scenario_figure
    from pathcontrol.view.figures.style import save_figure
    from pathcontrol.view.report.comparison_page import save_comparison

    page = save_comparison(compared, out / "comparison.html")
    svg, png = save_figure(scenario_figure(compared), out / "comparison")
    text = json.dumps(compared.to_dict(), indent=2, allow_nan=False) + "\n"
    write_whole(out / "summary.json", text.encode())
    files = {"html": page, "figure-svg": svg, "figure-png": png, "summary": out / "summary.json"}
    return {name: str(path) for name, path in files.items()}


def _print_results(compared: Comparison, written: dict[str, str], as_json: bool) -> None:
    """Print the results."""
    if as_json:
        click.echo(json.dumps(compared.to_dict() | {"written": written}, allow_nan=False))
        return
    from rich.console import Console

    from pathcontrol.cli.tables import comparison_tables
    from pathcontrol.comparison.comparison_table import describe_comparison

    console = Console()
    for table in comparison_tables(compared, console.width):
        console.print(table)
    for line in describe_comparison(compared):
        click.echo(line)
    for name, path in written.items():
        click.echo(f"  {name}: {path}")
