"""Time-optimal profiles: what they say of themselves, and of demands that cannot be met."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

from pathcontrol import Circle, InputError, Line, PathTask, TaskError, WaypointPath, load_robot
from pathcontrol.profiles.topp.time_optimal import time_optimal

ARM = load_robot("cicese_2dof")
LINE = Line([0, 0], [1.0, 0.5], 1.0)
SPLINE = WaypointPath(np.random.default_rng(0).uniform(-1.2, 1.2, (6, 2)), 1.0)


def test_it_knows_what_limits_it():
    path = Circle(0.4, 1.0)
    slow = time_optimal(ARM, path, velocity=[0.2, 0.2])
    assert set(slow.limiting) == {"velocity of joint_1", "velocity of joint_2"}
    assert sum(slow.limited_by.values()) == pytest.approx(1.0)
    weak = time_optimal(ARM, path, torque=[150.0, 4.0], velocity=None)
    assert max(weak.limited_by, key=weak.limited_by.get) == "torque of joint_2"
    record = path.with_profile(weak).describe()
    assert record["margin"] == 0.05
    assert json.loads(json.dumps(record))["limited_by"] == weak.limited_by
    assert pickle.loads(pickle.dumps(weak)).limiting == weak.limiting


def test_an_overloaded_joint_is_named_where_it_is():
    arm = ARM.with_payload(5.0, "tool")
    path = Line([0.0, 0.0], [np.pi / 2, 0.0], 1.0)
    with pytest.raises(
        TaskError, match=r"torque limit of joint_2, 13\.5 N m \(15 N m less the margin of 0\.1\)"
    ) as error:
        time_optimal(arm, path, margin=0.1)
    s = float(str(error.value).split("at s = ")[1].split()[0])
    load_there = arm.gravity(path.q_d(s)) + arm.friction.torque(path.dq_d(s))
    assert f"{load_there[1]:.4g}" in str(error.value)
    assert load_there[1] > 13.5
    assert str(np.round(path.q_d(s), 4).tolist()) in str(error.value)


def test_what_the_recheck_cannot_cure_is_refused(monkeypatch):
    monkeypatch.setattr("pathcontrol.profiles.topp.traversal._ROUNDS", 1)
    time_optimal(ARM, SPLINE, points=10)  # with halved cells
    monkeypatch.setattr("pathcontrol.profiles.topp.time_optimal._HALVINGS", 1)
    with pytest.raises(TaskError, match=r"\d+ points do not resolve the path near s = "):
        time_optimal(ARM, SPLINE, points=10)
    time_optimal(ARM, SPLINE, points=1000)


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (
            lambda: time_optimal(ARM, LINE, start_rate=99.0),
            TaskError,
            ["start_rate = 99", "s = 0,", "limit of joint_1"],
        ),
        (
            lambda: time_optimal(ARM, LINE, end_rate=99.0),
            TaskError,
            ["end_rate = 99", "s = 1.11803", "limit of joint_"],
        ),
        (lambda: time_optimal(ARM, LINE, start_rate=0.0), InputError, ["start_rate = 0"]),
        (lambda: time_optimal(ARM, LINE, end_rate=0.1, end_time=0.1), InputError, ["end_rate and end_time"]),
        (lambda: time_optimal(ARM, Circle(1.0, 1.0), end_rate=0.1), InputError, ["end_rate for a closed path"]),
        (lambda: time_optimal(ARM, LINE, margin=1.0), InputError, ["margin = 1"]),
        (lambda: time_optimal(ARM, LINE, torque=[150, 0]), InputError, ["torque limit of joint_2 is 0"]),
        (lambda: time_optimal(ARM, LINE, velocity=[1, -1]), InputError, ["velocity limit of joint_2 is -1"]),
        (lambda: time_optimal(ARM, LINE, velocity=[1, 1, 1]), InputError, ["(3,)", "2 joints"]),
        (lambda: time_optimal(ARM, LINE, acceleration=True), InputError, ["no acceleration limits"]),
        (lambda: time_optimal(ARM, LINE, velocity=None, torque=None), InputError, ["nothing bounds the speed"]),
        (
            lambda: time_optimal(ARM, Line([0, 0], [1, 0], 1.0), velocity=[np.inf, 1], torque=None),
            InputError,
            ["nothing limits the speed at s = 0"],
        ),
        (lambda: time_optimal(ARM, LINE, points=2), InputError, ["points = 2"]),
        (lambda: time_optimal(ARM, Line([0, 0, 0], [1, 1, 1], 1.0)), TaskError, ["Line.q_d", "2 joints"]),
        (lambda: time_optimal(ARM, Endless()), TaskError, ["neither ends nor closes"]),
    ],
)
def test_what_cannot_be_is_refused(make, error, words):
    with pytest.raises(error) as caught:
        make()
    assert all(word in str(caught.value) for word in words), str(caught.value)


class Endless(PathTask):
    def q_d(self, s):
        return np.stack([np.asarray(s), np.asarray(s)], axis=-1)

    def theta(self, s):
        return np.ones_like(s)
