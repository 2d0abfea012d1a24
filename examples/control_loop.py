"""An arm driven by a control loop as on hardware: cables fail for a while, the arm is damped, and the plan resumes.

In place of the arm stands a simulated one; a real one is driven by the same loop with `pc.drive(loop, pc.UR(…), 10.0)`.
Writes figures of the log. Usage: python examples/control_loop.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
PERIOD = 2.5e-3  # s
FAILS, BACK, RESUMES, ENDS = (round(time / PERIOD) for time in (2.0, 2.1, 3.0, 6.0))

robot = pc.load_robot("cicese_2dof")
task = pc.Circle(radius=0.5, speed=2.0)
law = pc.ExtendedMotionPlan(robot, task, K_p=800.0, K_v=[45.0, 100.0], k=20.0)
envelope = pc.Envelope(velocity=10.0, lower=-9.0, upper=9.0, tube=0.3)  # torques are limited as the URDF says
loop = pc.ControlLoop(law, PERIOD, envelope)

arm = pc.Plant(robot, PERIOD)
q, qd = np.array([[0.5, 0.0]]), np.zeros((1, 2))
loop.start(q[0], qd[0])
mode = None
with loop.record() as log:
    for k in range(ENDS):
        measured = np.full(2, np.nan) if FAILS <= k < BACK else q[0]  # the encoders' cable is loose for 0.1 s
        if k == RESUMES:
            loop.resume()
        tau = loop.step(measured, qd[0], k * PERIOD)
        q, qd = arm.advance(q, qd, tau[None])
        if loop.status.mode != mode:
            mode = loop.status.mode
            print(f"{k * PERIOD:.2f} s: {mode.name}" + (f", {loop.status.reason}" if loop.status.reason else ""))

run = log.run()
after = run.time > RESUMES * PERIOD + 1.0
print(f"{np.rad2deg(pc.contour_error(run)[0, after]).max():.2f} deg from the path after that")
pc.save_figure(pc.path_figure(run), out / "control_loop-path")
pc.save_figure(pc.torque_figure(run), out / "control_loop-torques")
