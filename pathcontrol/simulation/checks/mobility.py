"""The mobility of the joints of an arm, over many postures."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from pathcontrol._arrays import Array, freeze
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel

_POSTURES = 32
_KNOWN: WeakKeyDictionary[RobotModel, Array] = WeakKeyDictionary()


def mobility(robot: RobotModel | RobotBatch) -> Array:
    """Return the diagonal of M(q)⁻¹ [1/(kg m²)] at postures q spread over the joint ranges, (postures, N or 1, n).

    Its entries are the accelerations of each joint for a torque of its own, with the other joints free.
    """
    if isinstance(robot, RobotBatch):
        return np.concatenate([mobility(body) for body in robot.bodies], axis=1)[:, robot.body]
    if robot not in _KNOWN:
        _KNOWN[robot] = freeze(_mobility(robot))
    return _KNOWN[robot]


def _mobility(robot: RobotModel) -> Array:
    """Return the mobility of one arm, (postures, 1, n)."""
    lower, upper = robot.limits.lower, robot.limits.upper
    span = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSTURES, robot.n))
    try:
        inverse = np.linalg.inv(robot.mass_matrix(np.clip(span, lower, upper)))
    except np.linalg.LinAlgError:  # an arm without masses, whose mobility is unknown
        return np.zeros((_POSTURES, 1, robot.n))
    return np.diagonal(inverse, axis1=-2, axis2=-1)[:, None]
