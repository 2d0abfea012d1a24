"""A straight line faster than the motors can: model predictive path following beside the least time.

The arm and the line are those of examples of time-optimal path following: the tool begins with 1 m/s, the end is free.
Writes a figure of the torques. Needs the extra ``mpc``. Usage: python examples/predictive_control.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
cases = [(9, 0.02), (18, 0.01), (36, 0.005), (72, 0.005)] if "--all" in sys.argv else [(9, 0.03)]

robot = pc.load_robot("two_link")
curve = pc.ToolCurve.line([0.0, 0.0, 1.5], [1.5, 0.0, 0.0])
line = pc.CartesianPath(robot, "tool", curve, start=[0.85, 1.45], tolerance=1e-8)
fastest = pc.time_optimal(robot, line, margin=0.0, points=5000, start_rate=1.0, end_rate="free")
print(f"time-optimal profile {fastest.traversal_time:.3f} s")

task = line.with_profile(pc.ConstantRate(6.0))  # m/s, more than the torques allow
weights = {"Q": 1.0, "W": 1e-6, "R": 1e-5, "R_s": 1e-9}  # of what is beside the path far above those of speed
for intervals, period in cases:
    law = pc.PathMPC(robot, task, horizon=1.2, intervals=intervals, margin=0.0, end="free", **weights)
    loop = pc.SampledLoop(period=period, torque_limits=True, substeps=10)
    qd = line.dq_d(np.array(0.0)) * 1.0
    run = pc.simulate(law, line.start_posture, qd, duration=0.96, until="duration", loop=loop, progress=False)

    times, s, rate = run.data["time"].values, run.array("s")[0], run.array("sdot")[0]
    k = int(np.argmax(s >= line.s_end)) - 1  # the last tick before the end
    slope = (rate[k] - rate[k - 1]) / period
    left = line.s_end - s[k]
    time = times[k] + 2 * left / (rate[k] + np.sqrt(rate[k] ** 2 + 2 * slope * left))
    ticks = slice(0, k + 1)
    error = np.rad2deg(np.linalg.norm(run.array("e_p")[0, ticks], axis=-1).max())
    share = np.abs(run.array("tau_demand")[0, ticks] / robot.limits.effort).max()
    print(f"{intervals:3} intervals, {1e3 * period:4.1f} ms: {time:.3f} s, {error:.2f} deg, {share:.3f} of the torques")

pc.save_figure(pc.torque_figure(run, robot.limits.effort), out / "predictive_control-torque")
