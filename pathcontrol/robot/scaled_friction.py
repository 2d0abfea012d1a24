"""Friction of which each joint has a share, or a multiple."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.friction import FrictionLaw, levels_of, viscous_of


@dataclass(frozen=True, eq=False)
class ScaledFriction(FrictionLaw):
    """The friction of another law times a factor for each joint: f(q̇) = factor · f_law(q̇).

    Attributes:
        law: the other law.
        factor: factors ≥ 0, (n,), or for each rollout, (N, n).
    """

    law: FrictionLaw
    factor: Array

    @property
    def n(self) -> int:
        return self.law.n

    @property
    def viscous(self) -> Array:
        return np.asarray(self.factor * viscous_of(self.law))

    def levels(self, qd: Array) -> tuple[Array, Array]:
        plus, minus = levels_of(self.law, qd)
        return self.factor * plus, self.factor * minus

    def select(self, joints: Sequence[int]) -> Self:
        return type(self)(self.law.select(joints), self.factor[..., list(joints)])

    def describe(self) -> dict[str, object]:
        return {"law": "ScaledFriction", "of": self.law.describe(), "factor": np.asarray(self.factor).tolist()}
