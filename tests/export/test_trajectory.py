"""Timed trajectories of runs and plans: their derivatives, their limits and their files."""

import csv
import json
import re
import warnings

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.errors import InputError

EXACT = 1e-6


@pytest.fixture(scope="module")
def arm():
    return pc.load_robot("cicese_2dof")


@pytest.fixture(scope="module")
def motion(arm):
    """A run of the paper's arm on a circle, without friction, and the law's plan."""
    task = pc.Circle(radius=0.5, speed=2.0, center=(0.3, -0.2))
    law = pc.ComputedTorque(arm.with_friction(pc.no_friction(2)), task, K_p=100.0, K_v=20.0)
    start, rate = task.q_d(np.array(0.0)), task.dq_d(np.array(0.0)) * 2.0 / 0.5
    loop = pc.SampledLoop(period=1e-3)
    run = pc.simulate(law, start, rate, duration=1.0, loop=loop, plant=law.robot, progress=False)
    return run, task


def differences(trajectory):
    """The largest differences between derivatives of cubics through the samples and what is given."""
    h = trajectory.period
    found = []
    for values, rates in ((trajectory.q, trajectory.qd), (trajectory.qd, trajectory.qdd)):
        slope = (values[2:] - values[:-2]) / (2 * h)
        # Simpson's rule: the mean of the rates over two periods, exact to h⁴
        found.append(np.abs(slope - (rates[:-2] + 4 * rates[1:-1] + rates[2:]) / 6).max())
    return found


def test_a_circle_at_constant_speed_has_its_closed_form():
    task = pc.Circle(radius=0.5, speed=2.0, center=(0.3, -0.2))
    with pytest.warns(pc.PathControlWarning, match="begins at 2 rad/s"):
        plan = pc.plan_trajectory(task, 100.0)
    w = 2.0 / 0.5
    angle = w * plan.time
    assert plan.duration == pytest.approx(np.ceil(2 * np.pi / w * 100) / 100, abs=1e-12)
    assert plan.q == pytest.approx(np.stack([0.3 + 0.5 * np.cos(angle), -0.2 + 0.5 * np.sin(angle)], -1), abs=1e-9)
    assert plan.qd == pytest.approx(0.5 * w * np.stack([-np.sin(angle), np.cos(angle)], -1), abs=1e-9)
    assert plan.qdd == pytest.approx(-0.5 * w**2 * np.stack([np.cos(angle), np.sin(angle)], -1), abs=1e-8)


@pytest.mark.filterwarnings("ignore::pathcontrol.errors.PathControlWarning")
@given(st.floats(0.1, 3.0), st.floats(-1.0, 1.0), st.floats(0.1, 2.0))
@settings(max_examples=8, deadline=None)
def test_velocities_and_accelerations_are_derivatives_of_a_plan(speed, turn, length):
    line = pc.Line([0.0, turn], [length, 0.5 - turn], speed=speed)
    plan = pc.plan_trajectory(line, 2000.0)
    before = plan.time < line.s_end / speed - 0.1 - 2 * plan.period  # the plan begins to brake
    if before.sum() < 5:
        return
    first = pc.Trajectory(*(v[before] for v in (plan.time, plan.q, plan.qd, plan.qdd)), plan.joints)
    assert max(differences(first)) < 1e-6
    last = np.linalg.norm(plan.q[-1] - line.q_d(np.array(line.s_end)))
    assert last <= 1e-4 * (1 + 1e-6)  # the plan has arrived


SHORT = [pc.Line([0.0, 0.0], [0.001, 0.0], 0.5), pc.Line([0.001, 0.0], [0.001, 0.001], 0.5)]


@pytest.mark.filterwarnings("ignore::pathcontrol.errors.PathControlWarning")
@pytest.mark.parametrize("task", [pc.Circle(0.5, 2.0), SHORT[0], pc.PathSequence(SHORT)], ids=["round", "open", "two"])
def test_a_plan_to_its_end_is_that_of_a_time_as_long(task):
    """It goes on to a whole number of samples, also where a path of a sequence has not risen to its speed by then."""
    whole = pc.plan_trajectory(task, 70.0)
    timed = pc.plan_trajectory(task, 70.0, whole.time[-1])
    for name in ("q", "qd", "qdd"):  # both are integrated to 1e-11
        np.testing.assert_allclose(getattr(whole, name), getattr(timed, name), atol=1e-7 if name == "qdd" else 1e-8)


def test_a_run_is_its_samples_where_the_rate_is_that_of_the_loop(motion):
    run, _ = motion
    same = run.to_trajectory(1000.0)
    assert same.q == pytest.approx(run.array("q")[0], abs=1e-12)
    assert same.qd == pytest.approx(run.array("qd")[0], abs=1e-12)
    assert list(same.joints) == run.joints


@pytest.mark.filterwarnings("ignore::pathcontrol.errors.PathControlWarning")
def test_a_run_between_samples_follows_its_plan_to_the_order_of_cubics(motion):
    run, task = motion
    errors = [
        np.abs(run.to_trajectory(rate).q - pc.plan_trajectory(task, rate, 1.0).q).max() for rate in (1000.0, 730.0)
    ]
    assert errors[1] < errors[0] * 1.5 + 1e-9  # the arm is as far from the plan between samples as at them


def test_what_ends_is_cut_and_what_diverges_is_refused(arm):
    line = pc.Line([0.0, 0.0], [0.3, 0.2], speed=1.0)
    law = pc.ExtendedMotionPlan(arm, line, K_p=800.0, K_v=100.0, k=40.0)
    run = pc.simulate(law, [0.0, 0.0], duration=4.0, progress=False)
    trajectory = run.to_trajectory(200.0)
    assert np.isfinite(run.finish_time[0])
    assert trajectory.duration <= run.finish_time[0] + 1e-9 < trajectory.duration + 1 / 200.0 + 1e-9
    with pytest.raises(InputError, match="rollout = 1, expected one of the 1"):
        run.to_trajectory(200.0, rollout=1)
    for rate in (0.0, -1.0, np.nan, np.inf, 1e9, 1e-9):
        with pytest.raises(InputError, match="rate"):
            run.to_trajectory(rate)


# --- limits -------------------------------------------------------------------------------------------------------


def trajectory_of(q, robot, h=0.01):
    """A trajectory with the derivatives of positions q (k, n)."""
    qd = np.gradient(q, h, axis=0)
    return pc.Trajectory(h * np.arange(len(q)), q, qd, np.gradient(qd, h, axis=0), robot.joint_names)


@pytest.mark.parametrize(
    ("joint", "size", "what"), [(0, 4.0, "position"), (3, 4.0, "position"), (2, 2.9, "velocity"), (1, 65.0, "torque")]
)
def test_the_limit_that_is_passed_is_named(joint, size, what):
    robot = pc.load_robot("panda", lock={"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0})
    t = np.linspace(0, 1, 201)[:, None]
    rest = np.array([0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.8])
    swing = {"position": size * t**2, "velocity": 0.5 * np.sin(size * 2 * t), "torque": 0.03 * np.sin(size * t)}
    q = rest + np.eye(7)[joint] * swing[what]
    h = {"position": 0.1, "velocity": 0.005, "torque": 0.005}[what]
    with pytest.raises(InputError, match=f"panda_joint.* has the {what}") as told:
        trajectory_of(q, robot, h).check_limits(robot)
    assert told.value.joint in robot.joint_names
    low, high = told.value.limit
    assert not low <= told.value.value <= high
    assert 0 <= told.value.time <= h * 200


def test_nothing_is_written_beyond_a_limit_unless_told(arm, tmp_path):
    fast = trajectory_of(np.linspace([0.0, 0.0], [30.0, 0.0], 50), arm, 0.001)
    with pytest.raises(InputError, match="limits are"):
        pc.export_trajectory(fast, tmp_path / "fast.csv", "csv", arm)
    assert not list(tmp_path.iterdir())
    with pytest.warns(pc.PathControlWarning, match="limits are"):
        pc.export_trajectory(fast, tmp_path / "fast.csv", "csv", arm, limits="warn")
    assert (tmp_path / "fast.csv").exists()


def test_the_robot_must_have_as_many_joints(arm):
    with pytest.raises(InputError, match="2 joints"):
        trajectory_of(np.zeros((5, 2)), arm).check_limits(pc.load_robot("ur5"))


def test_arrays_that_are_no_trajectory_are_refused():
    two = np.zeros((2, 2))
    for time in ([0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0, 3.0], [0.0, np.nan]):
        with pytest.raises(InputError):
            pc.Trajectory(np.array(time), *[np.zeros((len(time), 2))] * 3, ["a", "b"])
    with pytest.raises(InputError, match="shapes"):
        pc.Trajectory(np.array([0.0, 1.0]), two, two, np.zeros((2, 3)), ["a", "b"])


# --- files --------------------------------------------------------------------------------------------------------

NUMBERS = st.floats(-50, 50) | st.floats(-1e-7, 1e-7)


@st.composite
def trajectories(draw, joints=None):
    n, k = joints or draw(st.integers(1, 4)), draw(st.integers(2, 5))
    values = [np.array(draw(st.lists(NUMBERS, min_size=k * n, max_size=k * n))).reshape(k, n) for _ in range(3)]
    period = draw(st.sampled_from([0.002, 0.008, 1 / 30, 0.1]))
    names = [f'joint {i}, "{draw(st.sampled_from("aäß:#"))}"' for i in range(n)]
    return pc.Trajectory(period * np.arange(k), *values, names)


@given(trajectories())
@settings(max_examples=30, deadline=None)
def test_csv_is_read_back(tmp_path_factory, trajectory):
    path = pc.export_trajectory(trajectory, tmp_path_factory.mktemp("csv") / "some")
    assert path.suffix == ".csv"
    with path.open(encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    n = len(trajectory.joints)
    assert header[0] == "time [s]"
    assert header[1 : n + 1] == [f"{joint} position [rad]" for joint in trajectory.joints]
    assert header[-1] == f"{trajectory.joints[-1]} acceleration [rad/s^2]"
    table = np.array(rows, dtype=float)
    expected = np.column_stack([trajectory.time, trajectory.q, trajectory.qd, trajectory.qdd])
    assert table == pytest.approx(expected, abs=EXACT)


@given(trajectories())
@settings(max_examples=30, deadline=None)
def test_ros_is_json_and_yaml_with_the_same_numbers(tmp_path_factory, trajectory):
    text = pc.export_trajectory(trajectory, tmp_path_factory.mktemp("ros") / "some", "ros").read_text("utf-8")
    message = json.loads(text)
    assert message == yaml.safe_load(text)
    assert set(message) == {"header", "joint_names", "points"}
    assert message["joint_names"] == list(trajectory.joints)
    for point, t, *vectors in zip(
        message["points"], trajectory.time, trajectory.q, trajectory.qd, trajectory.qdd, strict=True
    ):
        when = point["time_from_start"]
        assert 0 <= when["nanosec"] < 10**9
        assert when["sec"] + 1e-9 * when["nanosec"] == pytest.approx(t, abs=1e-9)
        for name, values in zip(("positions", "velocities", "accelerations"), vectors, strict=True):
            assert point[name] == pytest.approx(values, abs=EXACT)
        assert point["effort"] == []


@given(trajectories(joints=6))
@settings(max_examples=20, deadline=None)
def test_urscript_goes_to_the_start_and_serves_each_position(tmp_path_factory, trajectory):
    text = pc.export_trajectory(trajectory, tmp_path_factory.mktemp("ur") / "some", "urscript").read_text("utf-8")
    lines = text.splitlines()
    assert (lines[0], lines[-2:]) == ("def follow_path():", ["end", "follow_path()"])
    first = re.fullmatch(r"  movej\(\[(.*)\], a=0.5, v=0.25\)", lines[1])
    assert np.array(first[1].split(", "), float) == pytest.approx(trajectory.q[0], abs=EXACT)
    moves = [re.fullmatch(r"  servoj\(\[(.*)\], t=(.*), lookahead_time=0.03, gain=500\)", x) for x in lines[2:-3]]
    assert np.array([m[1].split(", ") for m in moves], float) == pytest.approx(trajectory.q, abs=EXACT)
    assert float(moves[0][2]) == pytest.approx(trajectory.period, abs=1e-9)


def test_urscript_refuses_other_arms_and_rates(arm, tmp_path):
    with pytest.raises(InputError, match="six joints"):
        pc.export_trajectory(trajectory_of(np.zeros((5, 2)), arm), tmp_path / "x", "urscript")
    six = pc.load_robot("ur5")
    for h in (0.001, 0.2):
        with pytest.raises(InputError, match="expected from 10 to 500 Hz"):
            pc.export_trajectory(trajectory_of(np.zeros((5, 6)), six, h), tmp_path / "x", "urscript")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("option", "value"), [("format", "rapid"), ("limits", "ignore")])
def test_unknown_choices_are_told(arm, tmp_path, option, value):
    with pytest.raises(pc.UnknownNameError, match=value):
        pc.export_trajectory(trajectory_of(np.zeros((5, 2)), arm), tmp_path / "x", **{option: value})


def test_each_path_of_a_sequence_begins_and_ends_at_rest():
    """No velocity jumps: it changes by the largest acceleration at most, and is the rate of the positions."""
    rate = 250.0
    paths = [pc.Line([0.4, 0.2], [0.5, 0.1], 0.5), pc.Line([0.5, 0.1], [0.47, 0.25], 0.3)]
    task = pc.PathSequence(
        [
            path.with_profile(pc.SmoothStartStop(path, pc.ConstantSpeed(0.5), 4.0, 40.0, start_speed=0.1))
            for path in paths
        ]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plan = pc.plan_trajectory(task, rate)
    assert not plan.qd[0].any()
    assert np.abs(np.diff(plan.qd, axis=0)).max() * rate < 1.1 * np.abs(plan.qdd).max() + 0.01 * rate
    middle = 0.5 * (plan.qd[1:] + plan.qd[:-1])
    np.testing.assert_allclose(np.diff(plan.q, axis=0) * rate, middle, atol=20.0 / rate)
    np.testing.assert_allclose(plan.q[[0, -1]], [[0.4, 0.2], [0.47, 0.25]], atol=1e-3)
    corner = np.linalg.norm(plan.q - [0.5, 0.1], axis=1).argmin()
    assert np.abs(plan.qd[corner]).max() < 0.02
    assert plan.duration > sum(pc.plan_trajectory(path, rate).duration for path in task.paths)
    half = pc.plan_trajectory(task, rate, duration=0.5 * plan.duration)
    count = len(half.time)
    np.testing.assert_allclose(half.q, plan.q[:count], atol=2e-5)  # interpolated between other steps
