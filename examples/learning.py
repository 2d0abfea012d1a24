"""The paper's experiment with projection, and with what the law learns along the path, lap by lap.

Writes a film and a figure of the errors. Usage: python examples/learning.py [folder] [laps]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
laps = int(sys.argv[2]) if len(sys.argv) > 2 else 4

robot = pc.load_robot("cicese_2dof")
task = pc.Circle(np.deg2rad(57.3), np.deg2rad(114.59))
law = pc.Projection(robot, task, 800.0, [45.0, 100.0])
loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True)

runs = {
    name: pc.simulate(one, np.deg2rad([40.0, 70.0]), laps=laps, duration=4.0 * laps + 2.0, loop=loop)
    for name, one in (("projection", law), ("learned", pc.Learned(law)))
}
errors = {name: np.rad2deg(pc.lap_errors(run)) for name, run in runs.items()}
for lap in range(laps):
    print(f"lap {lap + 1}: {errors['projection'][lap]:6.2f} deg, learned {errors['learned'][lap]:6.2f} deg")

pc.save_figure(pc.error_figure(runs["learned"]), out / "learning-errors")
pc.record(runs["learned"], robot, task=task).save(out / "learning.html")
