"""Laws for arms that are stepped by hand, and bad measurements of them."""

from functools import cache

import numpy as np

import pathcontrol as pc
from pathcontrol.simulation.compiled_plant import CompiledPlant

H = 2e-3
#: an envelope that lets everything through
WIDE = {"torque": 1e6, "torque_rate": 1e12, "velocity": 1e3, "lower": -1e3, "upper": 1e3, "tube": np.inf}

#: what a measurement (q, q̇, t) is turned into
BAD = {
    "not a number": lambda q, qd, t: (q * np.nan, qd, t),
    "infinite": lambda q, qd, t: (q, qd + np.inf, t),
    "no array": lambda q, qd, t: (None, qd, t),
    "a word": lambda q, qd, t: ("lost", qd, t),
    "another shape": lambda q, qd, t: (q[:1], qd, t),
    "no time": lambda q, qd, t: (q, qd, np.nan),
    "old": lambda q, qd, t: (q, qd, t - 10 * H),
    "a jump": lambda q, qd, t: (q + 1.0, qd, t),
}


def arm_of(n):
    if n == 2:
        return pc.load_robot("cicese_2dof"), [0.2, 0.4], 0.3
    if n == 6:
        return pc.load_robot("ur5"), [0.0, -1.2, 1.4, -0.2, 1.5, 0.0], 0.2
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return pc.load_robot("panda", lock=fingers), [0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.8], 0.2


@cache
def arm_and_path(n):
    robot, center, size = arm_of(n)
    return robot, pc.Lissajous(np.full(n, size), list(range(1, n + 1)), 0.5, center=center)


def law_of(n, kind=pc.Projection):
    robot, task = arm_and_path(n)
    if kind is pc.Projection:
        return pc.Projection(robot, task, k_p=400.0, K_v=40.0)
    if kind is pc.ExtendedMotionPlan:
        return pc.ExtendedMotionPlan(robot, task, K_p=400.0, K_v=40.0, k=5.0)
    return pc.ComputedTorque(robot, task, K_p=400.0, K_v=40.0)


class Simulated:
    """The arm of a law, stepped by hand, with what it did."""

    def __init__(self, law):
        self.plant = CompiledPlant(law.robot, H)
        self.q = np.asarray(law.task.q_d(np.array(law.task.s0)), float).reshape(1, -1)
        self.qd, self.t = np.zeros_like(self.q), 0.0

    def drive(self, loop, ticks, fault=None):
        """Take ticks; ``fault`` changes what is measured, (q, qd, t) of a tick."""
        kind = [("q", float, self.q.shape[1:]), ("qd", float, self.q.shape[1:]), ("tau", float, self.q.shape[1:])]
        done = np.empty(ticks, dtype=kind)
        for k in range(ticks):
            measured = self.q[0].copy(), self.qd[0].copy(), self.t
            tau = loop.step(*(measured if fault is None else fault(k, *measured)))
            done[k] = self.q[0], self.qd[0], tau
            self.q, self.qd = self.plant.advance(self.q, self.qd, tau[None])
            self.t += H
        return done
