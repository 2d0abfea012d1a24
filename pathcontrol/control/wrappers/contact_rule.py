"""The rule that halts a plan where the arm meets something, and lets it go on when that is gone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.control.base import Controller
from pathcontrol.control.gains import diagonal_gain
from pathcontrol.control.wrappers.override_rule import OverrideRule
from pathcontrol.control.wrappers.speed_rule import Moment, Speed, SpeedRule, check_rows
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import InputError
from pathcontrol.robot.friction import levels_of, viscous_of
from pathcontrol.robot.model import RobotModel

_SHARE = 0.1  # of the effort limits, the threshold where none is given
_GONE = 0.5  # share of the threshold below which a contact counts as gone
_ALERT = 5e-3  # s, time constant T with which the halt is wound up


class ContactRule(SpeedRule):
    """The factor w goes to 0 while a contact is seen and for a while after it, and else to what is asked for.

    The contact torque of a joint is what the law's observer sees beyond the friction of the model, with the dry level
    F: |r + b q̇| − F. A contact begins where it exceeds the threshold at a joint, and is gone where it is less than half
    of that at all joints (hysteresis). The state is (w, ẇ, c), c the time [s] for which the plan is still halted:

        ċ = (p − c)/T  in contact,   ċ = −min(1, (c + p)/T)  else,   T = 5 ms.

    It goes on where c ≤ 0, and passes 0 at the rate −1, so that it can be integrated in continuous time.

    Args:
        robot: the model of the arm.
        threshold: the contact torque at which the plan is halted [N m], a number, (n,), or (N, n).
        acceleration: largest |ẇ| [1/s].
        pause: p, for how long the plan stays halted when the contact is gone [s].
    """

    size = 3
    relative = True

    def __init__(self, robot: RobotModel, threshold: ArrayLike | None, acceleration: float, pause: float) -> None:
        self.threshold = _check_threshold(robot, threshold)
        self.pause = as_scalar("pause", pause, positive=True)
        self.robot, self.ramp = robot, OverrideRule(1.0, acceleration)

    @property
    def acceleration(self) -> float:
        """The largest |ẇ| [1/s]."""
        return self.ramp.acceleration

    def contact_torque(self, moment: Moment) -> Array:
        """Return |r + b q̇| − F [N m], (*batch, n), negative where friction explains what is seen."""
        observation, friction = moment.out.observation, self.robot.friction
        if observation is None:
            name = type(unwrap(moment.law)).__name__
            raise InputError(
                f"{name}.law does not watch for contacts; end it with "
                "return self.compensate(t, q, qd, z, ControlOutput(...))"
            )
        dry = np.maximum(*levels_of(friction, moment.qd))
        return np.asarray(np.abs(observation.torque + viscous_of(friction) * moment.qd) - dry)

    def count_rows(self) -> int:
        return len(self.threshold) if self.threshold.ndim > 1 else 1

    def start(self, law: Controller, q: Array, qd: Array, s: Array) -> Array:
        check_rows("threshold", self.count_rows(), s.size)
        return np.concatenate([self.ramp.start(law, q, qd, s), np.full((*s.shape, 1), -self.pause)], axis=-1)

    def rate(self, moment: Moment, asked: Speed, x: Array) -> Array:
        return self.ramp.rate(moment, asked, x[..., :2])

    def memory_rate(self, moment: Moment, asked: Speed, tau: Array, x: Array) -> Array:
        left = x[..., 2]
        contact = self._is_in_contact(moment, left > 0)
        wanted = Speed(np.where(contact | (left > 0), 0.0, asked.factor), asked.rate)
        unwinding = np.minimum(1.0, (left + self.pause) / _ALERT)
        winding = np.where(contact, (self.pause - left) / _ALERT, -unwinding)
        ramp = self.ramp.memory_rate(moment, wanted, tau, x[..., :2])
        return np.concatenate([ramp, winding[..., None]], axis=-1)

    def advance(self, x: Array, xdot: Array, period: float) -> Array:
        left = np.minimum(np.maximum(x[..., 2:] + period * xdot[..., 2:], -self.pause), self.pause)
        return np.concatenate([self.ramp.advance(x[..., :2], xdot[..., :2], period), left], axis=-1)

    def describe(self) -> dict[str, Any]:
        return {"threshold": self.threshold.tolist(), "pause": self.pause, "acceleration": self.acceleration}

    def _is_in_contact(self, moment: Moment, halted: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return where a contact torque is beyond the threshold, or, halted, beyond half of it, (*batch,)."""
        share = (self.contact_torque(moment) / self.threshold).max(-1)
        return share > np.where(halted, _GONE, 1.0)


def _check_threshold(robot: RobotModel, threshold: ArrayLike | None) -> Array:
    """Check the threshold [N m]; return it, a tenth of the effort limits where none is given."""
    if threshold is not None:
        return diagonal_gain("threshold", threshold, robot.n, robot.joint_names)
    effort = robot.limits.effort
    if not (np.isfinite(effort) & (effort > 0)).all():
        raise InputError(
            f"{robot.name} has no effort limits of which the threshold may be a tenth; give threshold = [...] in N m",
            argument="threshold",
        )
    return _SHARE * effort
