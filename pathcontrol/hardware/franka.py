"""Franka's arms, driven by torques through libfranka, Franka's own client."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._extras import load_extra
from pathcontrol.errors import ArmError
from pathcontrol.hardware.arm import Measurement
from pathcontrol.hardware.envelope import Envelope

#: most that a torque may change from one period to the next [N m], ``franka::kMaxTorqueRate`` · 1 ms
_STEP = 0.999


class Franka:
    """A Franka arm as an :class:`Arm`: states come and torques go 1000 times a second, through ``pylibfranka``.

    >>> loop = ControlLoop(law, period=1e-3, envelope=Franka.envelope)
    >>> record = drive(loop, Franka("172.16.0.2"), duration=10.0)

    The robot adds the torques that carry its own weight and that of the load it was told of
    (``arm.robot.set_load``), so those that are sent are without g(q). As ``limit_rate`` of libfranka does, which its
    client in Python lacks, they are held within 1000 N m/s of the torques that the robot had last. A state that is
    lost makes the next one 2 ms younger; the time of :class:`Measurement` is that of the robot.

    Args:
        address: host name or address of the robot.
        enforce_real_time: refuse to work without a real-time kernel, as libfranka does. Without it packets are lost
            whenever this computer is busy.

    Attributes:
        envelope: that of a Franka Research 3. Torques change half as fast as the robot allows, 1000 N m/s, so that a
            lost packet does not make a step that is too large. Joints are braked by half of the deceleration from which
            the robot takes its limits of velocity near those of position. After 20 lost packets the robot stops itself.
        robot: the ``pylibfranka.Robot``, for all that is set up before a drive.
        state: the last ``pylibfranka.RobotState``, ``None`` before the first.

    Raises:
        ArmError: the robot cannot be reached, or the kernel has no real-time capabilities.
        MissingExtraError: ``pylibfranka`` is not installed.
    """

    carries_weight = True
    envelope = Envelope(torque_rate=500.0, lost=20.0, deceleration=[3.0, 1.29, 1.75, 2.0, 8.5, 2.75, 8.5])

    def __init__(self, address: str, enforce_real_time: bool = True) -> None:
        self._library = _load_library()
        choices = self._library.RealtimeConfig
        scheduler = os.sched_getscheduler(0), os.sched_getparam(0)
        try:
            self.robot = self._library.Robot(address, choices.kEnforce if enforce_real_time else choices.kIgnore)
        except RuntimeError as error:
            raise ArmError(
                f"the robot at {address!r} cannot be used: {error}", argument="address", value=address
            ) from error
        finally:
            os.sched_setscheduler(0, *scheduler)  # libfranka takes the highest priority, and keeps it after the drive
        self.state: Any = None
        self._control: Any = None
        self._sent: Array | None = None

    def locate(self) -> Measurement:
        """Return the present state of the robot.

        Raises:
            ArmError: the robot is not there any more.
        """
        try:
            self.state = self.robot.read_once()
        except RuntimeError as error:
            raise ArmError(str(error)) from error
        return self._measured()

    def read(self) -> Measurement:
        """Wait for the next state, and return what it measured.

        Raises:
            ArmError: the robot does not take torques now, has stopped by a reflex, or is not there any more.
        """
        try:
            if self._control is None:
                self._control, self._sent = self.robot.start_torque_control(), None
            self.state, _ = self._control.readOnce()
        except RuntimeError as error:
            raise ArmError(f"{error} (Franka.recover() clears a reflex)") from error
        return self._measured()

    def write(self, tau: Array) -> None:
        """Send torques without g(q) [N m], (7,), within the robot's limit of their rate."""
        self._sent = _limit_step(tau, np.array(self.state.tau_J_d), self._sent)
        try:
            self._control.writeOnce(self._library.Torques(self._sent.tolist()))
        except RuntimeError as error:
            raise ArmError(str(error)) from error

    def finish(self) -> None:
        """End the torque control; the robot holds its position from then on."""
        control, self._control = self._control, None
        if control is None or self.state is None:
            return
        last = self._library.Torques(list(self.state.tau_J_d))
        last.motion_finished = True
        with suppress(RuntimeError):  # it has ended already, by a reflex or with the connection
            control.writeOnce(last)

    def recover(self) -> None:
        """Clear a reflex, so that the robot can be driven again.

        Raises:
            ArmError: the robot cannot be recovered by software.
        """
        try:
            self.robot.automatic_error_recovery()
        except RuntimeError as error:
            raise ArmError(f"the robot is not recovered: {error}") from error

    def _measured(self) -> Measurement:
        """Return what the last state measured."""
        return Measurement(np.array(self.state.q), np.array(self.state.dq), self.state.time.to_sec())


def _limit_step(tau: Array, had: Array, sent: Array | None) -> Array:
    """Return torques within a step of those that the robot ``had``, and of those that were ``sent`` last, if any.

    The two differ where a packet was late or lost; the robot may still get it, or not.
    """
    sent = had if sent is None else sent
    middle, half = (had + sent) / 2, np.maximum(_STEP - np.abs(had - sent) / 2, 0.0)
    return np.minimum(np.maximum(tau, middle - half), middle + half)


def _load_library() -> Any:
    """Return ``pylibfranka``."""
    return load_extra("pylibfranka", "franka", "driving a Franka arm")
