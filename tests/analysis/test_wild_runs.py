"""Saved runs whose checksums are right and whose contents are wild: read in bounded time, or refused in plain words."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.analysis.coverage import even_points
from pathcontrol.analysis.deviation import tool_positions
from pathcontrol.engine import gamma_distance as engine_gamma
from pathcontrol.engine.library import load_library
from pathcontrol.errors import EngineError, InputError, TaskError
from pathcontrol.geometry.closest_point import ClosestPoint, Curve
from pathcontrol.robot.recipe import recipe_of, robot_of
from pathcontrol.simulation.context import StoredContext
from pathcontrol.simulation.storage.netcdf import read_run, write_run
from pathcontrol.tasks.recorded import RecordedPath

ROBOT = pc.load_robot("cicese_2dof")
WAY = pc.WaypointPath([[0.0, 0.0], [0.3, 0.2], [0.4, 0.6], [0.2, 0.7], [0.1, 0.3]], 1.0, closed=True)
PATHS = [pc.Line([0.0, 0.0], [0.1, 0.1], 2.0), pc.Line([0.1, 0.1], [0.2, 0.1], 2.0)]


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    law = pc.ExtendedMotionPlan(ROBOT, WAY, 800.0, K_v=[45.0, 100.0], k=20.0)
    run = pc.simulate(law, WAY.q_d(np.array(0.0)) + 0.02, duration=0.05, progress=False)
    return run.save(tmp_path_factory.mktemp("closed") / "run.nc")


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    laws = [pc.ComputedTorque(ROBOT, path, 400.0, 40.0) for path in PATHS]
    run = pc.simulate_sequence(laws, [0.0, 0.0], duration=0.1, task=pc.PathSequence(PATHS), progress=False)
    return run.save(tmp_path_factory.mktemp("sequence") / "run.nc")


def rewritten(file, folder, change, data_too=lambda data: data):
    """The run with its recipe changed, and right checksums of what it says then."""
    _, config, stored = read_run(file)
    recipe = json.loads(stored.text)
    change(recipe)
    write_run(
        folder / "wild.nc", data_too(pc.Run.load(file).data), config, StoredContext(json.dumps(recipe), stored.numbers)
    )
    return pc.Run.load(folder / "wild.nc")


def test_knots_next_to_each_other_do_not_make_metrics_take_hours(closed, tmp_path):
    """q_d'' is then 1e18 beside them; cell by cell each state would be compared with two million pieces of Γ."""

    def squeeze(recipe):
        recipe["task"]["samples"]["values"][1] = 2.3e-10

    run = rewritten(closed, tmp_path, squeeze)
    task, q, qd = run.task, run.array("q")[0], run.array("qd")[0]
    distance = pc.distance_to_gamma(task, q, qd)
    s = np.concatenate([np.linspace(0, 2.3e-10, 20001), np.linspace(2.3e-10, task.period, 100001)])
    gamma = np.concatenate([task.q_d(s), task.dq_d(s) * task.theta(s)[:, None]], axis=-1)
    brute = np.array([np.linalg.norm(gamma - x, axis=-1).min() for x in np.concatenate([q, qd], axis=-1)])
    assert (distance <= brute + 1e-9).all()
    assert np.isfinite(pc.metrics(run)["gamma_distance_peak"]).all()


def test_few_pieces_may_be_nearest_of_an_ordinary_path():
    try:
        load_library()
    except EngineError:
        pytest.skip("there is no compiled engine")
    for task in (pc.Circle(0.5, 2.0), pc.Lissajous([0.5, 0.4], [3, 8], 1.0), WAY):
        q = np.array([[0.0, 0.0], [0.5, 0.1], [3.0, -2.0]])  # the centre of the circle too
        distance, _ = engine_gamma.distances_to_gamma(task, q, 0 * q, 1.0, False)
        assert np.isfinite(distance).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("period", value) for value in ("7", [1.0], -1.0, 1e300)),
        *(("profile", value) for value in (3, {"values": [1.0]})),
        ("knots", {"values": 1.0}),
        ("samples", {"values": [0.0, 1e300]}),
    ],
)
def test_a_path_that_cannot_be_asked_is_refused_when_it_is_made(name, value, closed, tmp_path):
    run = rewritten(closed, tmp_path, lambda recipe: recipe["task"].update({name: value}))
    with pytest.raises(InputError):
        _ = run.task
    with pytest.raises(InputError):
        pc.metrics(run)


def test_integers_beyond_floats_are_no_limits_of_a_robot():
    recipe = recipe_of(ROBOT)
    recipe["limits"][next(iter(recipe["limits"]))] = [10**400, 1.0]
    with pytest.raises(InputError, match="no recipe of a robot"):
        robot_of(recipe)


def spike(height):
    jets = np.zeros((3, 4, 2))
    jets[0] = [[0.0, 0.0], [0.1, 0.0], [0.2, 0.1], [0.3, 0.2]]
    jets[0, 2, 1] = height
    return RecordedPath([0.0, 1.0, 2.0, 3.0], jets, pc.ConstantRate(1.0))


@pytest.mark.parametrize("height", [1e160, -1e300])
def test_a_path_too_far_away_for_its_square_is_told(height, closed):
    task = spike(height)
    with pytest.raises(TaskError, match="expected numbers below 1e"):
        task.sigma_bar([0.1, 0.1])
    with pytest.raises(TaskError, match="expected numbers below 1e"):
        even_points(task.q_d(np.linspace(0, 3, 31)))
    run = pc.Run.load(closed)
    with pytest.raises(InputError, match=r"the path of the run has joint positions .* beyond 1e\+06 rad, at s = "):
        pc.record(run.with_data(run.data), task=task)


def test_tangents_whose_squares_are_not_finite_are_cut_as_others():
    """A quarter of a circle of radius r at the speed 1e200 r: the nearest point is where the angle says."""
    speed = 1e200
    curve = Curve(
        lambda s: np.stack([np.cos(s * speed), np.sin(s * speed)], axis=-1),
        lambda s: speed * np.stack([-np.sin(s * speed), np.cos(s * speed)], axis=-1),
    )
    nearest = ClosestPoint(curve, 0.0, 0.5 * np.pi / speed, closed=False)
    angle = np.array([0.2, 0.7, 1.3])
    found = nearest(2 * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    assert np.allclose(found * speed, angle, atol=1e-6)


def test_a_profile_that_underflows_has_an_ending():
    task = pc.Line([0.0, 0.0], [0.5, 0.5], 1.0).with_profile(pc.ConstantRate(1e-310))
    law = pc.ExtendedMotionPlan(ROBOT, task, 800.0, K_v=[45.0, 100.0], k=20.0)
    run = pc.simulate(law, [0.0, 0.0], duration=0.05, progress=False)
    assert np.isfinite(pc.metrics(run)["e_p_peak"]).all()


@pytest.mark.parametrize("posture", [[[0.0, 0.0]], [[0.0, 0.0], [1.0, 1.0]]])
def test_a_posture_is_one_value_for_each_joint(posture):
    for made in (
        lambda: pc.Circle(0.5, 1.0, center=posture),
        lambda: pc.Lissajous([0.5, 0.4], [1, 2], 1.0, center=posture),
        lambda: pc.Line(posture, posture, 1.0),
    ):
        with pytest.raises(InputError, match=r"has shape \(\d, 2\), expected \(n,\)"):
            made()


# --- data and task of one run ------------------------------------------------------------------------------------


@pytest.mark.parametrize("paths", [1, 3])
def test_data_of_other_paths_than_the_task_has_are_refused(paths, sequence):
    run, task = pc.Run.load(sequence), pc.PathSequence([PATHS[0], PATHS[1], PATHS[1].reversed()][:paths])
    with pytest.raises(InputError, match="the data are of other paths than the"):
        pc.metrics(run, task)


@pytest.mark.parametrize(("name", "kind"), [("path_index", float), ("laps", float)])
def test_counts_are_whole_numbers(name, kind, sequence, closed, tmp_path):
    def change(data):
        return data.assign_coords({name: data[name].astype(kind)})

    with pytest.raises(InputError, match=f"{name} is float64, expected whole numbers"):
        rewritten(sequence if name == "path_index" else closed, tmp_path, lambda recipe: None, change)


def test_a_run_none_of_whose_positions_is_known_has_no_place_of_the_tool(sequence):
    run = pc.Run.load(sequence)
    nothing = run.data.assign(q=(run.data["q"].dims, np.full(run.data["q"].shape, np.nan), run.data["q"].attrs))
    positions = tool_positions(run.with_data(nothing), frame="tool")
    assert positions.shape == (*run.array("q").shape[:2], 3)
    assert np.isnan(positions).all()


def test_numbers_of_rollouts_are_over_rollouts(closed, tmp_path):
    file = tmp_path / "run.nc"
    file.write_bytes(closed.read_bytes())
    with h5py.File(file, "a") as opened:
        del opened["rollout"]
        opened["rollout"] = np.arange(3)
    with pytest.raises(InputError):
        pc.Run.load(file)
