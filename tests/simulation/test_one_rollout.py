"""One rollout is the one in a batch, to the last bit; what classes once said to be asked for it alone is ignored."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pathcontrol import (
    Circle,
    ComputedTorque,
    Ellipse,
    ExtendedMotionPlan,
    Line,
    Lissajous,
    PathControlWarning,
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


def ran(law, q, qd=None, duration=0.15):
    return simulate(law, q, qd, duration=duration, loop=LOOP, engine="pinocchio", progress=False)


def assert_runs_equal(one, other):
    for name in one.data.data_vars:
        assert_array_equal(one.array(name)[0], other.array(name)[0], err_msg=name)


@pytest.mark.parametrize(
    ("kind", "path"), [(law, path) for n in (0, 2) for law, path in zip(LAWS, [*TASKS][n:] + [*TASKS][:n], strict=True)]
)
@settings(max_examples=2, deadline=None)
@given(state=st.lists(st.floats(-0.3, 0.3), min_size=4, max_size=4))
def test_a_rollout_alone_is_the_one_in_a_batch(kind, path, state):
    """Each law on two of the paths."""
    task = TASKS[path]
    law, q = LAWS[kind](task), task.q_d(np.array(task.s0)) + state[:2]
    assert_runs_equal(ran(law, q, state[2:]), ran(law, [q, q - 0.1], state[2:]))


def test_a_class_that_says_single_is_made_with_a_warning_and_works():
    told = []
    for single in (True, False):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")

            class Ring(Circle, single=single):
                """A circle of the user's."""

            class Plan(ExtendedMotionPlan, single=single):
                """A law of the user's."""

        told += caught
        assert_runs_equal(
            ran(Plan(ARM, Ring(1.0, 2.0), 800.0, 60.0, 20.0), [1.0, 0.1]),
            ran(ExtendedMotionPlan(ARM, Circle(1.0, 2.0), 800.0, 60.0, 20.0), [1.0, 0.1]),
        )
    assert [word.category for word in told] == [PathControlWarning] * 4
    assert {word.filename for word in told} == {__file__}
    assert [str(word.message).split()[1] for word in told] == ["Ring", "Plan"] * 2
    assert "leave it out" in str(told[0].message)


def test_a_class_that_does_not_say_it_is_made_without_a_word():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        type("Ring", (Circle,), {})
        type("Plan", (ExtendedMotionPlan,), {})


@pytest.mark.parametrize("k", [20.0, [20.0], [[20.0]]])
@pytest.mark.parametrize("K_p", [800.0, [[800.0]], [[800.0, 800.0]]])
def test_gains_with_a_row_for_the_only_rollout_are_gains(K_p, k):
    q = np.deg2rad([40.0, 70.0])
    assert_runs_equal(
        ran(ExtendedMotionPlan(ARM, TASKS["circle"], K_p, 60.0, k), q),
        ran(ExtendedMotionPlan(ARM, TASKS["circle"], 800.0, 60.0, 20.0), q),
    )


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
