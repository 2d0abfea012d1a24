"""Deburring a bracket from its DXF on a UR5: the outline and the holes, the tool pointing down, lifted in between.

Simulated is an arm with friction that the law compensates in part only. Needs the extra `robots`.
Usage: python examples/deburr_bracket.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
bracket = Path(__file__).parent / "drawings" / "bracket.dxf"
drawing = pc.read_toolpath(bracket, layers=["OUTLINE", "HOLES"], feed=0.03)

robot = pc.load_robot("ur5").with_payload(1.2, frame="tool0", com=[0.0, 0.0, 0.06])
robot = robot.with_frame("tip", parent="tool0", pose=[0.0, 0.0, 0.15])
table = np.eye(4)
table[:3, 3] = [0.4, -0.1, 0.1]
ready = [0.0, -1.2, 1.8, -2.1, -1.6, 0.0]
task = pc.ToolpathTask(robot, "tip", drawing, table, orientation="down", start=ready, clearance=0.02)

known = pc.Viscous(np.full(6, 0.5)) + pc.Coulomb([6.0, 6.0, 4.0, 1.0, 1.0, 1.0])
actual = pc.Viscous(np.full(6, 0.6)) + pc.Coulomb([7.0, 7.0, 4.5, 1.1, 1.1, 1.1])
model, plant = robot.with_friction(known), robot.with_friction(actual)
laws = [pc.ExtendedMotionPlan(model, path, K_p=1600.0, K_v=80.0, k=0.5, friction="full") for path in task]
loop = pc.SampledLoop(period=4e-3, torque_limits=True)
run = pc.simulate_sequence(laws, task.q_d(np.array(0.0)), task=task, duration=60.0, plant=plant, loop=loop)

numbers = pc.toolpath_metrics(run)
print(f"{len(drawing)} contours, {run.status[0]} after {numbers['path_time'][0]:.1f} s")
print(f"largest distance from the drawing: {1e6 * numbers['tool_deviation_peak'][0]:.0f} µm")
pc.save_figure(pc.deviation_figure(run, plant, task), out / "deburr_bracket")
pc.record(run, plant, task=task, tool="tip").save(out / "deburr_bracket.html")
