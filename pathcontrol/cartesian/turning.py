"""The orientation of a tool that turns on its way from one orientation to another."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pathcontrol._arrays import Array
from pathcontrol.cartesian.orientation import Orientation
from pathcontrol.toolpaths.curve import ToolCurve


class TurningOrientation(Orientation):
    """A turn from one rotation to another about one axis, with gentle ends: twice continuously differentiable.

    Args:
        first: rotation matrix at the beginning of the curve, (3, 3).
        last: rotation matrix at its end, (3, 3).
    """

    def __init__(self, first: Array, last: Array) -> None:
        self._slerp = Slerp([0.0, 1.0], Rotation.from_matrix([first, last]))

    def frames(self, curve: ToolCurve, s: Array) -> Array:
        u = np.clip((np.asarray(s) - curve.s0) / curve.length, 0.0, 1.0)
        return self._slerp(np.clip(u**3 * (10 - 15 * u + 6 * u**2), 0.0, 1.0)).as_matrix()
