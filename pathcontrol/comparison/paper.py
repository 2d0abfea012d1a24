"""The paper's experiments as values: task, loop, gains and start, section 5."""

from __future__ import annotations

import numpy as np

from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.projection import Projection
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.tasks.curves import Circle

RADIUS_DEG, SPEED_DEG_S = 57.3, 114.59
K_P, K_V, K = 800.0, (45.0, 100.0), 20.0
START_DEG = (40.0, 70.0)
PERIOD, DURATION = 2.5e-3, 10.0


def paper_task() -> Circle:
    """Return the circle of (9) and (10): r₀ = 57.3 deg, v₀ = 114.59 deg/s, about the origin of joint space."""
    return Circle(np.deg2rad(RADIUS_DEG), np.deg2rad(SPEED_DEG_S))


def paper_loop() -> SampledLoop:
    """Return the control computer of the arm: 2.5 ms, encoders, velocity by differentiation, torque limits."""
    return SampledLoop(period=PERIOD, encoders=True, velocity="difference", torque_limits=True)


def paper_controllers(robot: RobotModel) -> dict[str, Controller]:
    """Return both path controllers with the published gains; viscous friction compensated, Coulomb friction not."""
    task = paper_task()
    return {
        "extended_motion_plan": ExtendedMotionPlan(robot, task, K_P, K_V, K),
        "projection": Projection(robot, task, K_P, K_V),
    }
