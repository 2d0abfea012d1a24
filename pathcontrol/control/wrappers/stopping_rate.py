"""The rate at which motors can stop a plan, and let it go on, anywhere on its path."""

from __future__ import annotations

import numpy as np

from pathcontrol.control.wrappers.pace_rule import rate_bounds
from pathcontrol.robot.friction import viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint, Task

_LEAST, _MOST = 2.0, 10.0  # 1/s: from full speed to rest in a half, and in a tenth of a second
_MARGIN = 0.1  # share of the torque limits that is left to feedback, as that of a pace
_FACTORS = np.linspace(0.0, 1.0, 5)
_SAMPLES, _FEWEST, _ALL = 129, 3, 1 << 16  # of a path, and of all paths of a batch together


def stopping_rate(robot: RobotModel, task: Task) -> float:
    """Return the largest |ẇ| [1/s], from 2 to 10, with which a plan can stop and go on within 90 % of torque limits.

    At a factor w of the speed of the profile, with r = q_d'ϑ, motion along the path asks for
    τ = M(q)[w²r'ϑ + ẇr] + C(q,wr)wr + g(q) + F_v wr, at all samples of the path and of 0 ≤ w ≤ 1. The rate is 2 also
    where the motion itself needs what the motors have.
    """
    tasks = 1 if task.rollouts is None else task.rollouts
    lower, upper = (np.broadcast_to(end, () if task.rollouts is None else tasks) for end in task.sampled_interval)
    point = task.at(np.linspace(lower, upper, int(np.clip(_ALL // tasks, _FEWEST, _SAMPLES))))
    rate = min(_rate_at(robot, point, w) for w in _FACTORS)
    return float(np.clip(rate, _LEAST, _MOST))


def _rate_at(robot: RobotModel, point: PathPoint, w: float) -> float:
    """Return the largest |ẇ| [1/s] that torque limits allow at all of some points at the factor ``w``."""
    velocity = w * point.velocity
    acceleration = w**2 * point.velocity_slope * point.theta[..., None]
    tau = robot.inverse_dynamics(point.q_d, velocity, acceleration) + viscous_of(robot.friction) * velocity
    gradient = robot.momentum(point.q_d, point.velocity)
    least, most = rate_bounds(tau, gradient, (1 - _MARGIN) * robot.limits.effort)
    return float(np.minimum(-least, most).min())
