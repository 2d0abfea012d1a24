"""Batches and the loops over their rollouts are the same to the last bit, for every law, path and friction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pathcontrol import (
    Circle,
    ComputedTorque,
    Controller,
    Coulomb,
    ExtendedMotionPlan,
    InputError,
    Lissajous,
    PathTask,
    PDPlus,
    Projection,
    Push,
    Run,
    SampledLoop,
    SlotineLi,
    Stribeck,
    Viscous,
    WaypointPath,
    load_robot,
    simulate,
)

N = 9
ARM = load_robot("cicese_2dof")
FRICTION = [
    ARM.friction,
    Viscous([2.0, 0.2]) + Stribeck([4.0, 1.0], [6.0, 1.5], [0.1, 0.2]),
    Viscous([2.0, 0.2]) + Coulomb([3.0, 1.0]) + Stribeck([4.0, 1.0], [6.0, 1.5], [0.1, 0.2]),
]
TASKS = [
    Circle(1.0, 2.0),
    Lissajous([0.8, 0.6], [1, 2], 1.0),
    WaypointPath([[0.0, 0.0], [1.0, 0.3], [0.6, 1.0]], 1.0, closed=True),
]
RNG = np.random.default_rng(11)
HIGH, LOW = RNG.uniform(400, 900, (N, 2)), RNG.uniform(30, 60, (N, 2))
PLAN = RNG.uniform(0, 30, N)


def law(kind: str, task: PathTask, rows: slice) -> Controller:
    """A law with gains for each of some rollouts."""
    high, low = HIGH[rows], LOW[rows]
    if kind == "plan":
        return ExtendedMotionPlan(ARM, task, high, low, PLAN[rows])
    if kind == "projection":
        return Projection(ARM, task, high[:, :1], low, start="nearest")
    if kind == "sliding":
        return SlotineLi(ARM, task, low / 4, low / 3)
    return {"tracking": ComputedTorque, "pd": PDPlus}[kind](ARM, task, high, low, friction="full")


def run(kind: str, task: PathTask, friction: int, rows: slice) -> Run:
    q = task.q_d(np.linspace(0, 5, N)) + np.random.default_rng(1).normal(scale=0.1, size=(N, 2))
    loop = SampledLoop(encoders=True, velocity="difference", torque_limits=[500.0, 50.0], delay=1e-3)
    plant = ARM.with_friction(FRICTION[friction])
    return simulate(law(kind, task, rows), q[rows], duration=0.1, loop=loop, plant=plant, progress=False)


@settings(max_examples=10)
@given(
    st.sampled_from(["plan", "projection", "sliding", "tracking", "pd"]),
    st.sampled_from(TASKS),
    st.integers(0, len(FRICTION) - 1),
    st.sets(st.integers(1, N - 1), min_size=1, max_size=4),
)
def test_rollouts_with_gains_of_their_own_do_not_know_of_each_other(kind, task, friction, cuts):
    whole = run(kind, task, friction, slice(0, N))
    parts = [run(kind, task, friction, slice(a, b)) for a, b in pairwise([0, *sorted(cuts), N])]
    for name in whole.data.data_vars:
        assert_array_equal(np.concatenate([part.array(name) for part in parts]), whole.array(name), err_msg=name)


def test_gains_of_another_number_of_rollouts_are_refused(circle):
    with pytest.raises(
        InputError,
        match=r"K_p of shape \(9, 2\) and .* a row for each of 4",
    ):
        simulate(law("plan", circle, slice(0, N)), circle.q_d(np.zeros(4)), duration=0.1, progress=False)


@pytest.mark.parametrize("kind", ["plan", "projection", "sliding", "tracking", "pd"])
def test_one_state_is_that_of_all_rollouts_of_gains(kind):
    q, qd, settings = np.array([0.7, 1.2]), np.array([0.1, -0.2]), {"duration": 0.05, "progress": False}
    one = simulate(law(kind, TASKS[0], slice(None)), q, qd, **settings)
    every = simulate(law(kind, TASKS[0], slice(None)), np.tile(q, (N, 1)), qd, **settings)
    assert one.rollouts == N
    for name in every.data.data_vars:
        assert_array_equal(one.array(name), every.array(name))


@pytest.mark.parametrize(
    "push", [Push(np.ones((4, 2)), [0.0, 0.01, 0.02, 0.03], 0.02), Push([5.0, 1.0], PLAN[:4], 0.1)]
)
def test_one_state_is_that_of_all_rollouts_of_a_disturbance(push):
    plain = ExtendedMotionPlan(ARM, TASKS[0], 800.0, 60.0, 20.0)
    one = simulate(plain, [0.7, 1.2], duration=0.05, disturbance=push, progress=False)
    every = simulate(plain, np.tile([0.7, 1.2], (4, 1)), duration=0.05, disturbance=push, progress=False)
    assert_array_equal(one.array("q"), every.array("q"))


def test_rows_of_gains_and_of_a_disturbance_have_to_be_as_many():
    gains = ExtendedMotionPlan(ARM, TASKS[0], HIGH[:3], LOW[:3], 20.0)
    with pytest.raises(InputError, match="initial states"):
        simulate(gains, [0.7, 1.2], duration=0.05, disturbance=Push(np.ones((4, 2))), progress=False)
