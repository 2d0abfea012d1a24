"""Positions and roll, pitch and yaw of an experiment file as poses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ExperimentError
from pathcontrol.robot.rotations import rotation_of_rpy


def pose_of(key: str, arguments: Mapping[str, Any]) -> Array:
    """Return the transform (4, 4) of ``position`` [m] and ``rpy`` [rad], turned about fixed x, then y, then z.

    Raises:
        ExperimentError: one of them is not three numbers.
    """
    given = {name: arguments.get(name, [0.0, 0.0, 0.0]) for name in ("position", "rpy")}
    for name, value in given.items():
        if len(value) != 3:
            raise ExperimentError(
                f"{key}.{name} = {value}, expected three numbers", argument=f"{key}.{name}", value=value
            )
    pose = np.eye(4)
    pose[:3, :3] = rotation_of_rpy(given["rpy"])
    pose[:3, 3] = given["position"]
    return pose
