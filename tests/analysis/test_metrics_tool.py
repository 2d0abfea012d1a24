"""The numbers of a tool: its speed beside the feed, its deviation and its orientation, of every path made for one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pathcontrol as pc
from pathcontrol.analysis.contours import HEADS, contour_table
from pathcontrol.analysis.tool_following import angle_between
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.laps import Laps

DOWN = np.diag([1.0, -1.0, -1.0])
SPEED, TIME = 0.12, np.linspace(0.0, 2.0, 401)
NAMES = {
    *("tool_deviation_peak", "tool_deviation_rms", "tool_speed_mean", "tool_speed_peak", "feed"),
    "orientation_error_peak",
}


@pytest.fixture(scope="module")
def ur5():
    return pc.load_robot("ur5").with_friction(None)


def circle(robot, center=(0.4, 0.1, 0.3), orientation=DOWN, radius=0.1, tool=None):
    if orientation is not None and not isinstance(orientation, pc.NormalOrientation):
        orientation = pc.FixedOrientation(orientation)
    start = [-0.6, -1.6, 1.8, -1.8, -1.57, 0.0]
    curve = pc.ToolCurve.circle(center, radius)
    return pc.CartesianPath(robot, "tool0", curve, orientation, speed=SPEED, tool=tool, start=start)


@pytest.fixture(scope="module")
def path(ur5):
    return circle(ur5)


def run_of(robot, task, q, qd, s):
    """A run with the motion given, (rollout, time, n)."""
    arrays = {"q": q, "qd": qd, "s": s, "sdot": np.gradient(s, TIME, axis=-1)}
    arrays |= dict.fromkeys(("e_p", "e_v", "tau", "tau_demand"), 0 * q)
    return Run.from_arrays(TIME, dict.fromkeys(robot.joint_names, "rad"), arrays, {}, robot=robot, task=task)


def along(robot, task, other=None):
    """The run of an arm that does exactly what another path than the ``task`` asks for, at the same s."""
    other = task if other is None else other
    s = task.s0 + TIME * float(task.theta(np.array(task.s0)))
    at = other.at(s + other.s0 - task.s0)
    return run_of(robot, task, at.q_d[None], at.velocity[None], s[None])


def numbers(run, **options):
    return {name: values[0] for name, values in pc.metrics(run, **options).items() if name in NAMES}


def test_a_perfect_run_has_the_feed_and_no_errors(ur5, path):
    found = numbers(along(ur5, path))
    assert set(found) == NAMES
    assert found["feed"] == SPEED
    assert found["tool_speed_mean"] == pytest.approx(SPEED, rel=1e-3)
    assert found["tool_speed_peak"] == pytest.approx(SPEED, rel=1e-3)
    assert found["tool_deviation_peak"] < 1e-9
    assert found["orientation_error_peak"] < 1e-9


@pytest.mark.parametrize("angle", [1e-6, 0.03, 1.0])
def test_a_known_rotation_gives_its_angle(ur5, path, angle):
    """The last joint turns about the tool's z axis, which is all that two prescribed rotations hold."""
    s, offset = path.s0 + SPEED * TIME, angle * np.eye(6)[5]
    turned = run_of(ur5, path, path.q_d(s)[None] + offset, 0 * path.q_d(s)[None], s[None])
    assert numbers(turned)["orientation_error_peak"] == pytest.approx(angle, rel=1e-6)
    assert numbers(turned)["tool_deviation_peak"] < 1e-9
    held = circle(ur5, orientation=pc.NormalOrientation([0.0, 0.0, 1.0]))
    turned = run_of(ur5, held, held.q_d(s)[None] + offset, 0 * held.q_d(s)[None], s[None])
    assert numbers(turned)["orientation_error_peak"] < 1e-9


@pytest.mark.parametrize("orientation", [DOWN, pc.NormalOrientation([0.0, 0.0, 1.0])])
def test_a_known_tilt_gives_its_angle(ur5, orientation):
    tilt = Rotation.from_rotvec([0.05, 0.0, 0.0]).as_matrix()
    run = along(ur5, circle(ur5, orientation=orientation), circle(ur5, orientation=tilt @ DOWN))
    assert numbers(run)["orientation_error_peak"] == pytest.approx(0.05, abs=2e-4)


def test_a_tool_that_may_turn_as_it_likes_has_no_orientation_error(ur5):
    assert set(numbers(along(ur5, circle(ur5, orientation=None)))) == NAMES - {"orientation_error_peak"}


def test_angles_are_those_of_rotation_vectors():
    rng = np.random.default_rng(0)
    first, turn = Rotation.random(50, random_state=1), rng.uniform(-1, 1, (50, 3))
    angle = angle_between(first.as_matrix(), (Rotation.from_rotvec(turn) * first).as_matrix())
    np.testing.assert_allclose(angle, np.linalg.norm(turn, axis=-1), rtol=1e-12)
    about_z = first * Rotation.from_rotvec(turn * [0, 0, 1])
    assert angle_between(first.as_matrix(), about_z.as_matrix(), 2).max() < 1e-12


@pytest.mark.parametrize(("moved", "radius", "away"), [(0.004, 0.1, 0.004), (0.0, 0.103, 0.003)])
@pytest.mark.parametrize("tool", [None, [0.02, 0.01, 0.08]])
def test_a_known_deviation_of_the_tool(ur5, moved, radius, away, tool):
    task = circle(ur5, tool=tool)
    other = circle(ur5, (0.4, 0.1, 0.3 + moved), radius=radius, tool=tool)
    found = numbers(along(ur5, task, other))
    assert found["tool_deviation_peak"] == pytest.approx(away, abs=2e-5)
    assert found["tool_deviation_rms"] == pytest.approx(away, abs=2e-5)
    assert found["orientation_error_peak"] < 1e-3


def made_of(path):
    half = path.s0 + 0.5 * path.period
    first, second = path.between(path.s0, half), path.between(half, path.s0 + path.period)
    return {
        "another profile": (path.with_profile(pc.ConstantRate(0.08)), 0.08),
        "reversed": (path.reversed(), SPEED),
        "a part": (path.between(path.s0, path.s0 + 0.9 * path.period), SPEED),
        "by arc length": (path.by_arc_length(), SPEED),
        "laps": (Laps(path, 2), SPEED),
        "concatenated": (pc.concatenated([first, second]), SPEED),
        "a sequence": (pc.PathSequence([first, second]), SPEED),
    }


def test_what_is_made_of_a_path_has_the_same_numbers(ur5, path, tmp_path):
    """The parameter of the circle is its length, so that a rate of it is a speed."""
    for name, (task, feed) in made_of(path).items():
        run = along(ur5, task)
        found = numbers(run, window=(0.0, 1.0), only=NAMES)
        assert set(found) == NAMES, name
        assert found["feed"] == pytest.approx(feed, rel=1e-3), name
        assert found["tool_speed_mean"] == pytest.approx(feed, rel=1e-3), name
        assert found["tool_deviation_peak"] < 1e-6, name
        assert found["orientation_error_peak"] < 1e-6, name
        kept = numbers(Run.load(run.save(tmp_path / "run.nc")), window=(0.0, 1.0), only=NAMES)
        assert kept["feed"] == pytest.approx(found["feed"], rel=1e-6), name
        assert set(kept) == NAMES, name


def test_rollouts_of_a_batch_have_their_own(ur5, path):
    tasks = [path, path.reversed(), path.with_profile(pc.ConstantRate(0.05))]
    law = pc.ComputedTorque(ur5, pc.TaskBatch(tasks), 400.0, 40.0)
    start = np.stack([task.q_d(np.array(task.s0)) for task in tasks])
    both = pc.metrics(pc.simulate(law, start, duration=0.2, progress=False))
    for i, task in enumerate(tasks):
        alone = pc.simulate(pc.ComputedTorque(ur5, task, 400.0, 40.0), start[i], duration=0.2, progress=False)
        measured = pc.metrics(alone)
        assert {name: both[name][i] for name in NAMES} == {name: measured[name][0] for name in NAMES}


def test_each_arm_of_a_batch_has_its_own(ur5, path):
    heavy = ur5.with_payload(4.0, frame="tool0")
    law, start = pc.ComputedTorque(ur5, path, 400.0, 40.0), path.start_posture
    both = pc.metrics(pc.simulate(law, start, plant=[ur5, heavy], duration=0.2, progress=False))
    for i, plant in enumerate([ur5, heavy]):
        alone = pc.metrics(pc.simulate(law, start, plant=plant, duration=0.2, progress=False))
        assert {name: both[name][i] for name in NAMES} == {name: alone[name][0] for name in NAMES}
    assert both["tool_deviation_peak"][1] > both["tool_deviation_peak"][0]


def test_the_deviation_over_time_is_that_of_each_task(ur5, path):
    tasks = [path, path.with_profile(pc.ConstantRate(0.05)), path]
    s = path.s0 + SPEED * TIME
    q = path.q_d(np.tile(s, (3, 1)))
    run = run_of(ur5, pc.TaskBatch(tasks), q, 0 * q, np.tile(s, (3, 1)))
    away = pc.tool_deviation(run)
    assert away.shape == (3, len(TIME))
    assert away.max() < 1e-9
    with pytest.raises(pc.InputError, match="was not made for a frame"):
        pc.tool_deviation(along(ur5, pc.Line(np.zeros(6), np.ones(6), speed=0.5)))


def test_only_what_is_asked_for_and_nothing_of_a_path_in_joint_space(ur5, path):
    run = along(ur5, path)
    assert set(pc.metrics(run, only=["feed", "e_p_peak"])) == {"feed", "e_p_peak"}
    line = pc.Line(np.zeros(6), np.ones(6), speed=0.5)
    assert NAMES.isdisjoint(pc.metrics(along(ur5, line)))


def test_each_path_of_a_sequence_has_its_time_and_speed(ur5, path):
    half = path.s0 + 0.5 * path.period
    parts = [path.between(path.s0, half), path.between(half, path.s0 + path.period).with_profile(pc.ConstantRate(0.06))]
    laws = [pc.ComputedTorque(ur5, part, 400.0, 40.0) for part in parts]
    first = parts[0].at(np.array(parts[0].s0))
    run = pc.simulate_sequence(laws, first.q_d, first.velocity, duration=8.0, progress=False)
    heads, *rows = contour_table(run)
    assert tuple(heads) == HEADS
    finish = run.data["path_finish_time"].to_numpy()
    assert [float(row[2]) for row in rows] == pytest.approx(np.diff(finish, prepend=0.0), rel=1e-3)
    assert [float(row[3]) for row in rows] == pytest.approx([1e3 * SPEED, 60.0], rel=1e-3)
    assert all(row[-1] == "100 %" for row in rows)
    assert set(NAMES) <= set(pc.metrics(run))
