"""Each rollout its own task: to the last bit what it is alone, whatever the others are."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from strategies import tasks as random_tasks

from pathcontrol import (
    Circle,
    ComputedTorque,
    ConstantSpeed,
    ContinuousTime,
    Controller,
    Ellipse,
    ExtendedMotionPlan,
    InputError,
    Line,
    Lissajous,
    PathSequence,
    PathTask,
    PDPlus,
    Projection,
    Run,
    SampledLoop,
    SlotineLi,
    TaskBatch,
    TaskError,
    WaypointPath,
    end_error,
    load_robot,
    metrics,
    simulate,
    simulate_sequence,
)

ARM = load_robot("cicese_2dof")
LOOP = SampledLoop(encoders=True, velocity="difference", torque_limits=True)
LAWS = {
    "plan": lambda task: ExtendedMotionPlan(ARM, task, 800.0, [45.0, 100.0], 20.0),
    "follow": lambda task: Projection(ARM, task, 800.0, [45.0, 100.0]),
    "nearest": lambda task: Projection(ARM, task, 800.0, [45.0, 100.0], branch="nearest"),
    "tracking": lambda task: ComputedTorque(ARM, task, 800.0, [45.0, 100.0]),
    "pd": lambda task: PDPlus(ARM, task, 300.0, 30.0, friction="full", start="nearest"),
    "sliding": lambda task: SlotineLi(ARM, task, 10.0, [5.0, 2.0]),
}


class Figure(PathTask):
    """A user's closed path whose numbers broadcast; derivatives are left to the library."""

    period = 2 * np.pi

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height

    def q_d(self, s):
        return np.stack([self.width * np.cos(s), self.height * np.sin(s) * (2 + np.sin(s))], axis=-1)

    def theta(self, s):
        return (1.5 + np.sin(s) / 2) / self.width


class Scalars(Figure):
    """It works with plain numbers only."""

    def theta(self, s):
        return (1.5 + np.sin(s) / 2) / (math.sqrt(self.width) if self.width > 1 else self.width)


@dataclass
class Hill(PathTask):
    """An open path of the user's with a projection of its own, and a domain that differs."""

    length: float
    rise: float

    def __post_init__(self) -> None:
        self.s_end = self.length

    def q_d(self, s):
        return np.stack([s, self.rise * s * s], axis=-1)

    def theta(self, s):
        return 0.5 + 0.1 * np.cos(s)


RNG = np.random.default_rng(5)
SIZES = RNG.uniform(0.4, 1.4, (5, 2))
POINTS = [np.cumsum(RNG.uniform(0.2, 0.5, (4, 2)), axis=0) for _ in range(3)]
WAY = WaypointPath(POINTS[0], 1.0)
SHARED = Circle(0.8, 1.0)
#: tasks of one class that differ in numbers
ALIKE: dict[str, list[PathTask]] = {
    "circles": [Circle(a, 2 * b, center=[a, b]) for a, b in SIZES],
    "ellipses": [Ellipse(size, size[0]) for size in SIZES],
    "eights": [Lissajous(size, [1, 2], size[0], phases=[0.0, size[1] / 4]) for size in SIZES],
    "periods": [Lissajous([0.8, 0.5], f, 1.0) for f in ([1, 2], [2, 4], [3, 6])],
    "lines": [Line([0.0, b], [0.2 * a, 0.1], 2.0) for a, b in SIZES],
    "moved": [Lissajous([0.8, 0.5], [1, 2], 1.0).scaled(s).shifted(s).reversed() for s in SIZES],
    "sections": [Circle(a, 2.0).between(a, a + b / 4) for a, b in SIZES],
    "speeds": [WAY.with_profile(ConstantSpeed(speed)) for speed in (0.5, 1.0, 1.5)],
    "figures": [Figure(a, b / 4) for a, b in SIZES],
    "hills": [Hill(a / 4, b) for a, b in SIZES],
}
#: other tasks
OTHERS: dict[str, list[PathTask]] = {
    "ways": [WaypointPath(points, 1.0) for points in POINTS],
    "mixed": [
        SHARED,
        Ellipse([0.9, 0.5], 1.0),
        SHARED,
        Circle(1.1, 1.5),
        Figure(0.8, 0.3),
        Circle(0.7, 1, clockwise=True),
    ],
    "scalars": [Scalars(a, b / 4) for a, b in SIZES],
}
FAMILIES = ALIKE | OTHERS


def begin(tasks: list[PathTask]) -> np.ndarray:
    """Postures somewhat beside where the tasks begin."""
    return np.add([task.q_d(np.array(task.s0)) for task in tasks], [0.02, -0.03])


def ran(law: Controller, q: np.ndarray, duration: float = 0.03, **options) -> Run:
    return simulate(law, q, duration=duration, progress=False, **({"loop": LOOP} | options))


def assert_row_is(together: Run, i: int, alone: Run) -> None:
    samples = len(alone.time)
    for name in together.data.data_vars:
        whole = together.array(name)[i][:samples]
        assert_array_equal(whole, alone.array(name)[0], err_msg=f"{name} of rollout {i}")
    assert_array_equal(together.finish_time[i], alone.finish_time[0])


# --- one by one -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["plan", "follow"])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_rollout_is_its_task_alone(family, law):
    """One law in each engine; in the next family it is the other one."""
    engine = ("pinocchio", "compiled")[(list(FAMILIES).index(family) + (law == "plan")) % 2]
    tasks = FAMILIES[family]
    q = begin(tasks)
    together = ran(LAWS[law](TaskBatch(tasks)), q, engine=engine)
    assert together.config["engine"] == engine
    for i, task in enumerate(tasks):
        assert_row_is(together, i, ran(LAWS[law](task), q[i], engine=engine))


@pytest.mark.parametrize("law", LAWS)
def test_with_any_law(law):
    for tasks in (OTHERS["mixed"], ALIKE["lines"]):
        q = begin(tasks)
        together = ran(LAWS[law](TaskBatch(tasks)), q)
        for i, task in enumerate(tasks):
            assert_row_is(together, i, ran(LAWS[law](task), q[i]))


def test_an_arm_that_was_pushed_away_is_captured_by_a_branch_of_its_own_path():
    tasks = [*ALIKE["eights"], *ALIKE["eights"][:1]]
    q = np.stack([task.q_d(np.array(2.5)) for task in tasks])
    q[-1] = tasks[-1].q_d(np.array(0.0))
    law = lambda task: Projection(ARM, task, 800.0, [45.0, 100.0], start="s0")  # noqa: E731
    together = ran(law(TaskBatch(tasks)), q)
    assert (together.array("s")[:-1, 0] > 1.0).all()  # from s0 = 0
    for i, task in enumerate(tasks):
        assert_row_is(together, i, ran(law(task), q[i]))


def test_rollouts_may_be_cut_and_ordered_at_will():
    tasks = [*ALIKE["circles"], *OTHERS["mixed"], *ALIKE["eights"]]
    q = begin(tasks)
    whole = ran(LAWS["follow"](TaskBatch(tasks)), q)
    order = np.random.default_rng(3).permutation(len(tasks))
    for rows in (order, *(np.arange(a, b) for a, b in pairwise([0, 1, 7, 9, len(tasks)]))):
        part = ran(LAWS["follow"](TaskBatch([tasks[i] for i in rows])), q[rows])
        for name in whole.data.data_vars:
            assert_array_equal(part.array(name), whole.array(name)[rows], err_msg=name)


def test_open_paths_end_each_at_its_time():
    tasks = [Line([0.0, 0.0], [length, 0.1], speed) for length, speed in ((0.1, 2.0), (0.4, 1.0), (0.3, 3.0))]
    tasks.append(Circle(0.5, 2.0).between(0.0, 0.3))
    q = begin(tasks)
    law = lambda task: ExtendedMotionPlan(ARM, task, 800.0, [45.0, 100.0], 20.0, friction="full")  # noqa: E731
    together = ran(law(TaskBatch(tasks)), q, duration=4.0)
    assert (together.status == "finished").all()
    assert len(np.unique(together.finish_time)) == len(tasks)
    for i, task in enumerate(tasks):
        alone = ran(law(task), q[i], duration=4.0)
        assert_row_is(together, i, alone)
        assert end_error(together)[i] == end_error(alone)[0]


def test_laps_are_counted_in_periods_of_their_own():
    tasks = [Circle(0.1, speed) for speed in (1.0, 2.0)] + [Lissajous([0.1, 0.1], [2, 4], 1.0)]
    q = begin(tasks)
    together = ran(LAWS["tracking"](TaskBatch(tasks)), q, duration=3.0, laps=2)
    for i, task in enumerate(tasks):
        alone = ran(LAWS["tracking"](task), q[i], duration=3.0, laps=2)
        assert_row_is(together, i, alone)
        assert alone.status[0] == "finished"
        until_then = ran(LAWS["tracking"](task), q[i], duration=together.time[-1])
        assert together.laps[i] == until_then.laps[0]


def test_a_rollout_that_diverges_changes_no_other():
    tasks = ALIKE["circles"]
    q, K_p = begin(tasks), np.full((len(tasks), 1), 800.0)
    K_p[2] = 1e7
    law = lambda task, rows: ExtendedMotionPlan(ARM, task, K_p[rows], [45.0, 100.0], 20.0)  # noqa: E731
    strong = replace(LOOP, torque_limits=False)
    together = ran(law(TaskBatch(tasks), slice(None)), q, duration=0.3, loop=strong)
    assert together.status.tolist() == ["running", "running", "diverged", "running", "running"]
    for i in (0, 1, 3, 4):
        assert_row_is(together, i, ran(law(tasks[i], [i]), q[i], duration=0.3, loop=strong))
    assert np.isnan(metrics(together)["contour_error_rms"][2])


def test_arms_and_tasks_may_both_differ():
    tasks, q = ALIKE["ellipses"], begin(ALIKE["ellipses"])
    plants = [ARM.with_payload(mass, "tool") for mass in np.linspace(0.0, 2.0, len(tasks))]
    together = ran(LAWS["plan"](TaskBatch(tasks)), q, plant=plants)
    for i, (task, plant) in enumerate(zip(tasks, plants, strict=True)):
        assert_row_is(together, i, ran(LAWS["plan"](task), q[i], plant=plant))
    assert together.rollout(3).robot is plants[3]
    assert together.rollout(3).task is tasks[3]


def test_continuous_time_agrees_within_its_tolerance():
    tasks, q = ALIKE["circles"][:3], begin(ALIKE["circles"][:3])
    loop = ContinuousTime(output_period=0.05)
    together = simulate(LAWS["plan"](TaskBatch(tasks)), q, duration=0.3, loop=loop, progress=False)
    for i, task in enumerate(tasks):
        alone = simulate(LAWS["plan"](task), q[i], duration=0.3, loop=loop, progress=False)
        assert_allclose(together.array("q")[i], alone.array("q")[0], atol=1e-6)


def test_one_initial_state_does_for_all():
    tasks = ALIKE["circles"]
    assert_array_equal(
        ran(LAWS["plan"](TaskBatch(tasks)), [0.5, 0.2]).array("q"),
        ran(LAWS["plan"](TaskBatch(tasks)), [[0.5, 0.2]] * len(tasks)).array("q"),
    )


# --- evaluation -------------------------------------------------------------------------------------------------


def test_each_different_task_is_asked_once_for_all_rollouts_that_have_it():
    asked = []

    class Counted(Figure):
        def theta(self, s):
            asked.append(s.shape)
            return super().theta(s)

    one, other = Counted(1.0, 0.3), Counted(0.7, 0.3)
    batch = TaskBatch([one, other, one, one])
    asked.clear()
    batch.theta(np.zeros((2, 4)))
    assert asked == [(2, 3), (2, 1)]
    assert [(task, rows.tolist()) for task, rows in batch.groups()] == [(one, [0, 2, 3]), (other, [1])]


@settings(max_examples=3)
@given(st.lists(random_tasks(), min_size=2, max_size=5), st.integers(0, 9999))
def test_a_batch_has_the_values_of_its_tasks(tasks, seed):
    rng, batch = np.random.default_rng(seed), TaskBatch(tasks)
    s = rng.uniform(-10, 10, (2, len(tasks)))
    q, near = rng.normal(size=(2, len(tasks), 2)), s + 0.05
    found = batch.at(s)
    for i, task in enumerate(tasks):
        for k in range(2):
            one, alone = s[k, [i]], task.at(s[k, [i]])
            for name, value in found._asdict().items():
                assert_array_equal(value[k, i], getattr(alone, name)[0])
                assert_array_equal(getattr(batch, name)(s)[k, i] + 0.0, getattr(task, name)(one)[0])
            assert batch.sigma_bar(q)[k, i] == task.sigma_bar(q[k, [i]])[0]
            assert batch.sigma_bar(q, near)[k, i] == task.sigma_bar(q[k, [i]], near[k, [i]])[0]


def test_what_is_made_of_a_batch_is_made_of_each():
    circles = TaskBatch(ALIKE["circles"])
    s = np.linspace(0.1, 0.9, len(circles))
    for made in (
        lambda task: task.shifted([0.1, 0.2]),
        lambda task: task.scaled(0.5),
        lambda task: task.reversed(),
        lambda task: task.between(0.0, 1.0),
        lambda task: task.by_arc_length(),
        lambda task: task.with_profile(ConstantSpeed(0.3)),
    ):
        each = [made(task).q_d(s[[i]])[0] for i, task in enumerate(circles)]
        assert_array_equal(made(circles).q_d(s), each)
    assert_allclose(circles.arc_length(), [2 * np.pi * task.radius for task in circles.tasks], rtol=1e-12)
    assert_allclose(circles.curvature(s), [1 / task.radius for task in circles.tasks], rtol=1e-12)


# --- what is refused --------------------------------------------------------------------------------------------


class Endless(Figure):
    period = None


class Stuck(Figure):
    def theta(self, s):
        return np.zeros_like(s)


@pytest.mark.parametrize(
    ("tasks", "message"),
    [
        ([], "empty"),
        (SHARED, "expected a list of tasks"),
        ([SHARED, Circle], r"tasks\[1\] is the class Circle, expected a PathTask: make an instance"),
        ([SHARED, TaskBatch([SHARED])], r"tasks\[1\] is a TaskBatch of 1 tasks, expected one task"),
        ([SHARED, SHARED, WAY], r"tasks\[2\], a WaypointPath, is open, but tasks\[0\], a Circle, is closed"),
        ([SHARED, Endless(1.0, 1.0)], r"tasks\[1\], a Endless, neither ends nor repeats; give it a finite s_end"),
        ([SHARED, Circle(1.0, 1.0, center=[0, 0, 0])], r"tasks\[1\] is a path of 3 joints, tasks\[0\] of 2"),
    ],
)
def test_what_is_no_batch_is_named(tasks, message):
    with pytest.raises(InputError, match=message):
        TaskBatch(tasks)


def test_numbers_of_rollouts_that_do_not_fit_are_named():
    batch = TaskBatch(ALIKE["circles"])
    law, q = LAWS["plan"](batch), begin(ALIKE["circles"])
    with pytest.raises(InputError, match="TaskBatch has 5 tasks, q and qd are 3 initial states"):
        ran(law, q[:3])
    with pytest.raises(InputError, match="plant has 2 arms, the controller's TaskBatch has 5 tasks"):
        ran(law, q, plant=[ARM, ARM])
    with pytest.raises(InputError, match=r"s has shape \(3,\), expected \(\*batch, 5\)"):
        batch.q_d(np.zeros(3))
    with pytest.raises(InputError, match="the TaskBatch has 5 tasks, the run 2 rollouts"):
        metrics(ran(LAWS["plan"](SHARED), q[:2]), batch)


def test_a_list_is_refused_with_a_word_on_batches():
    with pytest.raises(TaskError, match="TaskBatch"):
        LAWS["plan"]([SHARED, SHARED])


def test_every_task_is_checked_by_its_number():
    with pytest.raises(TaskError, match=r"tasks\[2\]: Stuck.theta\(s=0\) = 0, expected ϑ > 0"):
        LAWS["follow"](TaskBatch([SHARED, SHARED, Stuck(1.0, 1.0)]))


def test_paths_made_of_paths_and_sequences_take_one():
    lines = TaskBatch(ALIKE["lines"])
    with pytest.raises(InputError, match="path 0 of the sequence is a TaskBatch of 5 tasks"):
        PathSequence([lines])
    with pytest.raises(InputError, match=r"the task of controllers\[0\] is a TaskBatch of 5 tasks"):
        simulate_sequence([LAWS["plan"](lines)], [0.0, 0.0], duration=1.0)
