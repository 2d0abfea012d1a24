"""A G-code pocket on a 7-joint arm: feeds, rapids and plunges of the program, the spindle pointing down.

Simulated is an arm with a heavier spindle than the law knows of, and with friction. Needs the extra `robots`.
Usage: python examples/mill_pocket.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
program = pc.read_toolpath(Path(__file__).parent / "drawings" / "pocket.ngc")

robot = pc.load_robot("panda", lock={"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0})
robot = robot.with_payload(1.0, frame="panda_link8", com=[0.0, 0.0, 0.05])
robot = robot.with_frame("cutter", parent="panda_link8", pose=[0.0, 0.0, 0.12])
table = np.eye(4)
table[:3, 3] = [0.5, 0.0, 0.15]
ready = [0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.8]
task = pc.ToolpathTask(robot, "cutter", program, table, orientation="down", start=ready)

friction = pc.Viscous(np.full(7, 0.5)) + pc.Coulomb([0.6, 0.6, 0.5, 0.5, 0.3, 0.3, 0.3])
plant = robot.with_payload(0.2, frame="panda_link8", com=[0.0, 0.0, 0.08]).with_friction(friction)
model = robot.with_friction(friction)
laws = [pc.ExtendedMotionPlan(model, path, K_p=1600.0, K_v=80.0, k=0.5, friction="full") for path in task]
loop = pc.SampledLoop(period=4e-3, torque_limits=True)
run = pc.simulate_sequence(laws, task.q_d(np.array(0.0)), task=task, duration=60.0, plant=plant, loop=loop)

numbers = pc.toolpath_metrics(run)
print(f"{len(program)} moves, {run.status[0]} after {numbers['path_time'][0]:.1f} s")
print(f"largest distance from the program: {1e6 * numbers['tool_deviation_peak'][0]:.0f} µm")
pc.save_figure(pc.deviation_figure(run, plant, task), out / "mill_pocket")
pc.record(run, plant, task=task, tool="cutter").save(out / "mill_pocket.html")
