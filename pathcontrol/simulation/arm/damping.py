"""Viscous friction over one step, condensed into an inertia matrix: of third order, and damped where it is stiff.

Under a constant r the velocity of M v̇ = r − B(v − v₀), B = diag(b), changes in h by

    Δv = h M̃⁻¹r,    M̃ = M ψ(hM⁻¹B),    ψ(x) = x/(1 − e⁻ˣ) = x/2 + E(x),    E(x) = (x/2) coth(x/2),

at the mean velocity v₀ + Δv/2 + XBΔv/h, where M̃ = M + hB/2 + BXB. M̃ is symmetric and positive definite; the trapezoidal
rule is E = 1. Here E is that of four steps of h/4 with the Radau IIA method of third order, whose stability function is
Padé's (1, 2) of e⁻ˣ: its E is the first of these, and twice the step is the second,

    E(x) ≈ 1 + (x/2)²/(3 + x/2),        E(2x) = E(x) + (x/2)²/E(x).

The effect of B on v, 1 − e⁻ˣ, is reproduced to 0.09 % for all x ≥ 0, and stiff modes are damped: the share R(x) of a
velocity that is left after a step is between 0 and 1, and tends to 0 as x⁻⁴.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array


class Damping:
    """The viscous friction of one step.

    Args:
        viscous: b [N m s/rad], (N, n) or (1, n).
        step: h [s].
    """

    def __init__(self, viscous: Array, step: float) -> None:
        self._one = np.eye(viscous.shape[-1], dtype=bool)
        eighth = 0.125 * step * viscous
        self._pairs = eighth[:, :, None] * eighth[:, None, :]
        self._eighth, self._half = (np.where(self._one, factor * eighth[:, None], 0.0) for factor in (1.0, 4.0))
        self._travel = 0.125 * eighth[:, None]

    def condense(self, M: Array, moving: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Condense viscous friction into the inertia matrix.

        Joints that do not move are condensed each for itself: one that dry friction holds does not creep then, and the
        others move as if it were locked.

        Args:
            M: inertia matrices [kg m²], (N, n, n).
            moving: which joints move, or are free to, (N, n).

        Returns:
            M̃ [kg m²], (N, n, n), and XB/h, (N, n, n).
        """
        alone = M if moving.all() else np.where(moving[:, :, None] & moving[:, None, :] | self._one, M, 0.0)
        first = np.linalg.inv(3.0 * alone + self._eighth)
        E = alone + self._pairs * first
        second = np.linalg.inv(E)
        third = np.linalg.inv(E + self._pairs * second)
        X = first + second + 4.0 * third  # X of h/8 rather than of 1
        return M + self._half + self._pairs * X, self._travel * X
