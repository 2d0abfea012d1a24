"""Motors that are weak for a while."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_finite, freeze
from pathcontrol.arguments import Form
from pathcontrol.errors import InputError
from pathcontrol.simulation.arm.disturbance import Begin, Span, TimedDisturbance, check_rollouts, no_torques


class TorqueLimitDrop(TimedDisturbance):
    """Motors that have only a share of their torque limits for a while: hot, or at a sagging supply.

    What acts is limited anew in the periods of the loop whose middle the time covers, whenever it was asked for. It
    needs torque limits, ``SampledLoop(torque_limits=…)``; the law knows nothing of it.

    Args:
        factor: what each motor still has of its limit, from 0 to 1: one number, (n,), or for each rollout, (N, n) or
            (N, 1).
        start: when it begins [s], or for each rollout, (N,).
        duration: how long it lasts [s], or for each rollout, (N,).

    Raises:
        InputError: a factor is not from 0 to 1, or a time is no number.
    """

    def __init__(self, factor: Annotated[ArrayLike, Form.GAIN], start: Begin = 0.0, duration: Span = np.inf) -> None:
        super().__init__(start, duration)
        self.factor = freeze(check_finite("factor", as_array("factor", factor)))
        if not ((self.factor >= 0) & (self.factor <= 1)).all():
            raise InputError(
                f"factor = {self.factor.tolist()}, expected numbers from 0 to 1",
                argument="factor",
                value=self.factor,
                limit=(0.0, 1.0),
            )
        check_rollouts(start=self.start.shape, duration=self.duration.shape, factor=self.factor.shape[:-1])

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        """Return zeros: it takes torque away and adds none."""
        return no_torques(q, self.share(t), self.factor)

    def torque_factor(self, t: float | Array) -> Array:
        return np.where(self.share(t) > 0, self.factor, 1.0)
