"""A session of software in the loop: a control loop drives a machine in real time, and what came of it in numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, as_joint_vector, as_scalar
from pathcontrol._expect import expect
from pathcontrol.control.base import Controller
from pathcontrol.hardware.arm import Measurement
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.drive import ENDED, DriveRecord, drive
from pathcontrol.hardware.envelope import Envelope
from pathcontrol.hardware.sil.machine_arm import MachineArm
from pathcontrol.hardware.sil.machine_process import MachineProcess
from pathcontrol.robot.model import RobotModel

_SHARES = {"p50": 50.0, "p90": 90.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}
_CALM = 1.0  # s after which the plan goes on that was held, or the arm that was damped
_MOST = 20_000  # samples of which the nearest point is looked for


@dataclass(frozen=True)
class SilReport:
    """The numbers of a session of software in the loop.

    Attributes:
        ticks: steps of the control loop.
        missed: periods in which the machine had no new torque, and went on with the last one or braked.
        jitter: by how much the time between two states that were taken differs from the period [s]; percentiles of it,
            ``p50`` to ``p99.9``, and ``max``.
        peaks: largest values in the second half: ``e_p`` [rad], ``contour_error`` [rad] (distance from the path),
            ``qd`` [rad/s], ``tau`` [N m], and ``tau_ratio``, the share of the torque limits.
        events: ``faults`` by their kind, ``resumed``, how often the plan went on by itself; ``mode`` and ``reason`` at
            the end, and ``stopped``, why the machine went, or "".
        packets: what ``loop`` and ``machine`` counted.
        end: ``distance`` from the path [rad] and ``speed`` [rad/s] of the last measurement.
        real_time: whether the loop had real-time priority.
    """

    ticks: int
    missed: int
    jitter: dict[str, float]
    peaks: dict[str, float]
    events: dict[str, Any]
    packets: dict[str, dict[str, int]]
    end: dict[str, float]
    real_time: bool

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers as plain values."""
        return asdict(self)


def run_sil(
    law: Controller,
    q: Array,
    duration: float,
    period: float = 1e-3,
    plant: RobotModel | None = None,
    envelope: Envelope | None = None,
) -> SilReport:
    """Let a law drive an arm in MuJoCo, in a process of its own, in real time over UDP on this computer.

    Where the plan was held, or the arm damped, because the computer was busy, it goes on after a second.

    Args:
        law: the law, with one task and one set of gains.
        q: where the arm starts [rad], (n,).
        duration: time along the path [s].
        period: control period [s].
        plant: the arm of the machine with its friction; by default that of the law.
        envelope: that of the loop; by default one that bears 20 bad measurements and gaps of 50 periods.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        ArmError: the machine does not start.
        InputError: an argument has another form, or a limit of the arm is missing.
    """
    expect("law", law, Controller)
    arm = law.robot if plant is None else plant
    loop = ControlLoop(law, period, Envelope(patience=20, lost=50.0) if envelope is None else envelope)
    span = as_scalar("duration", duration, positive=True)
    posture = as_joint_vector("q", q, arm.n)
    machine = MachineProcess(arm, posture, period)
    try:
        line = connect(law, "127.0.0.1", machine.port, machine.key, span, period)
        return finish_session(loop, line, span, machine)
    finally:
        machine.kill()


def connect(law: Controller, host: str, port: int, key: bytes, duration: float, period: float) -> MachineArm:
    """Return the line to a machine, with room for the times of all states."""
    room = int(1.5 * as_scalar("duration", duration, positive=True) / period) + 10_000
    return MachineArm(law.robot, host, port, key, period, room)


def finish_session(
    loop: ControlLoop, line: MachineArm, duration: float, machine: MachineProcess | None = None
) -> SilReport:
    """Drive the machine at the end of a ``line`` to the end, and return the numbers."""
    patient = _Patient(loop, line)
    record = drive(loop, patient, duration)
    summary = {} if machine is None else machine.wait()
    counted = dict(summary.get("packets", {}))
    status, late = record.status, line.arrivals[: line.count["taken"]]
    away = np.abs(np.diff(late) - loop.period)
    jitter = {name: float(np.percentile(away, share)) if len(away) else 0.0 for name, share in _SHARES.items()}
    events = {"faults": dict(status.faults), "resumed": patient.resumed, "stopped": record.stopped}
    return SilReport(
        status.ticks,
        int(counted.get("missed", line.count["lost"])),
        jitter,
        _find_peaks(loop, record, duration),
        events | {"mode": status.mode.name, "reason": status.reason},
        {"loop": dict(line.count), "machine": counted},
        _find_end(loop, record),
        record.real_time,
    )


class _Patient:
    """A machine whose loop goes on by itself a second after it was held or damped, as an operator would let it."""

    carries_weight = False

    def __init__(self, loop: ControlLoop, line: MachineArm) -> None:
        self._loop, self._line, self._calm = loop, line, 0
        self.resumed = 0

    def locate(self) -> Measurement:
        return self._line.locate()

    def read(self) -> Measurement | None:
        return self._line.read()

    def write(self, tau: Array) -> None:
        self._line.write(tau)
        status = self._loop.status
        held = status.mode in (Mode.HOLD, Mode.DAMP) and not status.reason.startswith(("held by the operator", ENDED))
        self._calm = self._calm + 1 if held else 0
        if self._calm * self._loop.period > _CALM:
            self._loop.resume()
            self._calm, self.resumed = 0, self.resumed + (self._loop.status.mode == Mode.RUN)

    def finish(self) -> None:
        self._line.finish()


def _find_peaks(loop: ControlLoop, record: DriveRecord, duration: float) -> dict[str, float]:
    """Return the largest values in the second half of the time along the path."""
    rows = np.flatnonzero((record.t >= 0.5 * duration) & (record.t <= duration))
    if not len(rows):
        return {}
    task, tau, qd = loop.law.task, record.tau[rows], record.qd[rows]
    s, q = record.s[np.maximum(rows - 1, 0)], record.q[rows]  # s is that after the tick
    some = slice(None, None, max(1, len(rows) // _MOST))
    nearest = np.asarray(task.q_d(task.sigma_bar(q[some], near=s[some]))) - q[some]
    return {
        "e_p": float(np.linalg.norm(np.asarray(task.q_d(s)) - q, axis=-1).max()),
        "contour_error": float(np.linalg.norm(nearest, axis=-1).max()),
        "qd": float(np.abs(qd).max()),
        "tau": float(np.abs(tau).max()),
        "tau_ratio": float((np.abs(tau) / loop.envelope.torque).max()),
    }


def _find_end(loop: ControlLoop, record: DriveRecord) -> dict[str, float]:
    """Return how far from the path, and how fast, the arm was at the last measurement."""
    known = np.flatnonzero(np.isfinite(record.t))
    if not len(known):
        return {}
    q, qd = record.q[known[-1]], record.qd[known[-1]]
    away = np.asarray(loop.law.task.q_d(loop.law.task.sigma_bar(q))).reshape(q.shape) - q
    return {"distance": float(np.linalg.norm(away)), "speed": float(np.abs(qd).max())}
