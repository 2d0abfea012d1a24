"""Continuous time where the projection is at its limits, paths with cusps, knots that nearly coincide."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from pathcontrol.analysis.lyapunov_functions import lyapunov
from pathcontrol.control.projection import Projection
from pathcontrol.errors import SimulationError, TaskError
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation import continuous
from pathcontrol.simulation.loops import ContinuousTime
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.curves import Circle, Line
from pathcontrol.tasks.function import FunctionPath
from pathcontrol.tasks.task_check import check_task
from pathcontrol.tasks.waypoints import WaypointPath


@pytest.fixture(scope="module")
def free():
    return load_robot("cicese_2dof").with_friction(None)


def test_the_projection_does_not_jump_where_the_timed_end_takes_over(free):
    starts = [[0.05, -0.03], [-0.1, 0.05], [0.3, 0.25]]
    law = Projection(free, Line([0.0, 0.0], [0.6, 0.4], speed=1.0), 800.0, [45.0, 100.0])
    loop = ContinuousTime(output_period=2.5e-3)
    run = simulate(law, starts, duration=1.5, loop=loop, progress=False, until="duration")
    for V, s in zip(lyapunov(law, run)[0], run.array("s"), strict=True):
        assert (np.diff(V) <= 1e-9 * V[0]).all()
        late = s > law.ending.begin
        assert (np.diff(s[late]) > 0).all()


BENT = np.array([0.0, -1.2, 1.5, -0.3, 0.8, 0.2])


@pytest.mark.parametrize(
    ("arm", "task", "offset"),
    [
        ("cicese_2dof", Circle(0.5, 2.0).between(0.3, 1.5), [0.1, 0.2]),
        ("cicese_2dof", WaypointPath([[0.0, 0.0], [0.4, 0.1], [0.5, 0.5]], speed=1.5), [-0.15, 0.1]),
        (
            "ur5",
            Line(BENT, BENT + np.array([0.3, 0.1, -0.2, 0.1, 0.2, -0.3]), speed=1.0),
            [0.1, -0.1, 0.2, 0.1, -0.2, 0.1],
        ),
    ],
    ids=["arc", "spline", "six joints"],
)
def test_the_timed_end_takes_over_without_a_jump_on_any_path(arm, task, offset):
    """V falls all the way, and σ does not go back where the end begins to be timed, from a start off the path."""
    robot = load_robot(arm).with_friction(None)
    law = Projection(robot, task, 400.0, np.linspace(45.0, 100.0, robot.n))
    begin = task.q_d(np.array(task.s0))
    loop = ContinuousTime(output_period=4e-3)
    run = simulate(law, begin + offset, 0.3 * np.ones(robot.n), duration=1.2, loop=loop, progress=False)
    V, s = lyapunov(law, run)[0][0], run.array("s")[0]
    assert s.min() < law.ending.begin < s.max()
    assert (np.diff(V) <= 1e-12 * V[0]).all()
    timed = s > law.ending.begin
    assert timed[np.argmax(timed) :].all()
    assert (np.diff(s[timed]) > -1e-12).all()


def test_a_run_from_the_centre_of_a_circle_is_given_up_with_a_reason(free, monkeypatch):
    monkeypatch.setattr(continuous, "_WATCHED", 200)
    law = Projection(free, Circle(1.0, 2.0), 800.0, [45.0, 100.0])
    with pytest.raises(SimulationError, match="crawls") as error:
        simulate(law, [0.0, 0.0], duration=0.5, loop=ContinuousTime(), progress=False)
    run = error.value.run
    assert np.ravel(run.status)[0] == "diverged"
    assert 0 <= float(run.diverged_time[0]) < 0.5


# --- arc length -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [5, 8, 10, 18, 36, 60])
def test_evenly_spaced_waypoints_have_the_length_that_quadrature_finds(n):
    angle = 2 * np.pi * np.arange(n) / n
    path = WaypointPath(np.stack([np.cos(angle), 0.5 * np.sin(angle)], -1), speed=0.5, closed=True)
    ends = path.knots if path.knots is not None else np.linspace(0, path.period, n + 1)
    ends = np.unique(np.concatenate([[path.s0], ends, [path.s0 + path.period]]))
    pieces = [quad(lambda s: np.linalg.norm(path.dq_d(np.array(s))), a, b)[0] for a, b in itertools.pairwise(ends)]
    assert path.arc_length() == pytest.approx(sum(pieces), rel=1e-10)
    even = path.by_arc_length()
    s = np.linspace(0, even.period, 101)
    assert_allclose(np.linalg.norm(even.dq_d(s), axis=-1), 1.0, rtol=1e-12)


@pytest.mark.parametrize("gap", [1e-16, 1e-15, 1e-14, 1e-12, 1e-9])
def test_knots_that_nearly_coincide_do_no_harm(gap):
    line = Line([0.0, 0.0], [0.6, 0.8], speed=1.0)
    inside = line.s0 + 0.25 * (line.s_end - line.s0)

    class Knotted(Line):
        knots = np.array([inside, inside * (1 + gap), inside * (1 + 2 * gap)])

    path = Knotted([0.0, 0.0], [0.6, 0.8], speed=1.0)
    assert path.arc_length() == pytest.approx(1.0, rel=1e-12)
    assert path.sigma_bar(np.array([0.3, 0.4])) == pytest.approx(0.5 * (line.s0 + line.s_end), rel=1e-9)


# --- cusps ----------------------------------------------------------------------------------------------------


def cusp():
    """The semicubical parabola, whose tip is between samples."""
    return FunctionPath(
        lambda s: np.stack([(s - 0.313) ** 2, (s - 0.313) ** 3], -1),
        theta=1.0,
        derivative=lambda s: np.stack([2 * (s - 0.313), 3 * (s - 0.313) ** 2], -1),
        second_derivative=lambda s: np.stack([2 + 0 * s, 6 * (s - 0.313)], -1),
        s0=-1.0,
        s_end=1.0,
    )


def test_a_cusp_is_found_in_any_parametrisation():
    with pytest.raises(TaskError, match=r"turns back at s = 0\.313"):
        check_task(cusp(), 2)
    with pytest.raises(TaskError, match=r"turns back|standstill"):
        check_task(cusp().by_arc_length(), 2)
    there_and_back = FunctionPath(  # of unit speed, as by arc length
        lambda s: np.stack([np.abs(s - 0.313), 0.5 + 0 * s], -1),
        theta=1.0,
        derivative=lambda s: np.stack([np.sign(s - 0.313), 0 * s], -1),
        second_derivative=lambda s: np.stack([0 * s, 0 * s], -1),
        s0=-1.0,
        s_end=1.0,
    )
    with pytest.raises(TaskError, match=r"turns back at s = 0\.313"):
        check_task(there_and_back, 2)


def test_a_sharp_bend_is_no_cusp():
    bend = FunctionPath(lambda s: np.stack([s**2, 1e-3 * s], -1), theta=1.0, s0=-1.013, s_end=1.0)
    check_task(bend, 2)
