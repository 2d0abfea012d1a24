"""The S-curve: a jerk-limited rise of a speed, over the distance covered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.tasks.profile import END_TIME


@dataclass(frozen=True)
class SCurve:
    """The quickest rise from the speed v₀ > 0 to V with v̇ ≤ a and |v̈| ≤ j, from and to v̇ = 0.

    In time: jerk j for t₁, acceleration jt₁ ≤ a for t₂, jerk −j for t₁, with t₁ = min(√((V − v₀)/j), a/j) and
    t₂ = max((V − v₀)/a − a/j, 0). The length is ½(v₀ + V)(2t₁ + t₂), since v(t) is symmetric about its middle.

    Attributes:
        first: v₀ [m/s or rad/s], as all that follow.
        last: V ≥ v₀; an array only to ask for lengths.
        acceleration: a.
        jerk: j.
    """

    first: float | Array
    last: float | Array
    acceleration: float
    jerk: float | Array

    @property
    def length(self) -> Array:
        """The distance over which the speed rises."""
        t_1, t_2 = self._durations
        return 0.5 * (self.first + self.last) * (2 * t_1 + t_2)

    def speed(self, distance: Array) -> tuple[Array, Array]:
        """Return v and dv/dd after a ``distance`` d ≥ 0 (*batch,); V and 0 beyond the length.

        The first phase covers v₀t + jt³/6 in the time t, the last one Vt − jt³/6 in the time t that is left: two cubics
        with one real root in their phase, 2c sinh(⅓ asinh(3d/(2v₀c))), c² = 2v₀/j, and the same with sines.
        """
        t_1, j = self._durations[0], self.jerk
        rise, fall = self.first * t_1 + j * t_1**3 / 6, self.last * t_1 - j * t_1**3 / 6
        left = self.length - distance
        c_0, c_1 = np.sqrt(2 * self.first / j), np.sqrt(2 * self.last / j)
        t = 2 * c_0 * np.sinh(np.arcsinh(1.5 * np.clip(distance, 0.0, rise) / (self.first * c_0)) / 3)
        to_go = 2 * c_1 * np.sin(np.arcsin(1.5 * np.clip(left, 0.0, fall) / (self.last * c_1)) / 3)
        middle = (self.first + 0.5 * j * t_1**2) ** 2 + 2 * j * t_1 * np.maximum(distance - rise, 0.0)
        rises, falls = distance < rise, left <= fall
        slower = np.where(falls, self.last - 0.5 * j * to_go**2, np.sqrt(middle))
        v = np.where(rises, self.first + 0.5 * j * t**2, slower)
        return v, np.where(rises, j * t, np.where(falls, j * to_go, j * t_1)) / v

    @property
    def _durations(self) -> tuple[Array, Array]:
        """The durations t₁ and t₂ [s]; both 0 where there is no rise."""
        rise = np.maximum(self.last - self.first, 0.0)
        t_1 = np.minimum(np.sqrt(rise / self.jerk), self.acceleration / self.jerk)
        return t_1, np.maximum(rise / self.acceleration - self.acceleration / self.jerk, 0.0)


@dataclass(frozen=True)
class Approach:
    """The jerk-limited fall of a speed from V to the end of a path, exponential at its end as that of the controllers.

    With T = 0.1 s and d the distance left, v = d/T has |v̇| = v/T and |v̈| = v/T². It meets the S-curve that rises from
    v₀ = jT²/2, moved by jT³/3, at d = jT³ with the same v, v̇ and v̈. For that the S-curve must not have left its first
    phase: j ≤ a/T and j ≤ V/(1.5 T²).

    Attributes:
        last: V, as in :class:`SCurve`.
        acceleration: |v̇| ≤ a.
        largest_jerk: |v̈| ≤ j.
    """

    last: float | Array
    acceleration: float
    largest_jerk: float

    @property
    def length(self) -> Array:
        """The distance over which the speed falls."""
        return self._tail / 3 + self._curve.length

    def speed(self, distance: Array) -> tuple[Array, Array]:
        """Return v and dv/dd with a ``distance`` d ≥ 0 (*batch,) left to the end."""
        v, slope = self._curve.speed(distance - self._tail / 3)
        at_last = distance < self._tail
        return np.where(at_last, distance / END_TIME, v), np.where(at_last, 1 / END_TIME, slope)

    @property
    def _jerk(self) -> Array:
        most = min(self.largest_jerk, self.acceleration / END_TIME)
        return np.minimum(most, self.last / (1.5 * END_TIME**2))

    @property
    def _tail(self) -> Array:
        return self._jerk * END_TIME**3

    @property
    def _curve(self) -> SCurve:
        return SCurve(0.5 * self._jerk * END_TIME**2, self.last, self.acceleration, self._jerk)
