"""The command ``pathcontrol sweep``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pathcontrol._interrupts import delay_interrupt
from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import engine_option, json_option

if TYPE_CHECKING:
    from pathcontrol.simulation.engines import Engine
    from pathcontrol.sweeps.result import SweepResult


out_option = click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), help="Default: results/ and the file's name."
)
resume_option = click.option("--resume", is_flag=True, help="Go on with what is in the folder, if there is something.")
chunk_option = click.option(
    "--chunk", type=click.IntRange(1), default=500, show_default=True, help="Samples that are simulated together."
)


@click.command("sweep")
@click.argument("file", type=click.Path(exists=False, path_type=Path))
@out_option
@resume_option
@chunk_option
@click.option("--cluster", metavar="ADDRESS", help="Of a Dask scheduler, as tcp://host:8786, or its scheduler file.")
@click.option("--tls-ca", metavar="FILE", help="With --cluster tls://…: the certificate of the authority, in PEM.")
@click.option("--tls-cert", metavar="FILE", help="The certificate of this process.")
@click.option("--tls-key", metavar="FILE", help="Its key.")
@engine_option
@json_option
def command(
    file: Path,
    out: Path | None,
    resume: bool,
    chunk: int,
    cluster: str | None,
    tls_ca: str | None,
    tls_cert: str | None,
    tls_key: str | None,
    engine: Engine | None,
    as_json: bool,
) -> None:
    """Simulate every sample of the [sweep] in FILE.toml and keep its numbers.

    They are in Parquet files in the folder chunks/, histories that the file asks for in runs/. After Ctrl-C, or a
    crash, finished chunks stay, and --resume computes the rest.
    """
    check_file(file, "an experiment")
    with delay_interrupt():
        from pathcontrol.experiments.sweep_runner import run_sweep
        from pathcontrol.sweeps.cluster.connection import load_security
        from pathcontrol.sweeps.parquet import load_parquet

        load_parquet()
    folder = Path("results") / file.stem if out is None else out
    try:
        security = load_security(tls_ca, tls_cert, tls_key)
        result = run_sweep(file, folder, chunk=chunk, resume=resume, cluster=cluster, security=security, engine=engine)
    except KeyboardInterrupt:
        click.echo(f"--resume goes on with what is in {folder}", err=True)
        raise
    _print_results(result, as_json)


def _print_results(result: SweepResult, as_json: bool) -> None:
    """Print the results."""
    from pathcontrol.analysis.readable import describe_outcomes
    from pathcontrol.analysis.run_metrics import UNITS

    table = result.table()
    numbers = {str(name): v for name, v in table.data_vars.items() if v.dtype.kind == "f" and name != "diverged_time"}
    spread = {name: _spread(values.to_numpy()) for name, values in numbers.items()}
    statuses = table["status"].to_numpy().tolist()
    if as_json:
        count = {status: statuses.count(status) for status in sorted(set(statuses))}
        histories = {str(i): str(result.history(i)) for i in result.kept}
        content = {"out": str(result.folder), "samples": result.samples, "status": count, "metrics": spread}
        click.echo(json.dumps(content | {"histories": histories}))
        return
    click.echo(f"{result!r}: {describe_outcomes(statuses)}")
    click.echo(f"  {'':22} {'least':>12} {'median':>12} {'largest':>12}")
    for name, values in spread.items():
        if values["median"] is not None:
            line = " ".join(f"{values[key]:12.5g}" for key in ("least", "median", "largest"))
            unit = f" {UNITS[name]}" if UNITS.get(name) else ""
            click.echo(f"  {name:22} {line}{unit}" + (f"  and {values['never']} never" if values["never"] else ""))
    for sample in result.kept:
        click.echo(f"  history of sample {sample}: {result.history(sample)}")


def _spread(values: Any) -> dict[str, float | None]:
    """Return least, median and largest of the finite values, and the number of infinite ones, which never settled."""
    import numpy as np

    known, never = values[np.isfinite(values)], int(np.isinf(values).sum())
    if not known.size:
        return {"least": None, "median": None, "largest": None, "never": never}
    return {
        "least": float(known.min()),
        "median": float(np.median(known)),
        "largest": float(known.max()),
        "never": never,
    }
