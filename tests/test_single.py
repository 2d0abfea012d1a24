"""One rollout is asked for as a single state where that is said to be the same; it is, to the last bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pathcontrol import (
    Circle,
    ComputedTorque,
    Controller,
    Ellipse,
    ExtendedMotionPlan,
    InputError,
    Line,
    Lissajous,
    PathTask,
    PDPlus,
    Projection,
    SampledLoop,
    SlotineLi,
    load_robot,
    simulate,
)

ARM = load_robot("cicese_2dof")
TASKS = {
    "circle": Circle(1.0, 2.0),
    "clockwise": Circle(0.4, 1.0, center=[0.3, -0.2], clockwise=True),
    "ellipse": Ellipse((0.9, 0.5), 1.5, center=[0.1, 0.0]),
    "eight": Lissajous([0.5, 0.8], [1, 2], 1.2),
    "line": Line([0.2, -0.4], [0.6, 0.3], 1.5),
}
LAWS = {
    "extended": lambda task: ExtendedMotionPlan(ARM, task, 800.0, [45.0, 100.0], 20.0),
    "computed": lambda task: ComputedTorque(ARM, task, [800.0, 900.0], 40.0, friction="full"),
    "pd+": lambda task: PDPlus(ARM, task, 500.0, 30.0, friction="none"),
    "slotine": lambda task: SlotineLi(ARM, task, 10.0, [20.0, 5.0]),
    "projection": lambda task: Projection(ARM, task, 800.0, [45.0, 100.0]),
}
LOOP = SampledLoop(encoders=True, velocity="difference", torque_limits=True)


def subclasses(base):
    for kind in base.__subclasses__():
        yield kind
        yield from subclasses(kind)


def assert_runs_equal(one, other):
    for name in one.data.data_vars:
        assert_array_equal(one.array(name)[0], other.array(name)[0], err_msg=name)


def test_all_that_say_so_are_tested_here():
    laws = {type(make(TASKS["circle"])) for make in LAWS.values()}
    for base, tested in ((PathTask, {type(task) for task in TASKS.values()}), (Controller, laws)):
        says = {kind for kind in subclasses(base) if kind.single and kind.__module__.startswith("pathcontrol.")}
        assert says <= tested
        assert says


@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
@pytest.mark.parametrize("make", LAWS.values(), ids=LAWS)
@settings(max_examples=5, deadline=None)
@given(state=st.lists(st.floats(-0.3, 0.3), min_size=4, max_size=4))
def test_a_rollout_alone_is_the_one_in_a_batch(make, task, state):
    law, q = make(task), task.q_d(np.array(task.s0)) + state[:2]
    alone = simulate(law, q, state[2:], duration=0.15, loop=LOOP, progress=False)
    batch = simulate(law, [q, q - 0.1], state[2:], duration=0.15, loop=LOOP, progress=False)
    assert_runs_equal(alone, batch)


@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
@given(s=st.floats(-50.0, 50.0))
def test_a_task_gives_for_a_number_what_it_gives_for_an_array(task, s):
    one, many = task.at(np.float64(s)), task.at(np.array([0.3, s]))
    for a, b in zip(one, many, strict=True):
        assert_array_equal(a, b[1])


class Powers(Circle):
    """Powers of a number have another last bit than those of an array."""

    def theta(self, s):
        return 1.0 + 0.1 * np.abs(np.sin(s)) ** 2.7

    def dtheta(self, s):
        return 0.27 * np.abs(np.sin(s)) ** 1.7 * np.cos(s) * np.sign(np.sin(s))

    def at(self, s):
        return super().at(s)._replace(theta=self.theta(s), dtheta=self.dtheta(s))


class Proud(ExtendedMotionPlan):
    """A law that works on batches (N, n) only."""

    def law(self, t, q, qd, z):
        assert q.ndim == 2
        return super().law(t, q, qd, z)


@pytest.mark.parametrize("kind", [ExtendedMotionPlan, Proud])
def test_what_does_not_say_so_is_asked_for_arrays(kind):
    law = kind(ARM, Powers(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    q = np.deg2rad([40.0, 70.0])
    alone = simulate(law, q, duration=0.5, loop=LOOP, progress=False)
    assert_runs_equal(alone, simulate(law, [q, q], duration=0.5, loop=LOOP, progress=False))


class WronglySingleLaw(ExtendedMotionPlan, single=True):
    def law(self, t, q, qd, z):
        out = super().law(t, q, qd, z)
        return out._replace(tau=out.tau - q[:, :1])


class WronglySingleTask(Circle, single=True):
    def at(self, s):
        return super().at(s)._replace(theta=np.array([2.0 for _ in s]))


@pytest.mark.parametrize(
    ("kind", "task", "said"),
    [
        (WronglySingleLaw, TASKS["circle"], "WronglySingleLaw.*too many indices.*single=True"),
        (ExtendedMotionPlan, WronglySingleTask(1.0, 2.0), "WronglySingleTask.*iteration over a 0-d.*single=True"),
    ],
)
def test_who_is_wrong_about_it_is_told_so(kind, task, said):
    law = kind(ARM, task, 800.0, [45.0, 100.0], 20.0)
    with pytest.raises(InputError, match=said):
        simulate(law, [1.0, 0.0], duration=0.1, progress=False)


@pytest.mark.parametrize("k", [20.0, [20.0], [[20.0]]])
@pytest.mark.parametrize("K_p", [800.0, [[800.0]], [[800.0, 800.0]]])
def test_gains_with_a_row_for_the_only_rollout_are_gains(K_p, k):
    q = np.deg2rad([40.0, 70.0])
    rows = simulate(ExtendedMotionPlan(ARM, TASKS["circle"], K_p, 60.0, k), q, duration=0.1, progress=False)
    plain = simulate(ExtendedMotionPlan(ARM, TASKS["circle"], 800.0, 60.0, 20.0), q, duration=0.1, progress=False)
    assert_runs_equal(rows, plain)


class Bare(PathTask):
    """A path whose derivatives are left to the library; it is open, so that they are one-sided at its ends."""

    s_end = 3.0

    def q_d(self, s):
        return np.stack([1.3 * np.cos(s), np.sin(2 * s)], axis=-1)

    def theta(self, s):
        return 1.0 + 0.1 * np.sin(s)


@pytest.mark.parametrize("derivative", ["dq_d", "ddq_d", "dtheta"])
@given(s=st.lists(st.floats(0.0, 3.0), min_size=2, max_size=9))
def test_derivatives_of_a_path_do_not_depend_on_the_batch(derivative, s):
    function = getattr(Bare(), derivative)
    assert_array_equal(function(np.array(s)), [function(np.array([one]))[0] for one in s])
