"""Gains of the extended motion plan for the paper's arm with a load of 0 or 1 kg, within what its motors can do.

The paper's gains ask for far more torque than there is at the start, and amplify noise of the encoders. Here the
contour error of the worst load is made as small as it gets if the law never asks for more than the motors give, its
torque is no noisier than with the paper's gains, and the arm is hardly late.

Needs the extra "tune". Usage: python examples/tune_gains.py [folder]
"""

import sys
from pathlib import Path

import numpy as np
from scipy import stats

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")

robot = pc.load_robot("cicese_2dof")
task = pc.Circle(radius=1.0, speed=2.0)
noise = pc.SensorNoise(position=2e-5, seed=1)
loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True, noise=noise)
LONG = 6.3  # s; errors are measured over the second half, which is a lap
loads = {mass: robot.with_payload(mass, "tool") for mass in (0.0, 1.0)}


def build(p, samples):
    """Simulations of gains and payloads, a row each."""
    law = pc.ExtendedMotionPlan(robot, task, p["K_p"][:, None], p["K_v"], p["k"])
    start = np.tile(np.deg2rad([40.0, 70.0]), (len(samples), 1))
    return {"controller": law, "q": start, "duration": LONG, "loop": loop, "plant": [loads[m] for m in p["mass"]]}


def alone(gains, mass):
    """A plain simulation, with the numbers that matter."""
    law = pc.ExtendedMotionPlan(robot, task, gains["K_p"], gains["K_v"], gains["k"])
    run = pc.simulate(law, np.deg2rad([40.0, 70.0]), duration=LONG, plant=loads[mass], loop=loop, progress=False)
    numbers = {name: values[0] for name, values in pc.metrics(run).items()}
    return run, numbers


paper = {"K_p": 800.0, "K_v": [45.0, 100.0], "k": 20.0}
found = {("paper", mass): alone(paper, mass) for mass in loads}
allowed = max(numbers["tau_noise"] for _, numbers in found.values())

tuning = pc.tune(
    build,
    {"K_p": stats.loguniform(50, 2e4), "K_v": stats.loguniform([5, 5], [500, 500]), "k": stats.loguniform(0.5, 200)},
    "contour_error_rms",
    limits={"tau_demand_ratio": 1.0, "tau_noise": allowed, "speed_ratio": (0.9, None)},
    scenarios={"mass": list(loads)},
    population=24,
    generations=10,
)
print(tuning)

tuned = tuning.best().parameters
found |= {("tuned", mass): alone(tuned, mass) for mass in loads}
print(f"\n{'gains':8}{'load':>6}  contour error, RMS [deg]  torque demand / limit  noise [N m]")
for (name, mass), (_, numbers) in found.items():
    error, share, noisy = np.rad2deg(numbers["contour_error_rms"]), numbers["tau_demand_ratio"], numbers["tau_noise"]
    print(f"{name:8}{mass:4g} kg{error:26.3f}{share:23.2f}{noisy:13.2f}")

pc.save_figure(pc.pareto_figure(tuning, y="tau_demand_ratio", colour="K_p"), out / "tune_gains")
pc.record({name: found[name, 1.0][0] for name in ("paper", "tuned")}).save(out / "paper_and_tuned.html")
