"""An operator holds a plan, turns it down and sends it back, and the arm stays on its path.

Writes a film and a figure of the speed. Usage: python examples/operators_override.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")

robot = pc.load_robot("cicese_2dof")
task = pc.Circle(radius=1.0, speed=2.0)
law = pc.ExtendedMotionPlan(robot, task, K_p=800.0, K_v=[45.0, 100.0], k=20.0)
operator = pc.SpeedOverride(law, [[2.0, 0.0], [3.5, 0.5], [5.0, 2.0], [6.5, -1.0]])  # hold, slow, fast, back
loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True)

run = pc.simulate(operator, task.q_d(np.array(0.0)), duration=9.0, loop=loop)

speed, contour = pc.speed_factor(run)[0], np.rad2deg(pc.contour_error(run)[0])
for time in (1.9, 3.4, 4.9, 6.4, 8.9):
    until = run.time <= time
    print(f"{time:.1f} s: w = {speed[until][-1]:5.2f}, largest contour error so far {contour[until].max():.2f} deg")

pc.save_figure(pc.speed_figure(run), out / "operators_override-speed")
pc.record(run, robot, task=task).save(out / "operators_override.html")
