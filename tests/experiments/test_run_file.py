"""A saved run knows its robot and its path, and says of itself what the fresh one says."""

from __future__ import annotations

import pickle

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from strategies import tasks

from pathcontrol import (
    Circle,
    ExtendedMotionPlan,
    InputError,
    Line,
    PathControlWarning,
    PathSequence,
    PathTask,
    Run,
    SampledLoop,
    Toolpath,
    ToolpathTask,
    WaypointPath,
    contour_error,
    end_error,
    lag_error,
    load_robot,
    metrics,
    simulate,
    simulate_sequence,
    smooth,
    steady_state,
    tool_deviation,
    toolpath_metrics,
)
from pathcontrol.analysis.deviation import tool_positions
from pathcontrol.experiments.runner import run_experiment
from pathcontrol.experiments.template import example_text
from pathcontrol.robot.recipe import recipe_of
from pathcontrol.simulation.storage.array_store import ArrayStore
from pathcontrol.simulation.storage.netcdf import read_run, write_run
from pathcontrol.tasks.laps import Laps
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.recipes import contour_of, contour_recipe
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline, Segment

GAINS = {"K_p": 800.0, "K_v": [45.0, 100.0], "k": 20.0}


def followed(arm, task, duration=0.5, **options):
    law = ExtendedMotionPlan(arm, task, **GAINS)
    return simulate(law, task.q_d(np.array(task.s0)) + 0.05, duration=duration, progress=False, **options)


def saved(run, folder):
    return Run.load(run.save(folder / "run.nc"))


def assert_close(values, expected, relative=1e-7):
    assert values.keys() == expected.keys()
    for name, value in expected.items():
        assert np.allclose(values[name], value, rtol=relative, atol=1e-9, equal_nan=True), name


# --- in memory ----------------------------------------------------------------------------------------------


def test_a_fresh_run_has_the_very_robot_and_task(arm, circle):
    plant = arm.with_payload(0.5, "tool")
    run = followed(arm, circle, plant=plant)
    for part in (run, run.rollout(0), steady_state(run), run.with_data(run.data.isel(time=[0]))):
        assert part.robot is plant
        assert part.task is circle


def test_metrics_need_no_task(arm):
    task = Line([0.1, 0.2], [0.4, 0.1], 0.5)
    run = followed(arm, task, 3.0)
    assert_close(metrics(run), metrics(run, task), 0.0)
    for number in (contour_error, lag_error, end_error):
        assert np.array_equal(number(run), number(run, task))
    assert not np.array_equal(contour_error(run), contour_error(run, Circle(1.0, 1.0)))


def test_a_run_of_arrays_says_what_to_give():
    run = Run.from_arrays(np.zeros(1), {"a": "rad"}, {"q": np.zeros((1, 1, 1))}, {})
    assert run.task is None
    with pytest.raises(InputError, match=r"does not know its robot.*give robot="):
        _ = run.robot
    with pytest.raises(InputError, match=r"does not know its path.*give task="):
        metrics(run)
    with pytest.raises(InputError, match="give task="):
        toolpath_metrics(run)


def test_a_run_of_arrays_may_be_given_them(arm, circle):
    arrays = {"q": np.zeros((1, 1, 2))}
    run = Run.from_arrays(np.zeros(1), dict.fromkeys(arm.joint_names, "rad"), arrays, {}, robot=arm, task=circle)
    assert (run.robot, run.task) == (arm, circle)


# --- saved and loaded ---------------------------------------------------------------------------------------


def test_the_loaded_robot_and_task_simulate_the_same_run_bit_for_bit(arm, circle, tmp_path):
    plant = arm.with_payload(0.5, "tool").with_frame("tip", "tool", [0, 0, 0.1])
    run = followed(arm, circle, plant=plant, loop=SampledLoop(encoders=True, torque_limits=True))
    loaded = saved(run, tmp_path)
    assert loaded.data.identical(run.data)
    assert loaded.config == run.config
    repeated = followed(arm, loaded.task, plant=loaded.robot, loop=SampledLoop(encoders=True, torque_limits=True))
    assert repeated.data.identical(run.data)
    assert loaded.robot is loaded.rollout(0).robot  # rebuilt once


@given(tasks())
@settings(max_examples=6)
def test_metrics_of_a_loaded_run_are_those_of_the_fresh_one(tmp_path_factory, arm, task):
    run = followed(arm, task)
    loaded = saved(run, tmp_path_factory.mktemp("run"))
    assert_close(metrics(loaded), metrics(run))


def test_a_run_saved_again_is_the_same(arm, tmp_path):
    task = WaypointPath([[0.1, 0.2], [0.4, 0.1], [0.5, 0.5]], 0.5)
    run = followed(arm, task)
    loaded = saved(run, tmp_path)
    again = Run.load(loaded.rollout(0).save(tmp_path / "again.nc"))
    assert recipe_of(again.robot) == recipe_of(run.robot)
    s = np.linspace(0, task.s_end, 99)
    assert np.array_equal(again.task.q_d(s), loaded.task.q_d(s))
    assert again.data.identical(run.data)


class Lemniscate(PathTask):
    """A class that a reader of the file does not have."""

    period = 2 * np.pi

    def q_d(self, s):
        return 0.4 * np.stack([np.sin(s), np.sin(2 * s)], axis=-1)

    def theta(self, s):
        return np.full_like(s, 1.5)


def test_a_path_of_the_user_comes_back_without_its_class(arm, tmp_path):
    run = followed(arm, Lemniscate())
    loaded = saved(run, tmp_path)
    assert loaded.task.original == "Lemniscate"
    assert_close(metrics(loaded), metrics(run))
    repeated = followed(arm, loaded.task)
    assert np.abs(repeated.array("q") - run.array("q")).max() < 1e-9


class Straight(PathTask):
    """It neither ends nor repeats."""

    def q_d(self, s):
        return np.stack([0.3 * np.asarray(s), np.sin(s)], axis=-1)

    def theta(self, s):
        return np.full_like(s, 20.0)


def test_an_endless_path_is_kept_as_far_as_any_rollout_went(arm, tmp_path):
    law = ExtendedMotionPlan(arm, Straight(), **GAINS)
    run = simulate(law, [[0.0, 0.0], [0.3, 0.1]], duration=0.5, progress=False)
    assert run.array("s").max() > 2 * np.pi
    loaded = saved(run, tmp_path)
    assert loaded.task.s_end == np.inf
    assert_close(metrics(loaded), metrics(run))
    assert "contour_error_peak" not in metrics(loaded)


class Broken(Lemniscate):
    """It fails after a while."""

    def q_d(self, s):
        if getattr(self, "broken", False):
            raise ZeroDivisionError("out of order")
        return super().q_d(s)


def test_no_run_is_lost_because_its_path_is_odd(arm, tmp_path):
    task = Broken()
    run = followed(arm, task)
    task.broken = True
    with pytest.warns(UserWarning, match="the Broken is not kept with its run: out of order"):
        loaded = saved(run, tmp_path)
    assert loaded.data.identical(run.data)
    assert loaded.task is None
    assert recipe_of(loaded.robot) == recipe_of(arm)


def test_runs_are_pickled_whatever_their_task_is_made_of(arm):
    task = Lemniscate()
    task.shape = lambda s: s  # cannot be pickled
    run = followed(arm, task)
    copy = pickle.loads(pickle.dumps(run))
    assert copy.data.identical(run.data)
    assert copy.config == run.config
    assert recipe_of(copy.robot) == recipe_of(arm)
    s = np.linspace(0, 9, 99)
    assert np.allclose(copy.task.q_d(s), task.q_d(s), rtol=0, atol=1e-11)


# --- older and other files ----------------------------------------------------------------------------------


def test_an_older_file_is_read_and_says_what_to_give(arm, circle, tmp_path):
    run = followed(arm, circle)
    path = run.save(tmp_path / "run.nc")
    with h5py.File(path, "a") as file:
        del file["origin"]
        del file.attrs["pathcontrol_sha256"]
    with pytest.warns(PathControlWarning, match="has no checksum, as it was written by an earlier version"):
        loaded = Run.load(path)
    assert loaded.data.identical(run.data)
    assert loaded.task is None
    with pytest.raises(InputError, match=r"give robot=load_robot"):
        _ = loaded.robot
    numbers = metrics(run, circle)
    for name in ("tau_demand_ratio", "torque_limit_ratio", "velocity_limit_ratio"):
        numbers.pop(name)  # limits are the robot's
    assert_close(metrics(loaded, circle), numbers, 0.0)
    assert Run.load(loaded.save(tmp_path / "again.nc")).task is None


@pytest.mark.parametrize("text", ["", "no JSON", "[]", '{"robot": {"urdf": 1}, "task": {"class": "Circle"}}'])
def test_a_recipe_that_was_tampered_with_harms_the_data_not(arm, circle, tmp_path, text):
    path = followed(arm, circle).save(tmp_path / "run.nc")
    data, config, stored = read_run(path)
    write_run(path, data, config, stored._replace(text=text))
    loaded = Run.load(path)
    assert loaded.time.size
    with pytest.raises(InputError):
        _ = loaded.robot
    with pytest.raises(InputError):
        _ = loaded.task


def test_other_readers_see_the_data_alone(arm, circle, tmp_path):
    run = followed(arm, circle)
    with xr.open_dataset(run.save(tmp_path / "run.nc"), engine="h5netcdf") as data:
        assert set(data.data_vars) == set(run.data.data_vars)
        assert not set(data.dims) - {"rollout", "time", "joint"}


def test_an_experiment_keeps_its_text(tmp_path):
    text = example_text().replace("duration = 10.0", "duration = 0.05") + "# γ\n"
    text = text.replace('html = "run.html"', "").replace('figure = "run"', "")
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    run = run_experiment(tmp_path / "experiment.toml", tmp_path / "out", progress=False).run
    loaded = Run.load(tmp_path / "out" / "run.nc")
    assert loaded.config["experiment"] == run.config["experiment"] == text
    assert isinstance(loaded.task, Circle)


# --- sequences ----------------------------------------------------------------------------------------------


def test_a_sequence_knows_its_paths(arm, tmp_path):
    paths = [Line([0.1, 0.2], [0.4, 0.1], 1.0), Circle(0.3, 1.0), Lemniscate().between(0.3, 0.8)]
    laws = [ExtendedMotionPlan(arm, path, friction="full", **GAINS) for path in paths]
    run = simulate_sequence(laws, [0.1, 0.2], duration=5.0, laps=2, gaps=True, progress=False)
    loaded = saved(run, tmp_path)
    assert np.array_equal(loaded.task.starts, run.task.starts)
    assert np.array_equal(np.diff(run.task.starts)[:2], [paths[0].s_end, 4 * np.pi])
    for i, path in enumerate(paths):
        assert run.path(i).task is path
        assert type(loaded.path(i).task) is type(path)
        assert (loaded.path(i).task.period, loaded.path(i).task.s_end) == (path.period, path.s_end)
        assert_close(metrics(loaded.path(i)), metrics(run.path(i), path))
        assert np.allclose(lag_error(run)[:, run["path_index"] == i], lag_error(run.path(i), path), atol=1e-12)
    assert_close(metrics(loaded), metrics(run))
    again = saved(loaded.path(2), tmp_path)
    assert_close(metrics(again), metrics(run.path(2)))


def test_the_whole_must_be_of_the_paths_that_are_followed(arm):
    line = Line([0.1, 0.2], [0.4, 0.1], 1.0)
    laws = [ExtendedMotionPlan(arm, line, **GAINS)]
    for task, message in (
        (line, "expected a PathSequence, such as a ToolpathTask, of 1 paths"),
        (PathSequence([line, line.reversed()]), "of 1 paths"),
        (PathSequence([line.between(0.0, 0.2)]), r"path 0 of the whole from 0 by 0\.2; give the task whose paths"),
    ):
        with pytest.raises(InputError, match=message):
            simulate_sequence(laws, [0.1, 0.2], duration=1.0, task=task, progress=False)
    ring = Circle(0.3, 1.0)
    laws.append(ExtendedMotionPlan(arm, ring, **GAINS))
    whole = PathSequence([line, Laps(ring, 2)], gaps=True)
    assert simulate_sequence(laws, [0.1, 0.2], duration=0.1, laps=2, task=whole, progress=False).task is whole


# --- toolpaths ----------------------------------------------------------------------------------------------

BOARD = np.array([[1, 0, 0, 0.3], [0, 0, -1, -0.05], [0, 1, 0, 0.7], [0, 0, 0, 1.0]])


class Parabola(Segment):
    """A segment of the user."""

    def point(self, u):
        u = np.asarray(u)
        return np.stack([0.1 * u, 0.05 * u**2, 0 * u], axis=-1)

    def derivative(self, u, order=1):
        u = np.asarray(u)
        first, second = [0.1 + 0 * u, 0.1 * u, 0 * u], [0 * u, 0.1 + 0 * u, 0 * u]
        return np.stack(first if order == 1 else second, axis=-1)

    def placed(self, pose):
        raise NotImplementedError

    def reversed(self):
        raise NotImplementedError


def drawing() -> Toolpath:
    corner = Polyline([[0, 0, 0], [0, 0.05, 0], [0.03, 0.05, 0]])
    wave = Bezier([[0.03, 0.05, 0], [0.05, 0.05, 0], [0.05, 0.02, 0], [0.07, 0.02, 0]], [1.0, 2.0, 0.5, 1.0])
    ring = Arc([0.09, 0, 0], [0.02, 0, 0], [0, 0.02, 0], 0.0, 2 * np.pi)
    return Toolpath(
        (Contour((corner, wave), feed=0.1, name="hook"), Contour((ring,), closed=True, name="ring")), "hand.svg", "mm"
    )


@pytest.fixture(scope="module")
def milled():
    robot = load_robot("cicese_2dof")
    task = ToolpathTask(robot, "tool", drawing(), BOARD, feed=0.1, clearance=0.0, rapid_speed=0.2)
    laws = [ExtendedMotionPlan(robot, path, K_p=800.0, K_v=45.0, k=2.0, friction="full") for path in task]
    return simulate_sequence(laws, task.q_d(np.array(0.0)), task=task, duration=20.0, progress=False)


def test_a_toolpath_comes_back_with_its_drawing(milled, tmp_path):
    task, other = milled.task, saved(milled, tmp_path).task
    assert isinstance(other, ToolpathTask)
    assert other.describe() == task.describe()
    assert np.array_equal(other.workpiece, task.workpiece)
    assert (other.drawing.source, other.drawing.unit) == ("hand.svg", "mm")
    assert [(c.name, c.rapid, c.feed, c.closed) for c in other.drawing] == [
        (c.name, c.rapid, c.feed, c.closed) for c in task.drawing
    ]
    x = np.random.default_rng(0).uniform(-0.1, 0.2, (50, 3))
    assert np.array_equal(other.drawing.distance(x), task.drawing.distance(x))
    for mine, theirs in zip(task.contours, other.contours, strict=True):
        assert np.array_equal(theirs.distance(x), mine.distance(x))
    assert [c.rapid for c in other.contours] == [c.rapid for c in task.contours]
    for mine, theirs in zip(task.smoothed, other.smoothed, strict=True):
        assert np.array_equal(theirs.curves[0].knots, mine.curves[0].knots)
    s = np.linspace(0, task.s_end, 999)
    assert np.array_equal(other.theta(s), task.theta(s))
    assert np.abs(other.q_d(s) - task.q_d(s)).max() < 1e-13
    assert np.array_equal(other.index(s), task.index(s))


def test_the_numbers_of_a_toolpath_need_nothing_beside_the_run(milled, tmp_path):
    loaded, robot, task = saved(milled, tmp_path), milled.robot, milled.task
    expected = toolpath_metrics(milled, robot, task)
    assert toolpath_metrics(milled) == expected
    assert toolpath_metrics(loaded) == expected
    assert np.array_equal(tool_deviation(loaded), tool_deviation(milled, robot, task.frame, task.contours))
    assert np.array_equal(tool_positions(loaded), tool_positions(milled, robot, "tool"))
    assert_close(metrics(loaded.path(0)), metrics(milled.path(0), task.paths[0]))
    with pytest.raises(InputError, match="follows a Circle, expected a ToolpathTask"):
        toolpath_metrics(followed(robot, Circle(1.0, 1.0), 0.1))


def test_a_file_that_knows_its_path_is_not_much_larger(milled, tmp_path):
    """Most of it is a table of 1000 speeds for each path, however short."""
    alone = Run(milled.data, milled.config).save(tmp_path / "alone.nc").stat().st_size
    assert milled.save(tmp_path / "run.nc").stat().st_size < 1.6 * alone


def test_normals_and_segments_of_the_user_are_kept():
    store = ArrayStore()
    normals = np.array([[0, 0, 1.0], [0, 0.6, 0.8]])
    given = Contour((Polyline([[0, 0, 0], [1, 0, 0]]),), rapid=True, normals=normals)
    recipes = [contour_recipe(given, store.put), contour_recipe(Contour((Parabola(),)), store.put)]
    kept, parabola = (contour_of(recipe, ArrayStore(store.numbers).get) for recipe in recipes)
    assert np.array_equal(kept.normals, normals)
    assert kept.rapid
    points = Parabola().point(np.linspace(0, 1, 1001))
    assert parabola.distance(points).max() < 1e-7
    assert smooth(parabola).curves
