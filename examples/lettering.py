"""Lettering from an SVG: the two-joint arm of the paper writes "path" on a board, stroke by stroke.

The drawing stands upright in the arm's plane. The tool's distance from it is measured against the curves of the file.
Usage: python examples/lettering.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
drawing = pc.read_toolpath(Path(__file__).parent / "drawings" / "lettering.svg", feed=0.1)

robot = pc.load_robot("cicese_2dof")
board = np.array([[1, 0, 0, 0.25], [0, 0, -1, -0.05], [0, 1, 0, 0.65], [0, 0, 0, 1.0]])  # its x and y along x and z
task = pc.ToolpathTask(robot, "tool", drawing, board, clearance=0.0, rapid_speed=0.2)

# dry friction holds a slow arm: the laws compensate all of it. The plan is in no hurry to wait: with velocities by
# differences these loops bear k = 1.6
laws = [pc.ExtendedMotionPlan(robot, path, K_p=800.0, K_v=45.0, k=1.5, friction="full") for path in task]
loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True)
run = pc.simulate_sequence(laws, task.q_d(np.array(0.0)), task=task, duration=20.0, loop=loop)

numbers = pc.toolpath_metrics(run)
print(f"{len(drawing)} strokes, {run.status[0]} after {numbers['path_time'][0]:.1f} s")
print(f"largest distance from the drawing: {1e6 * numbers['tool_deviation_peak'][0]:.0f} µm")
pc.save_figure(pc.deviation_figure(run, robot, task), out / "lettering")
pc.record(run, robot, task=task, tool="tool").save(out / "lettering.html")
