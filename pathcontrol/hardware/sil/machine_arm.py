"""The line from a control loop to a machine, as an arm that :func:`drive` takes."""

from __future__ import annotations

import socket
import time

import numpy as np

from pathcontrol._arrays import Array, as_whole
from pathcontrol.errors import ArmError
from pathcontrol.hardware.arm import Measurement
from pathcontrol.hardware.sil.packets import LONGEST, Kind, Packet, check_key, read_packet, write_packet
from pathcontrol.robot.model import RobotModel

_HELLO = 0.05  # s between two hellos
_MEET = 20.0  # s in which the machine must answer the first time
_GONE = 2.0  # s without a state after which the machine counts as gone
_TRIES = 1000  # periods in which a first state must come
_WAIT = 1.5  # periods in which a state must come


class MachineArm:
    """An arm that is a machine at an address; a :class:`Machine` in its own process, or whatever speaks its language.

    Packets that are not of the machine, not of this session, or older than one that has come are counted and ignored.

    Args:
        robot: the arm.
        host: address of the machine; one that is not of this computer needs a ``key``.
        port: its port.
        key: the shared key.
        period: time between its states [s].

    Attributes:
        count: how many packets were ``taken``, ``repeated``, ``foreign``, and states ``lost``.
        arrivals: times at which states were taken [s], for the first ``room`` of them.

    Raises:
        InputError: the address is not of this computer and there is no key, or it is too short.
        ArmError: the address is unknown or cannot be reached.
    """

    carries_weight = False

    def __init__(
        self, robot: RobotModel, host: str, port: int, key: bytes, period: float = 1e-3, room: int = 1_000_000
    ) -> None:
        check_key(host, key)
        as_whole("port", port, 0, 65535)
        self._n, self._key, self._period = robot.n, key, period
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._line.connect((host, port))  # the system drops what comes from elsewhere
        except OSError as error:
            self._line.close()
            raise ArmError(
                f"there is no way to a machine at {host}:{port}: {error.strerror}", argument="host", value=host
            ) from error
        self._session, self._number = b"", -1
        self._heard = time.monotonic()
        self.count = {"taken": 0, "repeated": 0, "foreign": 0, "lost": 0}
        self.arrivals = np.full(room, np.nan)  # memory that the system has given before the first tick

    def locate(self) -> Measurement:
        """Return the state of the arm, whose brakes are on; the machine begins to tell its states.

        Raises:
            ArmError: the machine does not answer.
        """
        if not self._session:
            self._meet()
        for _ in range(_TRIES):
            if (found := self.read()) is not None:
                return found
        raise ArmError(f"the machine answers, but no state of it comes in {_TRIES} periods", limit=_TRIES)

    def read(self) -> Measurement | None:
        """Return the newest state, or None where none comes within one and a half periods.

        Raises:
            ArmError: the machine has not been heard for 2 s, or never answers.
        """
        if not self._session:
            self._meet()
        newest = self._wait(_WAIT * self._period)
        if newest is None:
            if time.monotonic() - self._heard > _GONE:
                raise ArmError(f"the machine has not been heard for {_GONE:g} s; does it still run?", limit=_GONE)
            return None
        self._heard = time.monotonic()
        return Measurement(newest[1 : 1 + self._n], newest[1 + self._n :], float(newest[0]))

    def write(self, tau: Array) -> None:
        """Send torques [N m], (n,), as the answer to the last state."""
        self._send(Packet(Kind.TORQUE, self._session, self._number, tau))

    def finish(self) -> None:
        """Let the machine put its brakes on."""
        for _ in range(20):  # of which one comes, also where the line loses or garbles half of them
            self._send(Packet(Kind.BYE, self._session or bytes(8), 0, np.zeros(0)))
        self._line.close()

    def _meet(self) -> None:
        """Say hello until the machine answers."""
        until = time.monotonic() + _MEET
        while not self._session:
            if time.monotonic() > until:
                raise ArmError(
                    f"no machine answers within {_MEET:g} s; is it there, and has it the same key?", limit=_MEET
                )
            self._send(Packet(Kind.HELLO, bytes(8), 0, np.zeros(0)))
            self._line.settimeout(_HELLO)
            packet = self._receive()
            if packet is not None and self._is_state(packet):
                self._session = packet.session
            elif packet is None:
                time.sleep(_HELLO)  # the system may say at once that nobody listens
        self._heard = time.monotonic()

    def _wait(self, longest: float) -> Array | None:
        """Return the numbers of the newest state that comes within a time [s], or None."""
        newest, until = None, time.perf_counter() + longest
        while True:
            left = until - time.perf_counter()
            if newest is None and left <= 0:
                return None
            self._line.settimeout(0.0 if newest is not None else left)
            data = self._receive_bytes()
            if data is None:
                if newest is not None or until <= time.perf_counter():
                    return newest
                continue
            packet = read_packet(data, self._key)
            if packet is None or not self._is_state(packet) or packet.session != self._session:
                self.count["foreign"] += 1
            elif packet.number <= self._number:
                self.count["repeated"] += 1
            else:
                self._keep(packet)
                newest = packet.numbers

    def _is_state(self, packet: Packet) -> bool:
        """Return whether a packet is the state of such an arm."""
        return packet.kind == Kind.STATE and len(packet.numbers) == 1 + 2 * self._n

    def _keep(self, packet: Packet) -> None:
        """Count a state."""
        taken = self.count["taken"]
        if taken < len(self.arrivals):
            self.arrivals[taken] = time.perf_counter()
        self.count["taken"] = taken + 1
        self.count["lost"] += packet.number - self._number - 1 if taken else 0
        self._number = packet.number

    def _receive(self) -> Packet | None:
        """Return a packet, or None where none comes in time."""
        data = self._receive_bytes()
        return None if data is None else read_packet(data, self._key)

    def _receive_bytes(self) -> bytes | None:
        """Return what has come, or None where nothing comes in time."""
        try:
            return self._line.recv(LONGEST + 1)
        except (TimeoutError, BlockingIOError, ConnectionRefusedError):
            return None

    def _send(self, packet: Packet) -> None:
        """Send a packet; one that cannot be sent is a lost one."""
        try:
            self._line.send(write_packet(packet, self._key))
        except OSError:
            self.count["unsent"] = self.count.get("unsent", 0) + 1
