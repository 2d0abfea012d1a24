"""The command ``pathcontrol reproduce``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from pathcontrol._interrupts import delay_interrupt
from pathcontrol.cli.group import json_option, open_option, open_page


@click.command("reproduce")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=Path("results"), show_default=True)
@click.option(
    "--sensitivity", is_flag=True, help="Also say how sure that is: both experiments with what the paper leaves unsaid."
)
@click.option(
    "--samples", type=click.IntRange(1), metavar="N", help="With --sensitivity: how many combinations; default 300."
)
@open_option
@json_option
def command(out: Path, sensitivity: bool, samples: int | None, opened: bool, as_json: bool) -> None:
    """Run the paper's two experiments on the bundled arm."""
    if samples is not None and not sensitivity:
        raise click.UsageError("--samples counts the combinations of --sensitivity; give that, too")
    with delay_interrupt():
        from pathcontrol.experiments.reproduce import PAPER
        from pathcontrol.experiments.reproduce import reproduce as run_both

        if sensitivity:  # a missing extra is reported before any simulation
            from pathcontrol.sweeps.parquet import load_parquet

            load_parquet()

    summary = run_both(out)
    if not as_json:
        _print_results(summary, out)
    if sensitivity:
        summary |= {"sensitivity": _vary(out, samples, as_json)}
    if as_json:
        click.echo(json.dumps(summary))
    if opened:
        for name in (*PAPER, *(["sensitivity"] if sensitivity else [])):
            open_page(out / f"{name}.html")


def _vary(out: Path, samples: int | None, as_json: bool) -> dict[str, Any]:
    """Vary the uncertain numbers and write the page about it."""
    from pathcontrol.experiments.sensitivity import SAMPLES
    from pathcontrol.experiments.sensitivity_page import sensitivity as vary
    from pathcontrol.experiments.sensitivity_page import sentences

    try:
        summary = vary(out, SAMPLES if samples is None else samples)
    except KeyboardInterrupt:
        click.echo(f"the same command goes on with what is in {out / 'sensitivity'}", err=True)
        raise
    if not as_json:
        for sentence in sentences(summary):
            click.echo(sentence)
        click.echo(f"{out / 'sensitivity.html'} has all of it.")
    return summary


def _print_results(summary: dict[str, Any], out: Path) -> None:
    """Print the summary."""
    from rich.console import Console

    from pathcontrol.cli.tables import peaks_table

    console = Console()
    console.print(peaks_table(summary))
    console.print(_engine_line(summary["compiled_engine"]))
    console.print(f"Figures 7 to 10, data, animations and summary.json are in {out}/ ({summary['seconds']} s).")


def _engine_line(compared: dict[str, Any]) -> str:
    """Return the sentence on how far the compiled engine is from these numbers, which are the reference's."""
    if "missing" in compared:
        return f"These are Pinocchio's; they could not be compared: {compared['missing']}"
    q = max(values["q_rad"] for values in compared.values())
    peak = max(values["e_p_peak_deg"] for values in compared.values())
    return f"These are Pinocchio's; the compiled engine differs by {q:.0e} rad in q and {peak:.0e} deg in the peaks."
