"""The same controllers on a 6-joint arm: a UR5 draws a circle with two joints while the others hold still.

Needs the extra `robots`. Usage: python examples/six_joints.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")

robot = pc.load_robot("ur5").with_friction(pc.Viscous(np.full(6, 0.5)) + pc.Coulomb([8.0, 8.0, 5.0, 1.0, 1.0, 1.0]))
home = np.array([0.0, -1.2, 1.2, -1.0, -1.5, 0.0])
task = pc.Circle(radius=0.3, speed=0.6, center=home, joints=(0, 1))
controller = pc.ExtendedMotionPlan(robot, task, K_p=400.0, K_v=40.0, k=20.0)

run = pc.simulate(controller, home, duration=6.0, loop=pc.SampledLoop(period=2e-3, torque_limits=True))
print(f"largest ‖e_p‖ in steady state: {np.rad2deg(pc.metrics(run, task)['e_p_peak'][0]):.2f} deg")
pc.save_figure(pc.torque_figure(run, robot.limits.effort), out / "six_joints-torque")
pc.record(run, robot, task=task, tool="tool0").save(out / "six_joints.html")
