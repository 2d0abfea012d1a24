"""Limits on the speed and the acceleration of the joints or of a tool along a path."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.errors import InputError
from pathcontrol.profiles.motion import JointMotion, Motion, ToolMotion, growth
from pathcontrol.robot.extent import question_speed


@dataclass(frozen=True)
class MotionLimit:
    """A limit on the motion p(s) along a path; lengths are in [rad] for the joints, in [m] for a tool.

    With v = ‖p'‖ϑ the speed and κ the curvature of p, the acceleration has the parts v̇ along the path and κv² across.
    The arc vT of one control period T leaves its chord by κ(vT)²/8 at most, so that a chord error ε allows
    v ≤ √(8ε/κ)/T (Yeh and Hsu, Computer-Aided Design 34, 2002): an acceleration of 8ε/T² across the path.

    Args:
        motion: whose motion is limited, the joints' or a tool's.
        speed: v ≤ ``speed`` [1/s].
        tangential: |v̇| ≤ ``tangential`` [1/s²].
        normal: κv² ≤ ``normal`` [1/s²].
        chord_error: κ(vT)²/8 ≤ ``chord_error``.
        control_period: T [s].
    """

    motion: Motion = field(default_factory=JointMotion)
    speed: float | None = None
    tangential: float | None = None
    normal: float | None = None
    chord_error: float | None = None
    control_period: float = 2.5e-3

    def __post_init__(self) -> None:
        names = ("speed", "tangential", "normal", "chord_error")
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        if not given:
            raise InputError(f"this MotionLimit limits nothing; give at least one of {', '.join(names)}", choices=names)
        for name, value in {**given, "control_period": self.control_period}.items():
            as_scalar(name, value, positive=True)
        if isinstance(self.motion, ToolMotion) and self.speed is not None:
            question_speed("the speed of the tool", self.speed, self.motion.robot, self.motion.frame)

    def ceiling(self, dp: Array, ddp: Array) -> Array:
        """Return the largest ϑ² [1/s²] for the limits of speed and curvature, given p' and p'', (*batch,)."""
        across = np.linalg.norm(ddp - growth(dp, ddp)[..., None] * dp, axis=-1)
        with np.errstate(divide="ignore"):
            by_speed = np.inf if self.speed is None else self.speed**2 / (dp * dp).sum(-1)
            return np.minimum(by_speed, self._largest_normal / across)

    @property
    def _largest_normal(self) -> float:
        by_chord = np.inf if self.chord_error is None else 8 * self.chord_error / self.control_period**2
        return min(np.inf if self.normal is None else self.normal, by_chord)
