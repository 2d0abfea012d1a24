"""A short run of the engine under the address and undefined-behaviour sanitizers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "pathcontrol" / "engine" / "src" / "api.cpp"
SCRIPT = """
import sys
from pathlib import Path
import numpy as np
from pathcontrol.engine import library
library._FOLDER = Path(sys.argv[1])
import pathcontrol as pc

robot = pc.load_robot("cicese_2dof")
loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True, delay=3e-3, filter_hz=90.0,
                      noise=pc.SensorNoise(position=1e-6, seed=1))
push = pc.Push([30.0, 2.0], 0.1, 0.1) + pc.FrameForce(robot, "tool", [5.0, 0.0, 5.0])
events = (pc.Wall("tool", [0.6, 0.0, 0.0], [-1.0, 0.0, 0.0], [1e4, np.inf, 1e6, 1e5, 1e3, 1e12, 1e4], 0.3, start=0.05)
          + pc.Wall("tool", [0.0, 0.0, 0.4], [0.0, 0.0, 1.0], rigid=True) + pc.JammedJoint(1, 0.2, 0.1)
          + pc.TorqueLimitDrop(0.1, 0.1, 0.1) + pc.FrictionChange(2.0, 0.1, 0.1, 0.5) + pc.PickUp(1.0, "tool", 0.15)
          + pc.Dropout(0.1, 0.2, probability=0.5) + pc.Dropout(0.0, 0.3, "measurements", probability=0.5))
starts = np.random.default_rng(0).normal(0, 0.2, (7, 2)) + [0.9, 0.1]
circle, line = pc.Circle(1.0, 2.0), pc.Line([0.7, 1.2], [0.5, 1.0], speed=2.0)
for task in (circle, line):
    for law in (pc.ExtendedMotionPlan(robot, task, 800.0, 45.0, k=20.0, friction="full"),
                pc.Projection(robot, task, 800.0, 45.0), pc.Projection(robot, task, 800.0, 45.0, branch="nearest"),
                pc.PDPlus(robot, task, 80.0, 5.0), pc.SlotineLi(robot, task, 8.0, 4.0)):
        pc.simulate(law, starts, duration=0.6, loop=loop, disturbance=push, engine="compiled", progress=False)
        pc.simulate(law, starts[0], duration=0.3, engine="compiled", progress=False)
law = pc.ExtendedMotionPlan(robot, circle, 800.0, 45.0, k=20.0)
pc.simulate(law, starts, duration=0.4, loop=loop, disturbance=events, engine="compiled", progress=False)
pc.simulate(law, starts, duration=0.4, loop=loop, disturbance=events, engine="compiled", progress=False,
            plant=[robot.with_payload(0.1 * i, "tool") for i in range(7)])
plants = [robot.with_payload(0.1 * i, "tool") for i in range(7)]
law = pc.ComputedTorque(robot, pc.TaskBatch([pc.Circle(0.7 + 0.05 * i, 2.0) for i in range(7)]), 800.0, 45.0)
pc.simulate(law, starts, duration=0.2, plant=plants, engine="compiled", progress=False)
pc.ControlTick(pc.Projection(robot, circle, 800.0, 45.0), 1e-3)(starts[0], starts[1])
for task in (circle, line):
    for law in (pc.ExtendedMotionPlan(robot, task, 800.0, 45.0, k=20.0, friction="observed"),
                pc.Projection(robot, task, 800.0, 45.0)):
        law = pc.EventPlan(pc.SpeedOverride(law, [[0.05, -1.0], [0.2, 0.0], [0.25, 2.0]]), threshold=[2.0, 0.5])
        law = pc.Paced(law)
        for q in (starts, starts[0]):
            pc.simulate(law, q, duration=0.3, loop=loop, disturbance=push + pc.Dropout(0.1, 0.1, probability=0.5),
                        engine="compiled", progress=False)
        tick = pc.ControlTick(law, 1e-3)
        tick(starts[0], starts[1]), tick.reverse(), tick(starts[0], starts[1])
print("clean")
"""


def _runtime(compiler, name):
    path = subprocess.run([compiler, f"-print-file-name={name}"], capture_output=True, text=True, check=True)
    return path.stdout.strip()


@pytest.mark.skipif("PATHCONTROL_SANITIZE" not in os.environ, reason="takes some seconds; set PATHCONTROL_SANITIZE=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++ with its sanitizers")
def test_a_short_run_has_no_bad_access_and_no_undefined_behaviour(tmp_path):
    flags = [
        "-std=c++17",
        "-O0",
        "-g1",
        "-fPIC",
        "-shared",
        "-ffp-contract=off",
        "-fno-math-errno",
        "-DLANES=4",
        "-DONE_SIZE",
        "-w",
    ]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
    library = tmp_path / "engine_base.so"
    built = subprocess.run(["g++", *flags, *sanitizers, SOURCE, "-o", library], capture_output=True, text=True)
    if built.returncode and "sanitize" in built.stderr:
        pytest.skip("this g++ has no sanitizers")
    assert built.returncode == 0, built.stderr
    preload = " ".join(_runtime("g++", name) for name in ("libasan.so", "libubsan.so"))
    environment = os.environ | {"LD_PRELOAD": preload, "ASAN_OPTIONS": "detect_leaks=0", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, tmp_path], capture_output=True, text=True, env=environment, cwd=SOURCE.parents[3]
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.strip() == "clean"
