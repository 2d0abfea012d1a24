"""The command ``pathcontrol sil``."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pathcontrol.cli.group import import_all, json_option
from pathcontrol.errors import InputError

if TYPE_CHECKING:
    from pathcontrol.experiments.sil_tasks import SilTask
    from pathcontrol.hardware.sil.session import SilReport

_PEAKS = {
    "e_p": "e_p {:.4g} rad",
    "contour_error": "contour error {:.4g} rad",
    "qd": "velocity {:.4g} rad/s",
    "tau": "torque {:.4g} N m",
    "tau_ratio": "share of the torque limits {:.3g}",
}
_FAULTS = {
    "measurement": "bad measurements",
    "deadline": "late steps",
    "motion": "joints too fast or too near to a limit",
    "tube": "steps out of the tube",
    "law": "faults of the law",
    "start": "starts from afar",
    "operator": "holds by the operator",
    "arm": "stops of the arm",
}


@click.command("sil")
@click.option("--robot", metavar="FILE", help="A URDF file or the name of a known robot. Default: the paper's arm.")
@click.option("--task", metavar="TASK", help="paper, contour, or an experiment FILE.toml with its robot and law.")
@click.option("--duration", type=float, default=10.0, show_default=True, metavar="S", help="Time along the path.")
@click.option("--serve", metavar="HOST:PORT", help="Be the machine only, at this address, until a loop has driven it.")
@click.option("--connect", metavar="HOST:PORT", help="Be the loop only, and drive the machine at this address.")
@click.option(
    "--key",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="The shared key, 16 bytes or more; beyond this computer it must be given.",
)
@json_option
def command(
    robot: str | None,
    task: str | None,
    duration: float,
    serve: str | None,
    connect: str | None,
    key: Path | None,
    as_json: bool,
) -> None:
    """Drive an arm in MuJoCo in real time: software in the loop.

    The arm is a process of its own that tells its state by UDP at the rate of the control loop and takes torques, as a
    real one does, and as badly as the computer and the network allow. At the end it says how many ticks there were and
    were missed, how unevenly states came, peaks of the errors in the second half, and what the envelope reacted to.
    """
    if serve is not None and connect is not None:
        raise click.UsageError("give --serve on one computer and --connect on the other")
    import_all()
    from pathcontrol._arrays import as_scalar
    from pathcontrol.experiments.sil_tasks import make_sil_task

    as_scalar("--duration", duration, positive=True)
    driven, secret = make_sil_task(robot, task), None if key is None else _read_key(key)
    if serve is not None:
        _serve(driven, serve, secret)
        return
    report = _drive(driven, duration, connect, secret)
    click.echo(json.dumps(report.to_dict()) if as_json else describe_report(report))


def _drive(driven: SilTask, duration: float, address: str | None, key: bytes | None) -> SilReport:
    """Return the numbers of a session with a machine here, or at an address."""
    from pathcontrol.hardware.control_loop import ControlLoop
    from pathcontrol.hardware.sil.packets import check_key
    from pathcontrol.hardware.sil.session import connect, finish_session, run_sil

    if address is None:
        return run_sil(driven.law, driven.q, duration, driven.period, driven.plant, driven.envelope)
    host, port = _split_address(address)
    check_key(host, key)
    loop = ControlLoop(driven.law, driven.period, driven.envelope)
    line = connect(driven.law, host, port, key or bytes(32), duration, driven.period)
    return finish_session(loop, line, duration)


def _serve(driven: SilTask, address: str, key: bytes | None) -> None:
    """Be the machine until a loop has driven it."""
    from pathcontrol.hardware.sil.machine_process import MachineProcess
    from pathcontrol.hardware.sil.packets import check_key

    host, port = _split_address(address)
    check_key(host, key)
    machine = MachineProcess(driven.plant, driven.q, driven.period, host, port, key or bytes(32))
    click.echo(f"a machine at {host}:{machine.port}", err=True)
    while machine.running:
        time.sleep(0.1)
    click.echo(json.dumps(machine.wait()))


def _split_address(address: str) -> tuple[str, int]:
    """Return host and port of an address."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or int(port) > 65535:
        raise InputError(f"{address!r}, expected HOST:PORT with a port up to 65535, as 127.0.0.1:9700", value=address)
    return host, int(port)


def _read_key(path: Path) -> bytes:
    """Return the key in a file."""
    if not path.is_file():
        raise InputError(
            f"there is no file {str(path)!r}, expected a key; `head -c 32 /dev/urandom > {path}` makes one",
            file=str(path),
        )
    with path.open("rb") as stream:
        return stream.read(4096)


def describe_report(report: SilReport) -> str:
    """Return the numbers in words."""
    events, end = report.events, report.end
    jitter = ", ".join(f"{name} {1e6 * value:.0f} µs" for name, value in report.jitter.items())
    peaks = ", ".join(_PEAKS[name].format(value) for name, value in report.peaks.items()) or "nothing was measured"
    faults = ", ".join(f"{_FAULTS.get(kind, kind)}: {count}" for kind, count in events["faults"].items())
    times = "once" if events["resumed"] == 1 else f"{events['resumed']} times"
    lines = [
        f"{report.ticks} ticks, {report.missed} missed, {'with' if report.real_time else 'without'} real-time priority",
        f"  jitter: {jitter}",
        f"  peaks in the second half: {peaks}",
        f"  envelope: {faults}; resumed {times}" if faults else "  envelope: nothing to react to",
        f"  end: {events['mode']}{', ' + events['reason'] if events['reason'] else ''}; "
        f"{end.get('distance', float('nan')):.3g} rad from the path at {end.get('speed', 0.0):.2g} rad/s",
    ]
    return "\n".join(lines)
