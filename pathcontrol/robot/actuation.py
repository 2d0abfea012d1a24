"""The drives and sensors of the joints: limits, friction and encoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pathcontrol._arrays import Array, freeze
from pathcontrol.robot.friction import FrictionLaw


@dataclass(frozen=True, eq=False)
class Limits:
    """Joint limits, each (n,): position [rad or m], velocity [rad/s], effort [N m]; ±inf where there is none."""

    lower: Array
    upper: Array
    velocity: Array
    effort: Array

    def select(self, joints: Sequence[int]) -> Limits:
        """Return the limits of some of the joints."""
        return Limits(*(freeze(a[list(joints)]) for a in (self.lower, self.upper, self.velocity, self.effort)))


@dataclass(frozen=True, eq=False)
class Actuation:
    """The drives and sensors of the joints: limits, friction, encoder resolution [counts/rev] or None."""

    limits: Limits
    friction: FrictionLaw
    encoder_counts: Array | None = None

    def select(self, joints: Sequence[int]) -> Actuation:
        """Return the actuation of some of the joints."""
        counts = None if self.encoder_counts is None else freeze(self.encoder_counts[list(joints)])
        return Actuation(self.limits.select(joints), self.friction.select(joints), counts)
