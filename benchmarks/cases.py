"""What is simulated: the paper's first experiment, and an arm of seven joints."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol import Coulomb, ExtendedMotionPlan, Lissajous, PathTask, RobotModel, SampledLoop, Viscous, load_robot
from pathcontrol.comparison.paper import K_P, K_V, START_DEG, K, paper_loop, paper_task

FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}


class Case(NamedTuple):
    """One experiment with the extended motion plan.

    Attributes:
        robot: the arm, which the law knows exactly; only its viscous friction is compensated.
        task: where and how fast.
        gains: K_p, K_v and k.
        loop: the control computer.
        start: posture of the single rollout [rad], (n,), which begins at rest.
    """

    robot: RobotModel
    task: PathTask
    gains: tuple[float, NDArray, float]
    loop: SampledLoop
    start: NDArray

    def law(self, threads: int = 1) -> ExtendedMotionPlan:
        """The law, whose model and plant use so many threads."""
        return ExtendedMotionPlan(self.robot.with_threads(threads), self.task, *self.gains, start="nearest")

    def states(self, rollouts: int) -> tuple[NDArray, NDArray]:
        """Initial postures and velocities, (rollouts, n): in motion, near the path, spread all along it.

        So that a short run is as a long one is on the average: at the experiment's own start the torques saturate and
        the joints stick far more often than later, which would flatter whoever does that better.
        """
        rng = np.random.default_rng(0)
        s = rng.uniform(self.task.s0, self.task.s0 + self.task.period, rollouts)
        point = self.task.at(s)
        return point.q_d + rng.normal(0.0, 0.01, point.q_d.shape), point.velocity


def paper() -> Case:
    """2.5 ms hold, encoders, velocity by differentiation, stiction, viscous and Coulomb friction, torque limits."""
    gains = (K_P, np.array(K_V), K)
    return Case(load_robot("cicese_2dof"), paper_task(), gains, paper_loop(), np.deg2rad(START_DEG))


def seven_joints() -> Case:
    """A Panda with its fingers locked; all joints swing, stick and turn back. The loop is that of the paper."""
    friction = Viscous(np.full(7, 0.5)) + Coulomb([0.6, 0.6, 0.5, 0.5, 0.3, 0.3, 0.3])
    robot = load_robot("panda", lock=FINGERS).with_friction(friction)
    middle, swing = [0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.8], [0.4, 0.3, 0.4, 0.3, 0.4, 0.3, 0.4]
    task = Lissajous(swing, [1, 2, 2, 1, 1, 2, 1], 0.8, phases=[0, 1, 2, 3, 4, 5, 6], center=middle)
    loop = SampledLoop(encoders=np.full(7, 2.0**20), velocity="difference", torque_limits=True)
    return Case(robot, task, (1600.0, np.full(7, 80.0), 2.0), loop, task.q_d(np.array(0.0)))
