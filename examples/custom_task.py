"""A task of one's own: a rounded triangle, slower in its corners.

Usage: python examples/custom_task.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc


class RoundedTriangle(pc.PathTask):
    """Derivatives and the projection are left to the library."""

    period = 2 * np.pi

    def __init__(self, size, rate):
        self.size, self.rate = size, rate

    def q_d(self, s):
        radius = self.size * (1 - 0.12 * np.cos(3 * s))
        return np.stack([radius * np.cos(s), radius * np.sin(s)], axis=-1)

    def theta(self, s):
        return self.rate * (1 + 0.5 * np.cos(3 * s))


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
    robot = pc.load_robot("cicese_2dof")
    task = RoundedTriangle(size=0.9, rate=1.5)
    controller = pc.Projection(robot, task, k_p=800.0, K_v=[45.0, 100.0])
    run = pc.simulate(controller, q=[0.3, 0.2], duration=10.0, loop=pc.SampledLoop(torque_limits=True))
    print(
        f"largest contour error in steady state: {np.rad2deg(pc.metrics(run, task)['contour_error_peak'][0]):.2f} deg"
    )
    pc.save_figure(pc.path_figure(run, task), out / "custom_task")
    pc.record(run, robot, task=task).save(out / "custom_task.html")
