"""The laws of other sources with gains that mean the same as those of the known laws, compared where they are named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pathcontrol.comparison.shared_gains import Gains, mean_inertia, mean_plan_gain, split_damping
from pathcontrol.control.adaptive_slotine_li import AdaptiveSlotineLi
from pathcontrol.control.base import Controller
from pathcontrol.control.maneuver_regulation import ManeuverRegulation
from pathcontrol.control.passive_velocity_field import PassiveVelocityField
from pathcontrol.control.transverse_linearization import TransverseLinearization
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask

_ADAPTATION = 1e-3  # 1/J: more takes what a wall or a jam does to the arm for mass
_RECHARGE = 10.0  # 1/s: without it the dry friction of the arm would bring it to rest


def _adaptive_slotine_li(robot: RobotModel, task: PathTask, gains: Gains, options: Mapping[str, Any]) -> Controller:
    """Return the adaptive law with the gains of Slotine and Li's, and the plan of the extended motion plan."""
    Lambda, damping = split_damping(*(np.broadcast_to(gain, robot.n) for gain in gains[:2]))
    k = mean_plan_gain(task) if gains.k is None else gains.k
    return AdaptiveSlotineLi(robot, task, Lambda, mean_inertia(robot, task) * damping, _ADAPTATION, k, **options)


def _passive_velocity_field(robot: RobotModel, task: PathTask, gains: Gains, options: Mapping[str, Any]) -> Controller:
    """Return passive velocity field control with the poles Λ and K_v beside the path, where it can have them."""
    Lambda, K_v = split_damping(*(np.asarray(gain, dtype=np.float64).mean(keepdims=True) for gain in gains[:2]))
    return PassiveVelocityField(robot, task, Lambda.item(), K_v.item(), recharge=_RECHARGE, **options)


def _transverse_linearization(
    robot: RobotModel, task: PathTask, gains: Gains, options: Mapping[str, Any]
) -> Controller:
    """Return transverse feedback linearisation with the poles of the others, of the mean gains of all joints."""
    k_p, k_v = (float(np.asarray(gain, dtype=np.float64).mean()) for gain in gains[:2])
    return TransverseLinearization(robot, task, k_p, k_v, k_s=k_v, **options)


def _maneuver_regulation(robot: RobotModel, task: PathTask, gains: Gains, options: Mapping[str, Any]) -> Controller:
    """Return maneuver regulation with the gains of computed torque."""
    return ManeuverRegulation(robot, task, gains.K_p, gains.K_v, **options)


#: how each law is made, by its name; the last argument are ``friction``, ``start`` and ``observer_hz`` of all laws
FAMILY: dict[str, Callable[[RobotModel, PathTask, Gains, Mapping[str, Any]], Controller]] = {
    "adaptive_slotine_li": _adaptive_slotine_li,
    "passive_velocity_field": _passive_velocity_field,
    "transverse_linearization": _transverse_linearization,
    "maneuver_regulation": _maneuver_regulation,
}
