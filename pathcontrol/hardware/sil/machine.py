"""The machine: an arm in MuJoCo that moves in real time, tells its state by UDP and takes torques.

``python -m pathcontrol.hardware.sil.machine`` reads :class:`MachineSettings` as JSON from its standard input, says its
port in a line of its standard output, and at the end what it counted. It knows nothing of laws and paths.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import time
from collections import Counter
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._extras import load_extra
from pathcontrol.hardware.real_time import real_time
from pathcontrol.hardware.sil.packets import LONGEST, Kind, Packet, read_packet, write_packet

_STALE = 20  # periods after which an answer is too old to act
_SILENT = 50  # periods without an answer after which the brakes come on
_BRAKE = 30.0  # 1/s, at which the brakes stop the arm
_PATIENCE = 60.0  # s in which a loop must say hello, or be heard again


class MachineSettings(NamedTuple):
    """The settings of a machine, as plain values.

    Attributes:
        mjcf: the arm in MuJoCo's language.
        steps: of MuJoCo in a period.
        bias: torques against which joints move [N m], (n,).
        effort: largest torques [N m], (n,).
        q: where it starts [rad], (n,).
        period: time between states [s].
        host: address at which it listens.
        port: its port, 0 for a free one.
        key: shared key as hexadecimal digits.
    """

    mjcf: str
    steps: int
    bias: list[float]
    effort: list[float]
    q: list[float]
    period: float
    host: str
    port: int
    key: str


def load_mujoco() -> Any:
    """Return MuJoCo.

    Raises:
        MissingExtraError: it is not installed.
    """
    return load_extra("mujoco", "mujoco", "a simulated machine")


class Machine:
    """An arm with brakes, drives that hold the last torque, and a line to one control loop.

    The brakes are on until the first torque comes, and come on again when none has come for 50 periods. A torque
    answers the state of its number; it acts if it is newer than the one before and not older than 20 periods.

    Args:
        settings: what it is.
    """

    def __init__(self, settings: MachineSettings) -> None:
        self._mujoco = load_mujoco()
        self._settings, self._key = settings, bytes.fromhex(settings.key)
        self._model = self._mujoco.MjModel.from_xml_string(settings.mjcf)
        self._data = self._mujoco.MjData(self._model)
        self._data.qpos[:] = settings.q
        self._mujoco.mj_forward(self._model, self._data)
        self._effort, self._bias = np.array(settings.effort), np.array(settings.bias)
        self._tau, self._answered, self._heard = np.zeros(len(settings.q)), -1, -1
        self._session, self._peer = os.urandom(8), ("", 0)
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._line.bind((settings.host, settings.port))
        self.count, self._tick = Counter[str](), 0

    @property
    def port(self) -> int:
        """The port at which it listens."""
        return int(self._line.getsockname()[1])

    def run(self) -> None:
        """Wait for a loop, and move until it says goodbye or is not heard any more."""
        if not self._wait_for_hello():
            return
        self._line.setblocking(False)
        period, longest = self._settings.period, round(_PATIENCE / self._settings.period)
        due = time.perf_counter()
        while self._tick - max(self._heard, 0) < longest:
            self._send_state()
            due += period
            if (left := due - time.perf_counter()) > 0:
                time.sleep(left)
            else:
                self.count["late"] += 1
                due = due if left > -10 * period else time.perf_counter()  # what is far behind is not made up
            if self._listen():
                return
            self._advance()
            self._tick += 1

    def summary(self) -> dict[str, Any]:
        """Return what it counted, and its last state."""
        state = {"q": self._data.qpos.tolist(), "qd": self._data.qvel.tolist()}
        return {"ticks": self._tick, "packets": dict(self.count)} | state

    def _wait_for_hello(self) -> bool:
        """Wait for the first hello; return whether it came."""
        self._line.settimeout(0.1)
        until = time.monotonic() + _PATIENCE
        while time.monotonic() < until:
            try:
                data, sender = self._line.recvfrom(LONGEST + 1)
            except TimeoutError:
                continue
            packet = read_packet(data, self._key)
            if packet is not None and packet.kind == Kind.HELLO:
                self._peer = sender
                return True
            self.count["foreign"] += 1
        return False

    def _send_state(self) -> None:
        """Send the state."""
        numbers = np.concatenate([[self._tick * self._settings.period], self._data.qpos, self._data.qvel])
        data = write_packet(Packet(Kind.STATE, self._session, self._tick, numbers), self._key)
        try:
            self._line.sendto(data, self._peer)
        except OSError:  # nobody listens any more
            self.count["unsent"] += 1

    def _listen(self) -> bool:
        """Take all packets that have come; return whether one of them says goodbye."""
        while True:
            try:
                data, sender = self._line.recvfrom(LONGEST + 1)
            except (BlockingIOError, ConnectionRefusedError):
                return False
            packet = read_packet(data, self._key) if sender == self._peer else None
            if packet is None:
                self.count["foreign"] += 1
            elif packet.kind == Kind.BYE and packet.session == self._session:
                return True
            elif packet.kind == Kind.TORQUE:
                self._take(packet)

    def _take(self, packet: Packet) -> None:
        """Let the torques of a packet act, if they are new."""
        sound = packet.session == self._session and len(packet.numbers) == len(self._tau)
        if not sound or not np.isfinite(packet.numbers).all() or packet.number > self._tick:
            self.count["wrong"] += 1
        elif packet.number <= self._answered:
            self.count["repeated"] += 1
        elif packet.number < self._tick - _STALE:
            self.count["stale"] += 1
        else:
            self.count["taken"] += 1
            self._tau[:] = np.clip(packet.numbers, -self._effort, self._effort)
            self._answered, self._heard = packet.number, self._tick

    def _advance(self) -> None:
        """Move the arm for a period."""
        if self._heard != self._tick:
            self.count["missed"] += 1
        if self._heard < 0 or self._tick - self._heard > _SILENT:
            self.count["braked"] += 1
            for _ in range(self._settings.steps):
                self._data.qfrc_applied[:] = self._brake()
                self._mujoco.mj_step(self._model, self._data)
            return
        self._data.qfrc_applied[:] = self._tau - self._bias
        self._mujoco.mj_step(self._model, self._data, self._settings.steps)

    def _brake(self) -> Array:
        """Return torques that carry the arm and stop it."""
        momentum = np.zeros(len(self._tau))
        self._mujoco.mj_mulM(self._model, self._data, momentum, self._data.qvel)
        return np.asarray(self._data.qfrc_bias - _BRAKE * momentum)


def main() -> None:
    """Run a machine with the settings from standard input."""
    try:
        machine = Machine(MachineSettings(**json.loads(sys.stdin.readline())))
    except OSError as error:  # the address is in use, or of another computer
        print(error.strerror, flush=True)
        return
    print(machine.port, flush=True)
    with real_time():
        machine.run()
    with suppress(BrokenPipeError):  # who has started it may have gone
        print(json.dumps(machine.summary()), flush=True)


if __name__ == "__main__":
    main()
