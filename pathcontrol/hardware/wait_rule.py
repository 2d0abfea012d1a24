"""The pace of a plan that waits for an arm which does not do what it was told."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.speed_rule import Moment, Speed, SpeedRule

_APPROACH = 0.03  # s, time constant with which the factor comes to the one that is wanted
_LEAST = 1e-4  # of the speed: a plan that waits is not held, so that it can go back to where the arm is


class WaitRule(SpeedRule):
    """The factor of the speed falls to 0 as the arm deviates by a ``tolerance`` from what it was told to do.

    It is that which is asked for while the deviation ‖d‖ is below half of the tolerance, and then falls linearly.

    Args:
        tolerance: ‖d‖ [rad] at which the plan rests.

    Attributes:
        deviation: ‖d‖ [rad] at present.
    """

    relative = True

    def __init__(self, tolerance: float) -> None:
        self.tolerance, self.deviation = tolerance, 0.0

    def start(self, law: Controller, q: Array, qd: Array, s: Array) -> Array:
        return np.ones((*s.shape, 1))

    def rate(self, moment: Moment, asked: Speed, x: Array) -> Array:
        share = min(max(2.0 - 2.0 * self.deviation / self.tolerance, _LEAST), 1.0)
        return np.asarray(share * asked.rate + (share * asked.factor - x[..., 0]) / _APPROACH)

    def describe(self) -> dict[str, Any]:
        return {"tolerance": self.tolerance}
