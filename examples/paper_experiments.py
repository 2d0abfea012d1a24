"""The paper's two experiments, step by step: run, measure, draw, animate.

`pathcontrol reproduce` does the same in one command. Usage: python examples/paper_experiments.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")

robot = pc.load_robot("cicese_2dof")
task = pc.Circle(radius=np.deg2rad(57.3), speed=np.deg2rad(114.59))
loop = pc.SampledLoop(period=2.5e-3, encoders=True, velocity="difference", torque_limits=True)
controllers = {
    "extended_motion_plan": pc.ExtendedMotionPlan(robot, task, K_p=800.0, K_v=[45.0, 100.0], k=20.0),
    "projection": pc.Projection(robot, task, k_p=800.0, K_v=[45.0, 100.0]),
}

for name, controller in controllers.items():
    run = pc.simulate(controller, np.deg2rad([40.0, 70.0]), duration=10.0, loop=loop)
    late = pc.steady_state(run)
    e_p, e_v = (np.rad2deg(pc.peak(late.norm(error))[0]) for error in ("e_p", "e_v"))
    print(f"{name}: steady-state peaks ‖e_p‖ = {e_p:.2f} deg, ‖e_v‖ = {e_v:.1f} deg/s")
    pc.save_figure(pc.path_figure(run, task), out / f"{name}-path")
    pc.save_figure(pc.error_figure(run), out / f"{name}-errors")
    pc.record(run, robot, task=task).save(out / f"{name}.html")
