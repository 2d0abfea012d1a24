"""The film of a law with an observer charts what pushes the joints; other films do not."""

from __future__ import annotations

import numpy as np
import pytest
from test_film import reel

import pathcontrol as pc

PUSH = np.array([4.0, -0.6])
BESIDE, BEYOND = "torque beside the motors, estimated", "torque beside motors and friction, estimated"


def law(robot: pc.RobotModel, friction: str = "viscous") -> pc.Controller:
    return pc.ExtendedMotionPlan(robot, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0, friction=friction)


def pushed(law: pc.Controller) -> pc.Run:
    """Half a second, pushed from 0.1 s on by less than what would halt it."""
    start = law.task.q_d(np.array(0.0))
    return pc.simulate(law, start, duration=0.5, disturbance=pc.Push(PUSH, start=0.1), progress=False)


def titles(animation: pc.Animation) -> set[str]:
    return {chart["title"] for chart in animation.film.header["charts"]}


@pytest.mark.parametrize("title", [BESIDE, BEYOND])
def test_the_chart_shows_the_torque_that_pushes_the_joints(title: str) -> None:
    robot = pc.load_robot("cicese_2dof").with_friction(None)
    watching = law(robot, "observed") if title == BESIDE else pc.SpeedOverride(pc.EventPlan(law(robot)))
    film = reel(pc.record(pushed(watching)))
    times, lines, chart = film.chart(title)
    assert chart["unit"] == "N m"
    seen = np.stack(list(lines.values()), axis=-1)
    np.testing.assert_allclose(seen[times < 0.1], 0.0, atol=0.02)
    np.testing.assert_allclose(seen[times > 0.45], np.tile(PUSH, ((times > 0.45).sum(), 1)), atol=0.02)


def test_the_chart_is_that_of_the_momentum_observer() -> None:
    run = pushed(law(pc.load_robot("cicese_2dof"), "observed"))
    times, lines, _ = reel(pc.record(run)).chart(BESIDE)
    expected = pc.momentum_observer(run)[0]
    for j, values in enumerate(lines.values()):
        np.testing.assert_allclose(values, np.interp(times, run.time, expected[:, j]), rtol=1e-5, atol=1e-4)


def test_of_several_runs_the_chart_shows_the_largest_of_those_that_observe() -> None:
    robot = pc.load_robot("cicese_2dof").with_friction(None)
    runs = {"blind": pushed(law(robot)), "sees": pushed(law(robot, "observed"))}
    times, lines, _ = reel(pc.record(runs)).chart(f"{BESIDE}, largest")
    assert list(lines) == ["sees"]
    np.testing.assert_allclose(lines["sees"][times > 0.45], 4.0, atol=0.02)


def test_a_law_without_an_observer_has_no_such_chart() -> None:
    found = titles(pc.record(pushed(law(pc.load_robot("cicese_2dof")))))
    assert found
    assert not any("estimated" in title for title in found)


def test_a_law_that_does_both_has_both_charts() -> None:
    run = pushed(pc.EventPlan(law(pc.load_robot("cicese_2dof"), "observed"), threshold=[30.0, 5.0]))
    assert {BESIDE, BEYOND} <= titles(pc.record(run))
