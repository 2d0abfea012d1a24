"""The speed of a tool and speed within limits: what these profiles promise, all along random paths."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import linprog
from strategies import floats, tasks

from pathcontrol import (
    Circle,
    ConstantSpeed,
    InputError,
    Line,
    PathTask,
    SmoothStartStop,
    TaskError,
    UnknownNameError,
    WaypointPath,
    check_task,
    load_robot,
)
from pathcontrol.profiles.limited.limited import limited
from pathcontrol.profiles.limited.motion_limit import MotionLimit
from pathcontrol.profiles.limited.two_pass import Lines, largest_sequence
from pathcontrol.profiles.motion import JointMotion, ToolMotion
from pathcontrol.profiles.tool_speed import ToolSpeed
from pathcontrol.profiles.topp.time_optimal import time_optimal

FRAMES = {"cicese_2dof": "tool", "ur5": "tool0", "panda": "panda_hand_tcp"}
every_arm = pytest.mark.parametrize("name", FRAMES)
few = settings(max_examples=6)
seeds = st.integers(0, 9999)


@cache
def arm(name):
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return load_robot(name, lock=fingers if name == "panda" else {})


def spline(seed, n, closed):
    """A path through random postures, some radians long and well bent."""
    return WaypointPath(np.random.default_rng(seed).uniform(-1.5, 1.5, (6, n)), 1.0, closed=closed)


def along(path, motion, profile, count=3001):
    """s, and v, v̇ and κv² of a motion at irregular s; ``at`` must agree with theta and dtheta on the way."""
    s = np.sort(np.random.default_rng(0).uniform(*path.one_traverse, count))
    theta, dtheta = profile.at(path.dq_d(s), path.ddq_d(s), path, s)
    assert np.array_equal(theta, profile.theta(path, s))
    assert np.array_equal(dtheta, profile.dtheta(path, s))
    dp, ddp = motion.along(path, s)
    length = np.linalg.norm(dp, axis=-1)
    rate = ddp * theta[:, None] ** 2 + dp * (theta * dtheta)[:, None]  # p̈ by the chain rule
    tangent = dp / length[:, None]
    tangential = (rate * tangent).sum(-1)
    return s, length * theta, tangential, np.linalg.norm(rate - tangential[:, None] * tangent, axis=-1)


# --- the speed of a tool --------------------------------------------------------------------------------------


@every_arm
@few
@given(seed=seeds, speed=floats(0.01, 2.0))
def test_the_tool_covers_the_distance_speed_times_time(name, seed, speed):
    robot = arm(name)
    path = spline(seed, robot.n, closed=True)
    profile = ToolSpeed(robot, FRAMES[name], speed)
    s, v, tangential, _ = along(path, ToolMotion(robot, FRAMES[name]), profile, 200)
    assert np.allclose(v, speed, rtol=1e-12)
    # what is left of v̇ is rounding of two terms that cancel
    assert np.abs(tangential).max() < 1e-9 * (speed**2 + (profile.theta(path, s) ** 2).max())


def test_motion_at_the_feed_rate_measured_on_the_poses():
    robot, speed, duration = arm("cicese_2dof"), 0.3, 2.0
    path = Circle(0.4, 1.0, center=[0.3, 1.5]).with_profile(ToolSpeed(robot, "tool", 0.3))
    ode = solve_ivp(lambda t, s: path.theta(s), (0, duration), [0.0], rtol=1e-11, atol=1e-12, dense_output=True)
    s = ode.sol(np.linspace(0, duration, 20001))[0]
    steps = np.diff(robot.frame_pose(path.q_d(s), "tool")[:, :3, 3], axis=0)
    # chords are shorter than arcs by (vΔt)²κ²/24, some 1e-9 here
    assert np.linalg.norm(steps, axis=-1).sum() == pytest.approx(speed * duration, rel=1e-7)


@few
@given(tasks())
def test_the_slope_of_the_tool_speed_agrees_with_differences(task):
    path = task.with_profile(ToolSpeed(arm("cicese_2dof"), "tool", 0.5))
    s, h = np.linspace(0, 6, 61), 1e-6
    difference = (path.theta(s + h) - path.theta(s - h)) / (2 * h)
    # where the tool hardly moves ϑ is as curved as it is large: h²ϑ''' grows with the fourth power of ϑ
    assert np.allclose(path.dtheta(s), difference, rtol=1e-5, atol=1e-6 * (1 + path.theta(s) ** 4))


def test_tool_speed_refuses_what_does_not_move_the_tool():
    robot = arm("cicese_2dof")
    elbow = Line([0.3, 0.0], [0.3, 1.0], 1.0)  # turns the second link about its own origin
    with pytest.raises(TaskError, match=r"does not move the origin of 'link_2' at s = 0.25.*0.1 m/s.*name a frame"):
        ToolSpeed(robot, "link_2", 0.1).theta(elbow, np.array(0.25))
    with pytest.raises(UnknownNameError, match="no frame 'hand'"):
        ToolSpeed(robot, "hand", 0.1)
    with pytest.raises(InputError, match="speed = 0"):
        ToolSpeed(robot, "tool", 0.0)


# --- within limits --------------------------------------------------------------------------------------------

JOINTS = {"speed": 1.2, "tangential": 4.0, "normal": 3.0}
TOOL = {"speed": 0.3, "tangential": 0.8, "normal": 0.5}


@few
@given(seeds, st.sampled_from([2, 6]), st.booleans())
def test_limits_are_kept_and_used_everywhere(seed, n, closed):
    path = spline(seed, n, closed)
    profile = limited(path, MotionLimit(**JOINTS))
    _, v, tangential, normal = along(path, JointMotion(), profile)
    shares = np.stack([v / JOINTS["speed"], np.abs(tangential) / JOINTS["tangential"], normal / JOINTS["normal"]])
    # between the quarters of the cells the limits hold to second order in their width
    assert shares.max() < 1 + 1e-4
    # the fastest profile uses up a limit everywhere, but for what a cell whose ends do loses between them
    assert (shares.max(0) < 0.95).mean() < 0.01
    finer = limited(path, MotionLimit(**JOINTS), points=4000)
    assert 0 <= profile.traversal_time / finer.traversal_time - 1 < 1e-3
    check_task(path.with_profile(profile), n)


@pytest.mark.parametrize("name", ["cicese_2dof", "ur5"])
@settings(max_examples=4)
@given(seed=seeds, closed=st.booleans())
def test_limits_on_joints_and_tool_at_once(name, seed, closed):
    robot = arm(name)
    path, tool = spline(seed, robot.n, closed), ToolMotion(robot, FRAMES[name])
    velocity = np.linspace(0.5, 1.0, robot.n)
    profile = limited(path, MotionLimit(**JOINTS), MotionLimit(tool, **TOOL), velocity=velocity)
    shares = []
    for motion, limit in ((JointMotion(), JOINTS), (tool, TOOL)):
        s, v, tangential, normal = along(path, motion, profile, 1001)
        shares += [v / limit["speed"], np.abs(tangential) / limit["tangential"], normal / limit["normal"]]
    shares += list((np.abs(path.dq_d(s)) * profile.theta(path, s)[:, None] / velocity).T)
    assert np.max(shares) < 1 + 2e-4
    assert (np.max(shares, axis=0) < 0.95).mean() < 0.01


@few
@given(floats(0.1, 3.0), floats(0.1, 5.0), floats(0.5, 20.0))
def test_a_line_is_a_trapezoid(length, speed, a):
    line = Line([0.0, 0.0], [0.6 * length, 0.8 * length], 1.0)
    profile = limited(line, MotionLimit(speed=speed, tangential=a))
    first, last = 2.5e-3 * a, 2.5e-4 * a
    s = profile.s
    squared = np.minimum(first**2 + 2 * a * s, last**2 + 2 * a * (length - s))
    assert np.allclose(profile.squared, np.minimum(squared, speed**2), rtol=1e-9)


@few
@given(floats(0.1, 2.0), floats(0.1, 9.0), floats(1e-6, 1e-3), floats(1e-3, 1e-2))
def test_curvature_and_chord_on_a_circle(radius, normal, error, period):
    by_normal = limited(Circle(radius, 1.0), MotionLimit(normal=normal))
    assert np.allclose(by_normal.squared, normal / radius, rtol=1e-9)
    by_chord = limited(Circle(radius, 1.0), MotionLimit(chord_error=error, control_period=period))
    assert np.allclose(by_chord.squared * radius**2, 8 * error * radius / period**2, rtol=1e-9)


@settings(max_examples=3)
@given(seeds, st.booleans())
def test_the_chords_of_control_periods_stay_within_their_tolerance(seed, closed):
    error, period = 1e-5, 0.01
    path = spline(seed, 3, closed)
    profile = limited(path, MotionLimit(speed=2.0, chord_error=error, control_period=period))
    ode = solve_ivp(
        lambda t, s: profile.theta(path, s), (0, 0.98 * profile.traversal_time), [path.s0], rtol=1e-9, max_step=period
    )
    s = np.interp(np.arange(0, ode.t[-1], period / 16), ode.t, ode.y[0])
    s = s[: len(s) // 16 * 16 + 1]
    p = path.q_d(s)
    arcs = np.stack([p[k : len(p) - 16 + k : 16] for k in range(17)], axis=1)  # 17 points of each control period
    chord = arcs[:, -1] - arcs[:, 0]
    chord /= np.linalg.norm(chord, axis=-1, keepdims=True)
    away = arcs - arcs[:, :1]
    away = np.linalg.norm(away - (away * chord[:, None]).sum(-1, keepdims=True) * chord[:, None], axis=-1).max(1)
    # κ changes a little within one control period, and so does ϑ
    assert 0.9 * error < away.max() < 1.03 * error


@few
@given(seeds, floats(0.3, 3.0))
def test_time_scaling(seed, factor):
    """Twice the speed and four times the acceleration are the same motion in half the time."""
    path = spline(seed, 3, closed=True)
    slow = limited(path, MotionLimit(**JOINTS))
    fast = limited(path, MotionLimit(speed=1.2 * factor, tangential=4.0 * factor**2, normal=3.0 * factor**2))
    assert np.allclose(fast.squared, factor**2 * slow.squared, rtol=1e-9)


class Backwards(PathTask):
    """A closed path gone the other way."""

    def __init__(self, path):
        self.path, self.s0, self.period = path, -path.s0 - path.period, path.period

    knots = property(lambda self: -self.path.knots[::-1])

    def q_d(self, s):
        return self.path.q_d(-s)

    def dq_d(self, s):
        return -self.path.dq_d(-s)

    def ddq_d(self, s):
        return self.path.ddq_d(-s)

    def theta(self, s):
        return self.path.theta(-s)


@few
@given(seeds)
def test_a_path_gone_backwards_is_as_fast(seed):
    path = spline(seed, 3, closed=True)
    there, back = (limited(p, MotionLimit(**JOINTS)) for p in (path, Backwards(path)))
    s = np.linspace(*path.one_traverse, 500)
    assert np.allclose(back.theta(None, -s), there.theta(None, s), rtol=1e-4)


@few
@given(seeds, st.sampled_from(list(JOINTS)), floats(1.0, 2.0), st.booleans())
def test_more_is_never_slower(seed, name, factor, closed):
    path = spline(seed, 3, closed)
    less, more = (limited(path, MotionLimit(**JOINTS | {name: f * JOINTS[name]})) for f in (1.0, factor))
    s = np.linspace(*path.one_traverse, 500)
    # cells may be halved elsewhere, which changes the chords by 5 % of ϑ² at most
    assert (more.theta(path, s) > 0.975 * less.theta(path, s)).all()
    assert more.traversal_time < less.traversal_time * (1 + 1e-4)


def test_a_corner_between_two_points_of_the_table_is_found():
    class Corner(PathTask):
        s0, s_end, size = -1.0, 1.0, 2e-3

        def q_d(self, s):
            return np.stack([s, np.sqrt(s**2 + self.size**2)], axis=-1)

        def theta(self, s):
            return np.ones_like(s)

    path = Corner()
    profile = limited(path, MotionLimit(**JOINTS), points=100)  # one point each 0.02
    s = np.linspace(-0.03, 0.03, 2001)
    root = np.sqrt(s**2 + path.size**2)
    curvature = path.size**2 / root**3 / (1 + (s / root) ** 2) ** 1.5
    v = profile.theta(path, s) * np.sqrt(1 + (s / root) ** 2)
    assert (curvature * v**2).max() < 1.01 * JOINTS["normal"]
    assert v[1000] ** 2 == pytest.approx(JOINTS["normal"] * path.size, rel=0.05)


@settings(max_examples=30)
@given(seeds, st.booleans())
def test_the_sweeps_find_the_optimum_of_the_linear_program(seed, closed):
    rng = np.random.default_rng(seed)
    cells, lines = 30, 2
    up, down = (Lines(*rng.uniform([[[0.8]], [[0.02]]], [[[1.2]], [[0.2]]], (2, lines, cells))) for _ in range(2))
    ceiling = rng.uniform(0.1, 3.0, cells + 1)
    A, b = [], []
    for bounds, start, end in ((up, 0, 1), (down, 1, 0)):
        for slope, offset in zip(*bounds, strict=True):
            rows = np.zeros((cells, cells + 1))
            rows[np.arange(cells), np.arange(cells) + end] = 1
            rows[np.arange(cells), np.arange(cells) + start] = -slope
            A.append(rows)
            b.append(offset)
    ring = {"A_eq": np.eye(cells + 1)[:1] - np.eye(cells + 1)[-1:], "b_eq": [0.0]} if closed else {}
    best = linprog(-np.ones(cells + 1), np.concatenate(A), np.concatenate(b), bounds=[(0, c) for c in ceiling], **ring)
    assert np.allclose(largest_sequence(ceiling, up, down, closed), best.x, rtol=1e-6, atol=1e-8)


def test_velocity_limits_alone_are_met_by_the_slowest_joint():
    path, velocity = spline(1, 3, True), np.array([1.0, 2.0, np.inf])
    profile = limited(path, velocity=velocity)
    rates = (np.abs(path.dq_d(profile.s)) / velocity).max(-1)
    share = profile.theta(path, profile.s) * rates
    assert share.max() <= 1 + 1e-12
    # where two joints change places the chord is lowered below the kink, by 5 % of ϑ² at most
    assert share.min() > 0.975
    assert np.median(share) > 1 - 1e-4


def test_start_rate():
    line = Line([0.0, 0.0], [1.0, 0.0], 1.0)
    limit = MotionLimit(speed=1.0, tangential=2.0)
    assert limited(line, limit, start_rate=0.3).theta(line, np.array(0.0)) == pytest.approx(0.3)
    assert limited(line, limit, start_rate=30.0).theta(line, np.array(0.0)) == pytest.approx(1.0)


class Endless(Circle):
    period = None


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (MotionLimit, InputError, ["limits nothing", "speed, tangential, normal, chord_error"]),
        (partial(MotionLimit, speed=-1.0), InputError, ["speed = -1"]),
        (partial(MotionLimit, speed=1.0, control_period=0.0), InputError, ["control_period = 0"]),
        (lambda: limited(Circle(1.0, 1.0)), InputError, ["nothing limits the speed", "MotionLimit"]),
        (lambda: limited(Circle(1.0, 1.0), MotionLimit(tangential=1.0)), InputError, ["nothing limits the speed"]),
        (lambda: limited(Circle(1.0, 1.0), velocity=[1.0]), InputError, ["velocity has shape (1,)", "2 joints"]),
        (lambda: limited(Circle(1.0, 1.0), velocity=[1.0, 0.0]), InputError, ["velocity = [1.0, 0.0]"]),
        (lambda: limited(Circle(1.0, 1.0), velocity=[1.0, 1.0], points=0), InputError, ["points = 0"]),
        (lambda: limited(Line([0.0], [1.0], 1.0), MotionLimit(speed=1.0), start_rate=0), InputError, ["start_rate"]),
        (lambda: limited(Endless(1.0, 1.0), MotionLimit(speed=1.0)), TaskError, ["Endless", "s_end"]),
        (lambda: limited(Line([0.3, 0.0], [0.3, 1.0], 1.0), elbow()), TaskError, ["'link_2'", "stands still at s = 0"]),
    ],
)
def test_bad_limits(make, kind, words):
    with pytest.raises(kind) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


class Wall(PathTask):
    """A path with a stretch of NaN, or with the joints first."""

    s_end = 2.0

    def __init__(self, first):
        self.first = first

    def q_d(self, s):
        return np.stack([s, s]) if self.first else np.stack([s, np.where(np.abs(s - 0.9) < 0.1, np.nan, 0 * s)], -1)

    def theta(self, s):
        return np.ones_like(s)


@pytest.mark.parametrize(
    ("first", "words"), [(False, r"Wall\.d?q_d\(s=.*nan"), (True, r"Wall\.q_d .*put the joints last")]
)
@pytest.mark.parametrize(
    "use",
    [
        lambda path: limited(path, MotionLimit(speed=1.0, tangential=1.0, normal=1.0)),
        lambda path: SmoothStartStop(path, ConstantSpeed(1.0), acceleration=1.0, jerk=10.0),
        lambda path: time_optimal(arm("cicese_2dof"), path),
        PathTask.arc_length,
        PathTask.by_arc_length,
    ],
)
def test_a_path_without_numbers_or_with_the_joints_first_is_refused_at_once(use, first, words):
    with pytest.raises(TaskError, match=words):
        use(Wall(first))


def elbow():
    return MotionLimit(ToolMotion(arm("cicese_2dof"), "link_2"), speed=0.1, tangential=1.0)


def test_profiles_describe_themselves():
    profile = limited(Circle(1.0, 1.0), MotionLimit(speed=2.0))
    assert profile.describe() == {"profile": "TabulatedProfile", "knots": 1001, "traversal_time": pytest.approx(np.pi)}
    told = Circle(1.0, 1.0).with_profile(ToolSpeed(arm("cicese_2dof"), "tool", 0.5)).describe()
    assert (told["profile"], told["frame"], told["speed"]) == ("ToolSpeed", "tool", 0.5)
    assert ConstantSpeed(1.0).describe() == {"profile": "ConstantSpeed", "speed": 1.0}
