"""Runs along batches of tasks: numbers, files and pictures of each rollout."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_array_equal, assert_equal
from test_task_batch import ALIKE, FAMILIES, LAWS, begin, ran

from pathcontrol import (
    Circle,
    ConstantSpeed,
    InputError,
    Run,
    TaskBatch,
    WaypointPath,
    contour_error,
    distance_to_gamma,
    lag_error,
    lyapunov,
    metrics,
)


@pytest.mark.parametrize("family", ["circles", "lines", "mixed"])
def test_a_rollout_has_the_numbers_of_its_own_task(family):
    tasks = FAMILIES[family]
    law = LAWS["plan"](TaskBatch(tasks))
    run = ran(law, begin(tasks), duration=0.2)
    whole, found = metrics(run), lyapunov(law, run)
    distance = distance_to_gamma(TaskBatch(tasks), run.array("q")[:, -1], run.array("qd")[:, -1])
    for i, task in enumerate(tasks):
        own = run.rollout(i)
        assert own.task is task
        assert_equal({n: value[0] for n, value in metrics(own).items()}, {n: v[i] for n, v in whole.items()})
        assert_array_equal(contour_error(run)[i], contour_error(own, task)[0])
        assert_array_equal(lag_error(run)[i], lag_error(own, task)[0])
        alone = lyapunov(LAWS["plan"](task), own)
        assert_array_equal(found.V[i], alone.V[0])
        assert_array_equal(found.Vdot[i], alone.Vdot[0])
        assert distance[i] == distance_to_gamma(task, run.array("q")[i, -1], run.array("qd")[i, -1])


def test_a_part_of_a_run_knows_the_tasks_of_its_rollouts():
    tasks = ALIKE["circles"]
    run = ran(LAWS["plan"](TaskBatch(tasks)), begin(tasks), first_rollout=7)
    part = run.with_data(run.data.isel(rollout=[3, 1]))
    assert part.task.tasks == (tasks[3], tasks[1])
    assert part.rollout(1).task is tasks[1]
    assert metrics(part)["e_p_rms"] == [metrics(run)["e_p_rms"][i] for i in (3, 1)]
    strange = run.with_data(run.data.assign_coords(rollout=np.arange(5)))
    with pytest.raises(InputError, match="does not know all tasks"):
        _ = strange.task


@pytest.mark.parametrize("family", ["lines", "moved"])
def test_a_file_keeps_the_task_of_each_rollout(family, tmp_path):
    tasks = FAMILIES[family]
    run = ran(LAWS["plan"](TaskBatch(tasks)), begin(tasks), first_rollout=3)
    loaded = Run.load(run.save(tmp_path / "run.nc"))
    part = run.with_data(run.data.isel(rollout=[2, 0]))
    again = Run.load(part.save(tmp_path / "part.nc"))
    assert "TaskBatch" not in run.rollout(2)._stored().text
    alone = Run.load(loaded.rollout(2).save(tmp_path / "one.nc"))
    assert len(again.task) == 2
    s = np.linspace(0.0, 0.1, 5)
    for i, task in enumerate(tasks):
        assert_array_equal(loaded.rollout(i).task.q_d(s), task.q_d(s))
        assert_array_equal(loaded.rollout(i).task.theta(s), task.theta(s))
    for other in (again.rollout(0).task, again.task.tasks[0], alone.task, loaded.rollout(2).task):
        assert_array_equal(other.q_d(s), tasks[2].q_d(s))
    assert_equal(metrics(loaded), metrics(run))


def test_a_file_keeps_what_tasks_share_once(tmp_path):
    path = WaypointPath(np.cumsum(np.full((60, 2), 0.3), axis=0) * [1, -1], 1.0)
    fast, slow = (path.with_profile(ConstantSpeed(speed)) for speed in (1.0, 0.5))
    one, many = (ran(LAWS["plan"](TaskBatch(tasks)), begin(tasks)) for tasks in ([fast, slow], [fast, slow] * 20))
    one, many = one._stored(), many._stored()
    assert len(many.numbers) == len(one.numbers)
    assert len(many.text) < len(one.text) + 20 * 2 * len('{"part": 10}, ')
    back = Run.load(ran(LAWS["plan"](TaskBatch([fast, slow] * 3)), begin([fast, slow] * 3)).save(tmp_path / "run.nc"))
    assert back.task.tasks[0] is back.task.tasks[2]
    assert back.task.tasks[0].path is back.task.tasks[1].path


def test_the_record_of_a_run_stays_short():
    run = ran(LAWS["plan"](TaskBatch([Circle(r, 2.0) for r in np.linspace(0.5, 1.0, 50)])), [0.7, 0.0])
    said = run.config["controller"]["task"]
    assert said["tasks"] == 50
    assert said["kinds"] == ["Circle"]
    assert said["speed"] == 2.0
    assert said["radius"] == {"shape": [50], "min": 0.5, "max": 1.0}
    assert len(json.dumps(said)) < 600


def test_figures_films_and_reports_show_the_path_of_their_rollout():
    pytest.importorskip("matplotlib")
    from pathcontrol.view.animation.recorded_runs import make_recordings
    from pathcontrol.view.figures.shown import shown
    from pathcontrol.view.report.reproduction import script
    from pathcontrol.view.report.run_summary import facts, measure

    tasks = ALIKE["circles"]
    run = ran(LAWS["plan"](TaskBatch(tasks)), begin(tasks))
    assert shown(run, rollout=2)[0].task is tasks[2]
    assert shown(run, task=TaskBatch(tasks), rollout=3)[0].task is tasks[3]
    assert make_recordings(run, None, None, 1, None)[0].task is tasks[1]
    np.testing.assert_equal(measure(run), metrics(run))  # NaN, as of laps that no rollout finished, equals NaN
    assert {row.label: row.cells[0].text for row in facts({"run": run})}["path"] == "5 tasks, Circle"
    assert "saved.task" in script("run", run)
