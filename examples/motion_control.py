"""The same circle under motion control and under path control, when the arm starts away from the path.

The timed reference does not wait: the motion controllers cut across to catch up with it. The path controllers go to
the path and take it from there. Usage: python examples/motion_control.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")

robot = pc.load_robot("cicese_2dof")
task = pc.Circle(radius=1.0, speed=2.0)
start = task.q_d(np.array(-1.5))  # on the path, but where the clock says it should have been 0.75 s ago

controllers = {
    "computed torque": pc.ComputedTorque(robot, task, K_p=100.0, K_v=20.0),
    "PD+": pc.PDPlus(robot, task, K_p=[200.0, 20.0], K_v=[40.0, 4.0]),
    "Slotine-Li": pc.SlotineLi(robot, task, Lambda=10.0, K_d=[40.0, 4.0]),
    "extended motion plan": pc.ExtendedMotionPlan(robot, task, K_p=100.0, K_v=20.0, k=20.0),
    "projection": pc.Projection(robot, task, k_p=100.0, K_v=20.0),
}

runs = {}
print(f"{'':22}largest contour error [deg]")
for name, controller in controllers.items():
    run = runs[name] = pc.simulate(controller, start, duration=5.0, loop=pc.SampledLoop(torque_limits=True))
    contour = np.rad2deg(pc.contour_error(run, task).max())
    print(f"{name:22}{contour:8.2f}")
    pc.save_figure(pc.path_figure(run, task), out / f"motion_control-{name.replace(' ', '_')}")

two = {name: runs[name] for name in ("computed torque", "extended motion plan")}
pc.record(two).save(out / "side_by_side.html")
pc.record(two, layout="ghosted").save(out / "ghosts.html")
