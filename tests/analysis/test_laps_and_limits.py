"""Times of laps, and what stands beside limits: closed forms, in metrics, tables, figures and films."""

from __future__ import annotations

import numpy as np
import pytest
from test_film import reel

import pathcontrol as pc
from pathcontrol.analysis.lap_table import lap_table, lap_times
from pathcontrol.view.animation.record import record
from pathcontrol.view.figures.limits_figure import largest_shares

ROBOT = pc.load_robot("cicese_2dof")


def run_with(s, time, task, velocity=0.0):
    """A run of one rollout with s(t) as it is given."""
    q = task.q_d(s)
    arrays = {"q": q[None], "qd": np.full((1, *q.shape), velocity), "s": s[None], "sdot": np.gradient(s, time)[None]}
    arrays |= dict.fromkeys(("e_p", "e_v", "tau", "tau_demand"), 0 * arrays["q"])
    return pc.Run.from_arrays(time, dict.fromkeys(ROBOT.joint_names, "rad"), arrays, {}, robot=ROBOT, task=task)


@pytest.mark.parametrize(("rate", "start"), [(3.0, 0.0), (5.0, 1.2), (-2.0, 0.0), (0.1, 0.0)])
def test_laps_of_a_constant_rate_take_the_period_over_it(rate, start):
    task, time = pc.Circle(1.0, 2.0), np.linspace(0.0, 10.0, 4001)
    run = run_with(start + rate * time, time, task)
    expected = max(int(rate * 10 / (2 * np.pi)), 0)
    assert lap_times(run) == pytest.approx([2 * np.pi / rate] * expected)
    assert pc.metrics(run)["lap_time"] == pytest.approx([2 * np.pi / rate if expected else np.nan], nan_ok=True)
    assert len(lap_table(run)) == (expected + 1 if expected else 0)


def test_laps_that_grow_slower_each_have_their_own_time():
    """s = √t passes 2πk at (2πk)²."""
    task, time = pc.Circle(1.0, 2.0), np.linspace(0.0, 400.0, 40001)
    ends = (2 * np.pi * np.arange(4)) ** 2
    assert lap_times(run_with(np.sqrt(time), time, task)) == pytest.approx(np.diff(ends), abs=1e-5)


def test_laps_until_the_end_are_the_time_that_a_run_took():
    law = pc.Projection(ROBOT, pc.Circle(1.0, 3.0), 800.0, [45.0, 100.0])
    run = pc.simulate(law, [0.9, 0.1], duration=20.0, laps=3, progress=False)
    assert len(lap_times(run)) == 3
    assert lap_times(run).sum() == pytest.approx(run.finish_time[0], abs=2.5e-3)
    assert len(lap_table(run)) == 4
    tables = {table["title"]: table for table in reel(record(run)).header["tables"]}
    assert len(tables["Laps"]["rows"]) == 3


def test_open_paths_have_no_laps():
    line = pc.Line([0.0, 0.0], [1.0, 0.5], speed=0.5)
    run = run_with(np.linspace(0, line.s_end, 50), np.linspace(0.0, 1.0, 50), line)
    assert "lap_time" not in pc.metrics(run)
    assert lap_table(run) == []
    with pytest.raises(pc.InputError, match="closed"):
        lap_times(run)


def test_shares_of_limits_are_drawn_beside_a_line_at_100_percent():
    limit = ROBOT.limits.velocity
    task, time = pc.Circle(1.0, 2.0), np.linspace(0.0, 1.0, 50)
    fast = run_with(2.0 * time, time, task, velocity=1.5 * limit.min())
    if not np.isfinite(limit).any():
        pytest.skip("the arm has no velocity limits")
    assert largest_shares(fast)["velocity"] == pytest.approx(150.0)
    lines = pc.limits_figure(fast).axes[0].get_lines()
    assert any(np.allclose(line.get_ydata(), 150.0) for line in lines)
    assert any(np.allclose(line.get_ydata(), 100.0) for line in lines)
    [chart] = [c for c in reel(record(fast)).header["charts"] if "velocity / limit" in c["title"]]
    assert [line["role"] for line in chart["lines"]].count("limit") == 1


def test_a_path_made_for_a_tool_is_charted_by_its_speed():
    start, feed = np.array([0.6, 1.2]), 0.2
    centre = ROBOT.frame_pose(start, "tool")[:3, 3] - [0.0, 0.0, 0.05]
    curve = pc.ToolCurve.circle(centre, 0.05, normal=[0.0, 1.0, 0.0])
    task = pc.CartesianPath(ROBOT, "tool", curve, speed=feed, start=start)
    time = np.linspace(0.0, 1.0, 201)
    s = task.s0 + float(task.theta(np.array(task.s0))) * time
    run = run_with(s, time, task)
    titles = [c["title"] for c in reel(record(run)).header["charts"]]
    assert "speed of the tool" in titles
    assert not any("σ̇" in title for title in titles)
    label = pc.speed_figure(run).axes[0].get_ylabel()
    assert "speed of the tool" in label


def test_very_many_laps_all_have_their_times_and_a_table_has_the_first():
    time = np.linspace(0.0, 1500.5, 15006)
    run = run_with(2 * np.pi * time, time, pc.Circle(1.0, 2.0))
    assert len(lap_times(run)) == 1500
    assert np.allclose(lap_times(run), 1.0)
    assert len(lap_table(run)) == 1 + 1000


def test_each_rollout_of_a_batch_has_its_own_lap_time():
    circle = pc.Circle(1.0, 2.0)
    law = pc.ComputedTorque(ROBOT, pc.TaskBatch([circle, circle.with_profile(pc.ConstantRate(4.0))]), 400.0, 40.0)
    run = pc.simulate(law, circle.q_d(np.array(0.0)), duration=7.0, progress=False)
    assert np.allclose(pc.metrics(run, only=["lap_time"])["lap_time"], [np.pi, np.pi / 2], rtol=1e-9)
