"""The script that a report gives makes runs with a disturbance again, bit for bit; or there is none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import stats

import pathcontrol as pc
from pathcontrol.view.report.reproduction import recipe

ROBOT = pc.load_robot("cicese_2dof")
PUSH = pc.Push([3.0, -1.0], start=0.02, duration=0.03)
WAVE = pc.Harmonic([0.1, 0.3], 7.0, 0.4)
FORCE = pc.FrameForce(ROBOT, "tool", [0.1, 0.2, -5.0], start=0.01)
ALONE = {
    "for ever": pc.Push([0.1, 0.2]),
    "force": FORCE,
    "sum": PUSH + WAVE + FORCE,
    "sum to the right": PUSH + (WAVE + (FORCE + pc.Push([0.1, 0.7]))),
}
ROWS = {
    "pushes": pc.Push([[3.0, -1.0], [2.0, 0.5]], start=[0.02, 0.0], duration=[0.03, np.inf]),
    "waves": pc.Harmonic([0.1, 0.3], [7.0, 9.0], [0.0, 1.0]),
    "drops": pc.TorqueLimitDrop([[0.1, 0.2], [0.0, 1.0]], [0.02, 0.0], 0.03),
    "changes of friction": pc.FrictionChange([[2.0], [0.5]], [0.02, 0.0], 0.03, coulomb=[0.1, 0.2]),
    "dropouts": pc.Dropout([0.02, 0.0], 0.03, probability=[0.5, 0.9]),
    "walls": pc.Wall(
        "tool", [[0.5, 0.0, 0.0], [0.6, 0.0, 0.0]], [-1.0, 0.0, 0.0], [1e4, 1e5], [0.0, 0.3], damping=[0, 9]
    ),
    "picks": pc.PickUp([1.0, 2.0], "tool", [0.02, 0.03], 0.03),
    "jams": pc.JammedJoint(["joint_2", "joint_1"], [0.02, 0.0], 0.03),
    "forces": pc.FrameForce(ROBOT, "tool", [[0.1, 0.2, -5.0], [1.0, 0.0, 0.0]], duration=0.03),
}


def made_again(run, folder, monkeypatch):
    monkeypatch.chdir(folder)
    found = recipe("mine", pc.Run.load(run.save("mine.nc")))
    assert found.kind == "python"
    namespace = {}
    exec(found.text, namespace)
    return namespace["run"]


def assert_the_very_run(run, again):
    for name in run.data.data_vars:
        assert_array_equal(again.array(name)[:, : len(run.time)], run.array(name), err_msg=name)


def simulated(disturbance, rows=1, loop=None, plant=ROBOT):
    law = pc.ExtendedMotionPlan(ROBOT, pc.Circle(0.5, 2.0), 800.0, K_v=[45.0, 100.0], k=20.0)
    loop = pc.SampledLoop(torque_limits=True) if loop is None else loop
    q = [[0.7, 1.2]] * rows
    return pc.simulate(law, q, duration=0.08, disturbance=disturbance, loop=loop, plant=plant, progress=False)


@pytest.mark.parametrize(
    ("name", "loop"), [*((name, pc.SampledLoop()) for name in ALONE), ("sum", pc.ContinuousTime())]
)
def test_a_disturbed_run_is_made_again_bit_for_bit(name, loop, tmp_path, monkeypatch):
    run = simulated(ALONE[name], loop=loop)
    again = made_again(run, tmp_path, monkeypatch)
    assert_the_very_run(run, again)
    assert again.config == run.config


@pytest.mark.parametrize("joint", [1, "joint_2"])
def test_a_run_with_a_jam_is_made_again(joint, tmp_path, monkeypatch):
    run = simulated(PUSH + pc.JammedJoint(joint, 0.02, 0.03))
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


def test_a_run_with_weak_motors_is_made_again(tmp_path, monkeypatch):
    run = simulated(PUSH + pc.TorqueLimitDrop([0.01, 0.5], 0.02, 0.03), loop=pc.SampledLoop(torque_limits=True))
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


@pytest.mark.parametrize("what", ["ticks", "measurements"])
def test_a_run_with_a_dropout_is_made_again(what, tmp_path, monkeypatch):
    run = simulated(PUSH + pc.Dropout(0.02, 0.03, what, "zero", 0.5, seed=3))
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


@pytest.mark.parametrize("kind", [{"stiffness": 1e5, "friction": 0.3}, {"rigid": True}])
def test_a_run_that_meets_a_wall_is_made_again(kind, tmp_path, monkeypatch):
    tool = ROBOT.frame_pose(np.array([0.7, 1.2]), "tool")[:3, 3]
    run = simulated(PUSH + pc.Wall("tool", tool, [-1.0, 0.0, 2.0], start=0.02, **kind))
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


def test_a_run_with_a_pick_up_is_made_again(tmp_path, monkeypatch):
    run = simulated(PUSH + pc.PickUp(1.0, "tool", 0.02, 0.03, velocity=[0.1, 0.0, 0.0]))
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


def test_a_run_with_a_change_of_friction_is_made_again(tmp_path, monkeypatch):
    run = simulated(PUSH + pc.FrictionChange(3.0, 0.02, 0.03))
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


@pytest.mark.parametrize("name", ROWS)
def test_rollouts_with_a_disturbance_each_are_made_again(name, tmp_path, monkeypatch):
    run = simulated(ROWS[name], rows=2)
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))
    assert recipe("one", run.rollout(1)).kind == "none"  # two rows are not those of one rollout


def test_a_force_on_an_arm_with_another_plant(tmp_path, monkeypatch):
    run = simulated(FORCE, plant=ROBOT.with_payload(2.0, "tool"))
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


def test_a_disturbed_sequence_is_made_again(tmp_path, monkeypatch):
    paths = [pc.Line([0.0, 0.0], [0.1, 0.1], 2.0), pc.Line([0.1, 0.1], [0.2, 0.1], 2.0)]
    laws = [pc.ComputedTorque(ROBOT, path, 400.0, 40.0) for path in paths]
    run = pc.simulate_sequence(
        laws, [0.0, 0.0], duration=0.2, task=pc.PathSequence(paths), disturbance=PUSH + WAVE, progress=False
    )
    assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


def test_a_history_of_a_disturbed_sweep_is_made_again(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")

    def build(p, samples):
        law = pc.ComputedTorque(ROBOT, pc.Circle(1.0, 2.0), p["K_p"][:, None], K_v=45.0)
        pushed = pc.Push(p["push"], p["start"], 0.03) + pc.Harmonic([0.1, 0.3], p["f"])
        forced = pc.FrameForce(ROBOT, "tool", [0.0, 0.0, -3.0])
        return {
            "controller": law,
            "q": [[0.7, 1.2]] * len(samples),
            "duration": 0.06,
            "disturbance": pushed + forced,
        }

    space = pc.Space.random(
        {
            "K_p": stats.loguniform(100.0, 1e3),
            "push": stats.uniform([1.0, 1.0], 2.0),
            "start": stats.uniform(0.0, 0.02),
            "f": stats.uniform(1.0, 9.0),
        },
        5,
    )
    options = {"metrics": ["e_p_peak"], "keep": pc.Keep(random=2), "chunk": 3, "progress": False}
    result = pc.sweep(build, space, tmp_path / "out", **options)
    assert len(result.kept) == 2
    for sample in result.kept:
        run = result.run(sample)
        assert_the_very_run(run, made_again(run, tmp_path, monkeypatch))


@pytest.fixture(scope="module")
def pushed():
    return simulated(PUSH)


class Mine(pc.Disturbance):
    def torque(self, t, q, qd):
        return np.zeros_like(q)


@pytest.mark.parametrize(
    "disturbance", [Mine(), PUSH + Mine(), pc.Push(np.ones((40, 2)))], ids=["mine", "sum", "large"]
)
def test_what_a_record_does_not_know_whole_has_no_script(disturbance):
    rows = 40 if isinstance(disturbance, pc.Push) else 1
    assert recipe("mine", simulated(disturbance, rows=rows)).kind == "none"


@pytest.mark.parametrize(
    "described",
    [
        None,
        "Push",
        {"disturbance": ["Push"]},
        {"disturbance": "sum", "terms": []},
        {"disturbance": "sum", "terms": [1, 2]},
        {"disturbance": "Push", "magnitude": "x", "start": 0.0, "duration": 1.0},
        {"disturbance": "Push", "magnitude": [[[1.0]]], "start": 0.0, "duration": 1.0},
        {"disturbance": "Push", "magnitude": [1.0, 2.0], "start": {}, "duration": 1.0},
        {"disturbance": "Push", "magnitude": [1.0, 2.0], "start": 0.0},
        {"disturbance": "FrameForce", "frame": "tool", "force": [0.0, 0.0, 1.0], "start": 0.0, "duration": 1.0},
        {"disturbance": "FrameForce", "robot": "x", "frame": "tool", "force": [0.0] * 3, "start": 0.0, "duration": 1.0},
    ],
    ids=repr,
)
def test_what_no_disturbance_says_of_itself_has_no_script(described, pushed, monkeypatch):
    assert recipe("mine", pushed).kind == "python"
    monkeypatch.setitem(pushed.config, "disturbance", described)
    assert recipe("mine", pushed).kind == "none"
