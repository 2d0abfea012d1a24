"""Slips in classes of one's own are told by what was given, what was expected and what to do."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol import InputError, TaskError, UnknownNameError, UrdfError
from pathcontrol.errors import PathControlWarning

TWO = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
LAW = pc.Projection(TWO, CIRCLE, 800.0, [45.0, 100.0])


class Round(pc.PathTask):
    period = 2 * np.pi

    def q_d(self, s):
        return np.stack([np.cos(s), np.sin(s)], axis=-1)

    def theta(self, s):
        return 1.5 + 0 * s


def task_with(**body):
    return type("Own", (Round,), body)()


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"period": "2*pi"}, r"has period = '2\*pi', expected a number"),
        ({"period": np.array([6.28])}, "has period = array.*, expected a number"),
        ({"period": True}, "has period = True, expected a number"),
        ({"period": None, "s_end": "3"}, "has s_end = '3', expected a number"),
        ({"s0": None}, "has s0 = None, expected a number"),
        ({"q_d": lambda self, s: None}, "q_d returns None, expected an array; does it end without a return"),
        ({"theta": lambda self, s: None}, "theta returns None, expected an array; does it end without a return"),
        ({"dq_d": lambda self, s: None}, "dq_d returns None"),
        ({"q_d": lambda self, s: np.stack([np.exp(1j * s)] * 2, -1)}, "q_d gives complex128 numbers, expected real"),
        ({"theta": lambda self, s: "fast"}, "theta gives 'fast', expected an array of numbers"),
        ({"sigma_bar": lambda self, q, near=None: np.arctan2(q[1], q[0])}, r"sigma_bar of q .*; joints come last"),
        ({"sigma_bar": lambda self, q: np.arctan2(q[..., 1], q[..., 0])}, "sigma_bar.* positional argument"),
        ({"sigma_bar": lambda self, q, near=None: np.arctan2(q[..., 0], q[..., 1])}, "away from q; correct it"),
        ({"sigma_bar": lambda self, q, near=None: 0.0}, r"sigma_bar of q .* has shape \(\), expected"),
    ],
)
@pytest.mark.parametrize("law", [pc.Projection, pc.ExtendedMotionPlan])
def test_a_task_of_ones_own(body, said, law):
    gains = (800.0, [45.0, 100.0], 2.0)[: 2 + (law is pc.ExtendedMotionPlan)]
    with pytest.raises(TaskError, match=rf"Own.*{said}"):
        law(TWO, task_with(**body), *gains)


def test_right_ones_are_taken():
    closed_form = {"sigma_bar": lambda self, q, near=None: np.arctan2(q[..., 1], q[..., 0])}
    for body in ({}, {"period": np.float64(2 * np.pi)}, {"theta": lambda self, s: 2}, closed_form):
        pc.check_task(task_with(**body))
        pc.check_task(task_with(**body), 2)
    with pytest.raises(TaskError, match="the path is for 2 joints, the arm has 3"):
        pc.check_task(task_with(), 3)
    with pytest.raises(TaskError, match=r"shape \(\), expected \(n,\)"):
        pc.check_task(task_with(q_d=lambda self, s: s))


class Own(pc.Disturbance):
    def torque(self, t, q, qd):
        return np.zeros(2)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"torque": lambda self, t, q, qd: None}, r"Own.torque .*"),
        ({"torque": lambda self, q, qd: q}, r"Own.torque fails for 1 rollouts of 2 joints: .*argument"),
        ({"torque_factor": lambda self, t: np.ones(3)}, r"Own.torque_factor fails for 1 rollouts of 2 joints: .*shape"),
        ({"torque_factor": lambda self, t: -0.5}, r"Own.torque_factor gives -0.5 at the start, expected shares from 0"),
        ({"torque": lambda self, t, q, qd: q[:, 5]}, r"Own.torque fails for 1 rollouts of 2 joints: index 5"),
        ({"torque": lambda self, t, q, qd: np.full(2, np.nan)}, r"Own.torque gives \[nan, nan\] at the start"),
        ({"jumps": "now"}, "Own.jumps cannot be used: jumps = 'now', expected numbers"),
        ({"jumps": lambda self: [1.0]}, "Own.jumps cannot be used: it is a method: write @property"),
    ],
)
@pytest.mark.parametrize("loop", [None, pc.ContinuousTime()])
@pytest.mark.parametrize("more", [False, True])
def test_a_disturbance_of_ones_own(body, said, loop, more):
    disturbance = type("Own", (pc.Disturbance,), {"torque": Own.torque} | body)()
    if more:
        disturbance = pc.Push([1.0, 1.0]) + disturbance
    with pytest.raises(InputError, match=said):
        pc.simulate(LAW, [0.9, 0.1], duration=0.01, loop=loop, disturbance=disturbance, progress=False)


@pytest.mark.parametrize("jumps", [0.003, [0.003], (0.003,), np.array([0.003])])
def test_jumps_may_be_said_in_any_form(jumps):
    def step(self, t, q, qd):
        return np.array([5.0, 0.0]) * (t >= 0.003)

    own = type("Step", (pc.Disturbance,), {"torque": step, "jumps": jumps})()
    ends = [
        pc.simulate(LAW, [0.9, 0.1], duration=0.01, loop=pc.ContinuousTime(), disturbance=one, progress=False)["q"][
            0, -1
        ]
        for one in (own, pc.Push([5.0, 0.0], start=0.003))
    ]
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-9)


@pytest.mark.parametrize("profile", [1.0, pc.ConstantSpeed, "fast", None])
def test_a_profile_that_is_none(profile):
    with pytest.raises(InputError, match=r"profile .* expected a VelocityProfile: "):
        CIRCLE.with_profile(profile)


def test_a_law_that_forgets_its_base_class():
    class Forgetful(pc.MotionController):
        def __init__(self, robot, task):
            self.gain = 1.0

        def torque(self, q, qd, ref):
            return q

    law = Forgetful(TWO, CIRCLE)
    for run in (
        lambda: pc.simulate(law, [0.9, 0.1], duration=0.1),
        lambda: pc.simulate_sequence([law], [0.9, 0.1], duration=0.1),
    ):
        with pytest.raises(InputError, match=r"Forgetful.__init__ does not call super\(\).__init__\(robot, task\)"):
            run()


@pytest.mark.parametrize(
    ("task", "turns"),
    [
        (pc.Circle(57.3, 114.59), "9.12"),
        (pc.WaypointPath([[0, 0], [30, 40], [60, 20]], speed=20.0), "9.55"),
        (pc.Line([0, 0], [30, 40], speed=20.0), "6.37"),
    ],
)
def test_a_path_in_degrees_is_told_where_joints_have_no_limits(task, turns):
    law = pc.ExtendedMotionPlan(TWO, task, 800.0, [45.0, 100.0], k=2.0)
    with pytest.warns(
        PathControlWarning, match=rf"the path goes to joint_. at .* {turns} turns; did you mean degrees"
    ) as told:
        pc.simulate(law, [0.1, 0.1], duration=0.01, progress=False)
    assert all(way in str(told[0].message) for way in ("np.deg2rad(…)", "'… deg' in a file"))


def test_paths_in_radians_and_those_without_an_end_are_not_questioned(recwarn):
    class Winding(pc.PathTask):
        def q_d(self, s):
            return np.stack([s, 0.1 * np.sin(s)], axis=-1)

        def theta(self, s):
            return 1.0

    for task in (CIRCLE, pc.Line([0, 0], [3, 4], speed=1.0), Winding()):
        law = pc.ExtendedMotionPlan(TWO, task, 800.0, [45.0, 100.0], k=2.0)
        pc.simulate(law, [0.1, 0.1], duration=0.01, progress=False)
    assert not [w for w in recwarn if "turns" in str(w.message)]


@pytest.mark.parametrize("source", [123, None, ["ur5"]])
def test_a_robot_that_is_neither_a_name_nor_a_file(source):
    with pytest.raises(UrdfError, match=r"robot = .*, expected the name of a known robot, the path of a URDF"):
        pc.load_robot(source)


def test_the_closest_name_is_offered():
    with pytest.raises(UnknownNameError, match=r"or the path of a URDF; did you mean 'cicese_2dof'\?"):
        pc.load_robot("cicese_2fod")
    with pytest.raises(UnknownNameError, match=r"did you mean 'tau_noise'\?"):
        pc.tune(lambda p, samples: {}, {"K": [1.0, 2.0]}, ["tau_noize"], progress=False)


def test_a_quantity_with_its_unit_is_told_to_be_a_number_in_python():
    with pytest.raises(InputError, match=r"period = '2\.5 ms', expected numbers in SI units, without a unit"):
        pc.SampledLoop(period="2.5 ms")
    with pytest.raises(InputError, match=r"duration = 'long', expected numbers$"):
        pc.simulate(LAW, [0.9, 0.1], duration="long")


def test_a_law_on_all_paths_of_a_toolpath_simulates_without_a_word_of_numpy(tmp_path):
    (tmp_path / "l.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="40mm" height="30mm" '
        'viewBox="0 0 40 30"><path d="M5 5h20v10M10 20h20" fill="none" stroke="red"/></svg>'
    )
    drawing = pc.read_toolpath(tmp_path / "l.svg", feed=0.1)
    board = [[1, 0, 0, 0.25], [0, 0, -1, -0.05], [0, 1, 0, 0.65], [0, 0, 0, 1]]
    task = pc.ToolpathTask(TWO, "tool", drawing, board, clearance=0.0)
    law = pc.Projection(TWO, task, 800.0, 45.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        pc.simulate(law, task.q_d(np.array(0.0)), duration=0.1, progress=False)
