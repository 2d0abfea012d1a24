"""Universal Robots' arms, driven by torques through ur_rtde."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._extras import load_extra
from pathcontrol.errors import ArmError
from pathcontrol.hardware.arm import Measurement

_VARIABLES = ["timestamp", "actual_q", "actual_qd", "robot_status_bits", "safety_status_bits"]
_PATIENCE = 2.5  # periods after which a state counts as lost
_GLANCE = 5e-5  # s between two looks for a new state
_NO_FRICTION = [0.0] * 6


class UR:
    """An arm of Universal Robots as an :class:`Arm`: states come and torques go at 500 Hz, through ``ur_rtde``.

    >>> loop = ControlLoop(law, period=2e-3)
    >>> record = drive(loop, UR("192.168.0.2"), duration=10.0)

    Torques go to ``direct_torque`` of URScript (PolyScope 5.26), which adds those that carry the weight of
    the arm and of the payload it was told of, so they are sent without g(q). It can also compensate friction; that is
    left to the law, and both its scales are sent as 0. The controller goes back to holding the position as soon as a
    period passes without a torque, and stops the arm where it leaves its safety limits.

    Args:
        address: host name or address of the robot, which must be in remote control.
        frequency: states and torques per second [1/s]; the period of the loop is its inverse.

    Attributes:
        receive: the ``RTDEReceiveInterface``.
        control: the ``RTDEControlInterface``, as for ``setPayload`` before a drive.

    Raises:
        ArmError: the robot cannot be reached, or does not run the control script.
        MissingExtraError: ``ur_rtde`` is not installed.
    """

    carries_weight = True

    def __init__(self, address: str, frequency: float = 500.0) -> None:
        rate = as_scalar("frequency", frequency, positive=True)
        self._address, self._period, self._last = address, 1.0 / rate, -np.inf
        control, receive = _load_library()
        try:
            self.receive = receive.RTDEReceiveInterface(address, rate, _VARIABLES)
            self.control = control.RTDEControlInterface(address, rate)
        except RuntimeError as error:
            raise ArmError(
                f"the robot at {address!r} cannot be used: {error}", argument="address", value=address
            ) from error

    def locate(self) -> Measurement:
        """Return the present state of the robot.

        Raises:
            ArmError: the robot is stopped, or not there any more.
        """
        self._check()
        return self._measured()

    def read(self) -> Measurement | None:
        """Wait for the next state, and return what it measured; ``None`` where it has not come in time.

        Raises:
            ArmError: the robot has stopped, or is not there any more.
        """
        self._check()
        with self._explaining():
            runs = self.control.isProgramRunning() or self.control.reuploadScript()
        if not runs:
            raise ArmError("the robot does not run the control script; is it switched on and in remote control?")
        deadline = time.perf_counter() + _PATIENCE * self._period
        while self.receive.getTimestamp() == self._last:
            if time.perf_counter() > deadline:
                return None
            time.sleep(_GLANCE)
        return self._measured()

    def write(self, tau: Array) -> None:
        """Send torques without g(q) [N m], (6,)."""
        with self._explaining():
            taken = self.control.directTorque(tau.tolist(), _NO_FRICTION, _NO_FRICTION)
        if not taken:
            self._check()
            raise ArmError("the robot does not take torques: its control script has ended")

    def finish(self) -> None:
        """End the control script; the robot holds its position from then on."""
        with suppress(RuntimeError, ArmError):
            self._check()  # ur_rtde would wait for an answer of a robot that is stopped or gone
            if self.control.isProgramRunning():
                self.control.stopScript()

    def _check(self) -> None:
        """Check that the robot is there and not stopped."""
        if not (self.receive.isConnected() and self.control.isConnected()):
            raise ArmError(f"the connection to the robot at {self._address!r} is lost", value=self._address)
        if self.receive.isEmergencyStopped():
            raise ArmError("emergency stop of the robot")
        if self.receive.isProtectiveStopped():
            raise ArmError("protective stop of the robot; it is unlocked at its pendant or by its dashboard server")

    @contextmanager
    def _explaining(self) -> Iterator[None]:
        """Raise what ur_rtde raises in the block as an ArmError: it does so where it cannot connect again."""
        try:
            yield
        except RuntimeError as error:
            raise ArmError(
                f"the connection to the robot at {self._address!r} is lost: {error}", value=self._address
            ) from error

    def _measured(self) -> Measurement:
        """Return what one state measured: the thread of ur_rtde may bring another while it is read."""
        while True:
            t = self.receive.getTimestamp()
            q, qd = np.array(self.receive.getActualQ()), np.array(self.receive.getActualQd())
            if self.receive.getTimestamp() == t:
                self._last = t
                return Measurement(q, qd, t)


def _load_library() -> tuple[Any, Any]:
    """Return the modules of ``ur_rtde``."""
    names = ("rtde_control", "rtde_receive")
    control, receive = (load_extra(name, "ur", "driving an arm of Universal Robots", "ur_rtde") for name in names)
    return control, receive
