"""The torque interface of a real arm, or of a program that speaks for one."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from pathcontrol._arrays import Array


class Measurement(NamedTuple):
    """A measured state of an arm.

    Attributes:
        q: joint positions [rad], (n,).
        qd: joint velocities [rad/s], (n,).
        t: time on the clock of the arm [s].
    """

    q: Array
    qd: Array
    t: float


class Arm(Protocol):
    """An arm that is driven by torques: it is read and written once in every period.

    Attributes:
        carries_weight: whether the arm adds g(q) by itself, so that torques are sent without it.
    """

    carries_weight: bool

    def locate(self) -> Measurement:
        """Return the present state of the arm, which is not driven yet: the loop takes its time to start from there.

        Raises:
            ArmError: the arm is not there, or cannot be driven now.
        """

    def read(self) -> Measurement | None:
        """Wait for the next measurement and return it; ``None`` where it has not come in time.

        The first call starts the torque control.

        Raises:
            ArmError: the arm has stopped by itself, or is not there any more.
        """

    def write(self, tau: Array) -> None:
        """Send torques [N m], (n,), without g(q) where the arm carries its weight.

        Raises:
            ArmError: the arm has stopped by itself, or is not there any more.
        """

    def finish(self) -> None:
        """End the torque control and leave the arm to its own controller; it may be called twice and never raises."""
