"""The script that a report gives makes the very run again: histories of sweeps, and arms that the law does not know."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import stats

import pathcontrol as pc
from pathcontrol.experiments.sweep_runner import run_sweep
from pathcontrol.view.report.reproduction import recipe

pytest.importorskip("pyarrow")

ROBOT = pc.load_robot("cicese_2dof")
NOISE = pc.SensorNoise(position=1e-4, seed=3)
LOOP = pc.SampledLoop(encoders=True, velocity="difference", noise=NOISE, torque_limits=True)
SPACE = pc.Space.random(
    {
        "K_p": stats.loguniform([100.0, 100.0], [1e3, 1e3]),
        "k": stats.uniform(1.0, 50.0),
        "radius": stats.uniform(0.5, 0.5),
        "mass": stats.uniform(0.0, 2.0),
        "coulomb": stats.uniform(1.0, 2.0),
    },
    7,
)


def everything(p, samples):
    """Gains, paths, arms and noise differ from row to row."""
    tasks = pc.TaskBatch([pc.Circle(radius, 2.0) for radius in p["radius"]])
    arms = [
        ROBOT.with_payload(mass, "tool").with_friction(pc.Viscous([2.0, 0.2]) + pc.Coulomb([level, 1.0]))
        for mass, level in zip(p["mass"], p["coulomb"], strict=True)
    ]
    law = pc.ExtendedMotionPlan(ROBOT, tasks, p["K_p"], K_v=[45.0, 100.0], k=p["k"])
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.1, "loop": LOOP, "plant": arms}


def same_arm(p, samples):
    law = pc.Projection(ROBOT, pc.Circle(1.0, 2.0), p["K_p"][:, :1], K_v=[45.0, 100.0])
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.1, "loop": LOOP}


def rows_of_friction(p, samples):
    friction = pc.Viscous(np.tile([2.0, 0.2], (len(samples), 1))) + pc.Coulomb(p["K_p"] / 300.0)
    return same_arm(p, samples) | {"plant": ROBOT.with_friction(friction)}


def made_again(run, folder, monkeypatch):
    monkeypatch.chdir(folder)
    run.save("mine.nc")
    found = recipe("mine", run)
    assert found.kind == "python"
    namespace = {}
    exec(found.text, namespace)
    return namespace["run"]


def assert_the_very_run(run, again):
    for name in run.data.data_vars:
        values = again.array(name)
        assert_array_equal(values[:, : len(run.time)], run.array(name), err_msg=name)
    assert_array_equal(again.data["rollout"], run.data["rollout"])


@pytest.mark.parametrize("build", [everything, same_arm, rows_of_friction])
def test_a_history_of_a_sweep_is_made_again_bit_for_bit(build, tmp_path, monkeypatch):
    result = pc.sweep(
        build, SPACE, tmp_path / "a", keep=pc.Keep(random=2), chunk=4, metrics=["e_p_peak"], progress=False
    )
    assert len(result.kept) == 2
    for sample in result.kept:
        run = result.run(sample)
        assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


@pytest.mark.parametrize("build", [everything, same_arm])
def test_the_file_of_a_history_does_not_depend_on_the_chunks(build, tmp_path):
    files = []
    for chunk in (1, 3, 7):
        folder = tmp_path / str(chunk)
        pc.sweep(build, SPACE, folder, keep=pc.Keep(random=2), chunk=chunk, metrics=["e_p_peak"], progress=False)
        files.append({file.name: file.read_bytes() for file in folder.glob("runs/*")})
    assert files[0] == files[1] == files[2]
    assert len(files[0]) == 2


FILE = """
duration = 0.1
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 2.0
[controller]
type = "extended_motion_plan"
K_p = 800.0
K_v = [45.0, 100.0]
k = 20.0
[loop]
velocity = "difference"
[start]
q = [0.7, 1.2]
[sweep]
method = "random"
samples = 5
metrics = ["e_p_peak"]
keep = { random = 2 }
[sweep.parameters]
"""


@pytest.mark.parametrize(
    "varied",
    [
        '"plant.payload.mass" = { uniform = [0.1, 3.0] }\n"plant.payload.frame" = { grid = ["tool"] }',
        '"controller.K_v" = { uniform = [[30.0, 80.0], [50.0, 120.0]] }\n"task.radius" = { uniform = [0.5, 1.0] }',
        '"loop.substeps" = { grid = [1, 2] }\n"start.q[0]" = { normal = [0.7, 0.1] }',
    ],
)
def test_a_history_of_a_file_is_made_again_bit_for_bit(varied, tmp_path, monkeypatch):
    (tmp_path / "sweep.toml").write_text(FILE + varied)
    result = run_sweep(tmp_path / "sweep.toml", tmp_path / "out", chunk=3, progress=False)
    for sample in result.kept:
        run = result.run(sample)
        assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


def test_an_arm_that_the_law_does_not_know_is_not_its_model(tmp_path, monkeypatch):
    law = pc.ComputedTorque(ROBOT, pc.Circle(1.0, 2.0), 400.0, 40.0)
    run = pc.simulate(law, [0.7, 1.2], duration=0.1, plant=ROBOT.with_payload(2.0, "tool"), progress=False)
    assert run.model is ROBOT
    assert run.robot is not ROBOT
    loaded = pc.Run.load(run.save(tmp_path / "run.nc"))
    again = made_again(loaded, tmp_path, monkeypatch)
    assert_the_very_run(run, again)
    assert again.config == run.config
    known = pc.simulate(law, [0.7, 1.2], duration=0.1, progress=False)
    assert known.model is known.robot
