"""Friction that changes for a while."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_physical, freeze
from pathcontrol.arguments import Form, Unit
from pathcontrol.errors import InputError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import Coulomb, FrictionLaw, levels_of, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.robot.scaled_friction import ScaledFriction
from pathcontrol.simulation.arm.disturbance import Begin, Span, TimedDisturbance, check_rollouts, no_torques


class FrictionChange(TimedDisturbance):
    """Friction of the arm that is a multiple of its own for a while, with dry friction added where that is given.

    The friction of the arm becomes factor · f(q̇) + F, F with the levels ``coulomb`` in both directions. It acts in the
    periods of the loop whose middle the time covers. A joint at rest sticks as long as the changed levels hold it. The
    law knows nothing of it and compensates what its model says. Of several changes each is one of what the others
    made before it. Continuous time does not know it.

    Args:
        factor: multiple of all friction of the arm, viscous and dry, 0 or more: a number, (n,), or for each rollout,
            (N, n) or (N, 1).
        start: when it begins [s], or for each rollout, (N,).
        duration: how long it lasts [s], or for each rollout, (N,).
        coulomb: dry friction that is added [N m], likewise.

    Raises:
        InputError: a factor or a level is negative or no number, or a time is no number.
    """

    def __init__(
        self,
        factor: Annotated[ArrayLike, Form.GAIN] = 1.0,
        start: Begin = 0.0,
        duration: Span = np.inf,
        coulomb: Annotated[ArrayLike, Form.GAIN, Unit("N m")] = 0.0,
    ) -> None:
        super().__init__(start, duration)
        self.factor, self.coulomb = _check_amount("factor", factor), _check_amount("coulomb", coulomb)
        check_rollouts(
            start=self.start.shape,
            duration=self.duration.shape,
            factor=self.factor.shape[:-1],
            coulomb=self.coulomb.shape[:-1],
        )

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        """Return zeros: it changes friction and pushes nothing."""
        return no_torques(q, self.share(t), self.factor, self.coulomb)

    @property
    def arm_change_times(self) -> Array:
        return self.jumps

    def change_arm(self, t: float, arm: RobotModel | RobotBatch) -> RobotModel | RobotBatch:
        """Return the arm with its friction at t [s]; the arm itself while it is as ever."""
        share = self.share(t)
        if not share.any():
            return arm
        factor, level = (np.where(share > 0, part, usual) for part, usual in ((self.factor, 1.0), (self.coulomb, 0.0)))
        law: FrictionLaw = ScaledFriction(arm.friction, _spread(factor, arm.n))
        if level.any():
            law = law + Coulomb(_spread(level, arm.n))
        return _with_friction(arm, law)

    def is_idle(self, law: FrictionLaw) -> bool:
        """Return whether it multiplies friction that an arm with this law does not have, and adds none."""
        parts = (viscous_of(law), *levels_of(law, np.zeros((1, law.n))))
        return bool((self.factor != 1).any() and not self.coulomb.any() and not any(map(np.any, parts)))


def _check_amount(name: str, value: ArrayLike) -> Array:
    """Check that factors or levels are numbers not below 0; return them read-only."""
    array = check_physical(name, as_array(name, value))
    if array.ndim > 2 or not (array >= 0).all():
        raise InputError(
            f"{name} = {array.tolist()}, expected numbers not below 0", argument=name, value=array, limit=0.0
        )
    return freeze(array)


def _spread(values: Array, n: int) -> Array:
    """Return values with one for each of n joints."""
    return np.broadcast_to(values, (*values.shape[:-1], n))


def _with_friction(arm: RobotModel | RobotBatch, law: FrictionLaw) -> RobotModel | RobotBatch:
    """Return an arm, or the arms of all rollouts, with another friction law."""
    if isinstance(arm, RobotBatch):
        return RobotBatch(arm.robots, law)
    parts = (viscous_of(law), *levels_of(law, np.zeros((1, law.n))))
    rows = max(len(part) if part.ndim > 1 else 0 for part in parts)
    return RobotBatch([arm] * rows, law) if rows > 1 else arm.with_friction(law)
