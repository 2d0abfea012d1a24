"""What is likely a slip is told, and what passed a limit or did not get there is not taken for good."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy import stats

import pathcontrol as pc
from pathcontrol.analysis.run_remarks import remarks
from pathcontrol.errors import PathControlWarning
from pathcontrol.simulation.checks.slips import warn_of_slips

DEGREES = [0.0, -90.0, 90.0, -90.0, -90.0, 0.0]


@pytest.fixture(scope="module")
def ur5():
    return pc.load_robot("ur5")


def told(function, *arguments, **options):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", PathControlWarning)
        result = function(*arguments, **options)
    return [str(one.message) for one in found if issubclass(one.category, PathControlWarning)], result


def test_degrees_given_as_radians_are_told_before_and_after(ur5):
    line = pc.Line(np.deg2rad(DEGREES), np.deg2rad(DEGREES) + 0.2, speed=0.2)
    law = pc.ComputedTorque(ur5, line, 100.0, 20.0)
    sentences, _ = told(warn_of_slips, ur5, line, np.array([DEGREES]))
    assert len(sentences) == 1
    assert "shoulder_lift_joint at -90 rad" in sentences[0] or "elbow_joint at 90 rad" in sentences[0]
    assert "did you mean degrees?" in sentences[0]
    with pytest.warns(PathControlWarning, match="degrees"), pytest.raises(pc.SimulationError) as failed:
        pc.simulate(pc.ComputedTorque(ur5, line, 1e9, 1e6), DEGREES, duration=0.5, progress=False)
    assert "degrees" in str(failed.value)
    assert "lower the gains" not in str(failed.value)
    assert told(pc.simulate, law, line.start, duration=0.01, progress=False)[0] == []


def test_a_path_outside_the_limits_is_told_with_its_joint_and_place(ur5):
    start = np.deg2rad(DEGREES)
    away = start.copy()
    away[2] += 6.0
    path = pc.Line(start, away, speed=0.2)
    sentences, _ = told(warn_of_slips, ur5, path, start[None])
    assert len(sentences) == 1
    assert "the path has elbow_joint" in sentences[0]
    assert "degrees" not in sentences[0]
    # of a larger batch the first part speaks for all
    assert told(warn_of_slips, ur5, path, start[None], 500)[0] == []


def test_an_arm_below_its_own_weight_is_told(arm):
    weak = pc.load_robot(str(arm.source.text).replace('effort="150"', 'effort="20"'))
    q = np.array([[np.pi / 2, 0.0]])
    needed = abs(weak.gravity(q)[0, 0])
    sentences, _ = told(warn_of_slips, weak, pc.Circle(1.0, 1.0), q)
    assert len(sentences) == 1
    assert f"joint_1 needs {needed:.4g} N m" in sentences[0]
    assert told(warn_of_slips, arm, pc.Circle(1.0, 1.0), q)[0] == []


def weakened(arm, effort):
    return pc.load_robot(str(arm.source.text).replace('effort="150"', f'effort="{effort}"'))


def peak_of_weight(robot, path):
    """The largest gravity torque of the first joint on a path [N m] and where it is, by brute force."""
    s = np.linspace(*path.sampled_interval, 20001)
    torque = np.abs(robot.gravity(path.q_d(s)))[:, 0]
    return torque.max(), s[torque.argmax()]


def test_weight_is_looked_at_all_along_the_path(arm):
    """The start hangs straight down, the end is level."""
    path = pc.Line([0.0, 0.0], [np.pi / 2, 0.3], speed=0.5)
    weak, q = weakened(arm, 30), np.zeros((1, 2))
    [sentence], _ = told(warn_of_slips, weak, path, q)
    needed, s = peak_of_weight(weak, path)
    words = sentence.split()
    assert words[:2] == ["joint_1", "needs"]
    assert float(words[2]) == pytest.approx(needed, rel=1e-3)
    assert float(sentence.partition("s = ")[2].split()[0]) == pytest.approx(s, abs=0.02 * path.s_end)
    enough = weakened(arm, float(np.ceil(needed)))
    assert told(warn_of_slips, enough, path, q)[0] == []


def test_every_arm_and_every_task_of_a_batch_is_looked_at(arm):
    """Twenty paths, of which the last reaches highest; and arms of which the last but one has the least torque."""
    heights = np.linspace(0.1, np.pi / 2, 20)
    paths = [pc.Line([0.0, 0.0], [height, 0.0], speed=0.5) for height in heights]
    limit = float(np.abs(arm.gravity(np.array([heights[16], 0.0])))[0]) + 0.01
    weak, q = weakened(arm, limit), np.zeros((20, 2))
    [sentence], _ = told(warn_of_slips, weak, pc.TaskBatch(paths), q)
    needed, _ = peak_of_weight(weak, paths[-1])
    assert f"needs {needed:.4g} N m at s = " in sentence
    assert "in rollout 19, the worst of 3," in sentence
    arms = [weakened(arm, effort) for effort in (150, 149, 30, 20, 25)]
    loads = [one.with_payload(mass, frame="tool") for one, mass in zip(arms, (0.0, 1.0, 2.0, 0.5, 0.5), strict=True)]
    [sentence], _ = told(warn_of_slips, pc.RobotBatch(loads), paths[-1], np.zeros((5, 2)))
    shares = [peak_of_weight(one, paths[-1])[0] / one.limits.effort[0] for one in loads]
    assert f"in rollout {np.argmax(shares)}, the worst of {sum(share > 1 for share in shares)}," in sentence
    assert f"its limit is {loads[int(np.argmax(shares))].limits.effort[0]:.4g} N m" in sentence


def test_limits_of_position_are_those_of_each_arm_and_task(ur5):
    start = np.deg2rad(DEGREES)
    inside = pc.Line(start, start + 0.1, speed=0.2)
    beyond = pc.Line(start, start + 6.0 * np.eye(6)[2], speed=0.2)
    [sentence], _ = told(warn_of_slips, ur5, pc.TaskBatch([inside] * 11 + [beyond]), np.tile(start, (12, 1)))
    assert "the path of rollout 11 has elbow_joint" in sentence


def test_an_arm_that_stands_still_is_told_with_the_remedy(arm):
    line = pc.Line([0.7, 1.2], [0.55, 0.96], speed=0.05)
    sentences, run = told(
        pc.simulate, pc.Projection(arm, line, 800.0, [45.0, 100.0]), line.start, duration=1.0, progress=False
    )
    assert any('friction="full"' in sentence for sentence in sentences)
    [remark] = remarks(run)
    assert "stands still" in remark
    assert 'friction="full"' in remark
    law = pc.Projection(arm, line, 800.0, [45.0, 100.0], friction="full")
    sentences, run = told(pc.simulate, law, line.start, duration=8.0, progress=False)
    assert sentences == remarks(run) == []


def test_shares_of_limits_are_those_of_the_robot(ur5):
    start = np.deg2rad(DEGREES)
    line = pc.Line(start, start + 0.5, speed=9.0)
    law = pc.ComputedTorque(ur5, line, 400.0, 40.0)
    run = pc.simulate(law, start, duration=0.4, progress=False)
    numbers, limits = pc.metrics(run), ur5.limits
    middle, half = 0.5 * (limits.lower + limits.upper), 0.5 * (limits.upper - limits.lower)
    assert numbers["position_limit_ratio"][0] == pytest.approx((np.abs(run.array("q") - middle) / half).max())
    assert numbers["velocity_limit_ratio"][0] == pytest.approx((np.abs(run.array("qd")) / limits.velocity).max())
    assert numbers["torque_limit_ratio"][0] == pytest.approx((np.abs(run.array("tau")) / limits.effort).max())
    assert any("velocity" in one for one in remarks(run)) == (numbers["velocity_limit_ratio"][0] > 1)
    assert any("torque" in one for one in remarks(run)) == (numbers["torque_limit_ratio"][0] > 1)


def build(parameters, samples):
    """Lines that are taken quickly or so slowly that dry friction holds the arm."""
    arm = pc.load_robot("cicese_2dof")
    lines = [pc.Line([0.7, 1.2], [0.55, 0.96], speed=float(speed)) for speed in parameters["speed"]]
    law = pc.Projection(arm, pc.TaskBatch(lines), 800.0, [45.0, 100.0])
    return {"controller": law, "q": np.tile(lines[0].start, (len(samples), 1)), "duration": 2.0}


@pytest.mark.filterwarnings("ignore::pathcontrol.errors.PathControlWarning")
def test_an_arm_that_stands_still_is_never_the_best_of_a_sweep_or_a_tuning(tmp_path):
    wanted = ["e_p_peak", "progress"]
    result = pc.sweep(
        build, pc.Space.grid({"speed": [0.05, 1.0, 0.06, 1.5]}), tmp_path / "sweep", metrics=wanted, progress=False
    )
    table = result.table()
    assert table["status"].to_numpy().tolist() == ["unfinished", "finished", "unfinished", "finished"]
    assert table["e_p_peak"].to_numpy().argmin() in (0, 2)  # which is why it has to be looked at
    assert set(result.pareto("e_p_peak")["sample"].to_numpy()) <= {1, 3}
    space = {"speed": stats.uniform(0.02, 1.5)}
    tuning = pc.tune(build, space, "e_p_peak", population=6, generations=1, progress=False)
    best = tuning.best()
    assert best is not None
    assert tuning.table()["status"].to_numpy()[best.number] == "finished"
    slow = pc.tune(build, {"speed": [0.05, 0.06]}, "e_p_peak", population=5, generations=1, progress=False)
    assert slow.best() is None
    assert "did not get to the end" in str(slow)
