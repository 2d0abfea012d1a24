"""Periods that are too long for the gains of a law, told before a run."""

from __future__ import annotations

import warnings

import numpy as np

from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.motion import ComputedTorque
from pathcontrol.control.projection import Projection
from pathcontrol.errors import PathControlWarning


def warn_of_period(controller: Controller, period: float) -> None:
    """Warn where the loop of ``period`` h [s] cannot be stable with the gains of ``controller``.

    Laws that make an error obey ë + K_v ė + K_p e = 0 in continuous time have, with their torque held for h, the
    characteristic polynomial z² − (2 − K_v h − K_p h²/2) z + 1 − K_v h + K_p h²/2, which is stable (Jury) where
    K_v h < 2 and K_p h < 2 K_v.
    """
    if not isinstance(controller, ComputedTorque | ExtendedMotionPlan | Projection):
        return
    K_v = np.asarray(controller.K_v)
    K_p = np.asarray(controller.k_p if isinstance(controller, Projection) else controller.K_p)
    longest = min(float((2 / K_v).min()), float((2 * K_v / K_p).min()))
    if period >= longest:
        warnings.warn(
            f"gains K_p up to {K_p.max():g} 1/s² and K_v up to {K_v.max():g} 1/s need a period below {longest:.3g} s, "
            f"the loop has {period:g} s and is likely to be unstable; shorten the period (more substeps do not help), "
            "or change the gains so that K_v h < 2 and K_p h < 2 K_v",
            PathControlWarning,
            stacklevel=3,
        )
