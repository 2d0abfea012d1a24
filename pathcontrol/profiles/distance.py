"""The distance that the arm, or a tool, has covered along a path."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pathcontrol._arrays import Array
from pathcontrol.profiles.motion import Motion
from pathcontrol.tasks.profile import Path

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def distance(path: Path, motion: Motion, s: Array) -> CubicHermiteSpline:
    """Return ∫‖p'‖ds from s[0], of a motion p(s), as a cubic spline through its values at the increasing s (m,).

    Four Gauss points a cell; value and slope are right at every knot, to the 8th and the machine's order, and the value
    between them to the 4th.
    """
    half = 0.5 * np.diff(s)[:, None]
    inside = s[:-1, None] + half * (1 + _NODES)
    cells = (motion.stretch(path, inside)[0] * half) @ _WEIGHTS
    return CubicHermiteSpline(s, np.append(0.0, np.cumsum(cells)), motion.stretch(path, s)[0])
