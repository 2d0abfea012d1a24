"""The side of a singularity on which a posture is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array


class Branch(NamedTuple):
    """Bases of the ranges of ∂f/∂q and of its transpose at postures, paired by a singular value decomposition.

    Where ∂f/∂q is square, det U det V is the sign of its determinant, which changes where the arm passes a singularity,
    such as a straight elbow. Bases of rank r say the same where there are more joints or more rows than that.

    Attributes:
        left: U, (N, m, r).
        right: Vᵀ, (N, r, n).
    """

    left: Array
    right: Array

    def rows(self, chosen: Array) -> Branch:
        """Return the branch of the ``chosen`` postures."""
        return Branch(self.left[chosen], self.right[chosen])

    def differs(self, other: Branch) -> Array:
        """Return whether a singularity lies between these postures and others next to them, (N,)."""
        turned = np.linalg.det(self.left.swapaxes(1, 2) @ other.left)
        return np.asarray(turned * np.linalg.det(self.right @ other.right.swapaxes(1, 2)) < 0)
