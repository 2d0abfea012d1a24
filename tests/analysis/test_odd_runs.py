"""Whatever the numbers of a run are, and whatever it lacks, nothing but the library's own errors comes of it."""

from __future__ import annotations

import contextlib
import warnings

import h5py
import numpy as np
import pytest
from scipy import stats

import pathcontrol as pc
from pathcontrol.errors import InputError, PathControlError, UnknownNameError

ROBOT = pc.load_robot("cicese_2dof")
LAW = pc.ExtendedMotionPlan(ROBOT, pc.Circle(0.5, 2.0), 800.0, K_v=[45.0, 100.0], k=20.0)
PATHS = [pc.Line([0.0, 0.0], [0.1, 0.1], 2.0), pc.Line([0.1, 0.1], [0.2, 0.1], 2.0)]
USES = {
    "metrics": pc.metrics,
    "contour_error": pc.contour_error,
    "lag_error": pc.lag_error,
    "steady_state": pc.steady_state,
    "lyapunov": lambda run: pc.lyapunov(LAW, run),
    "path": lambda run: run.path(0),
    "text": repr,
}


@pytest.fixture(scope="module")
def runs():
    closed = pc.simulate(LAW, [0.7, 1.2], duration=0.03, progress=False)
    laws = [pc.ComputedTorque(ROBOT, path, 400.0, 40.0) for path in PATHS]
    task = pc.PathSequence(PATHS)
    return [closed, pc.simulate_sequence(laws, [0.0, 0.0], duration=0.03, task=task, progress=False)]


def assert_used(run, data):
    """Nothing warns of an overflow either."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        for use in USES.values():
            with contextlib.suppress(PathControlError):
                use(run.with_data(data))


def test_variables_may_be_missing(runs):
    for run in runs:
        for name in run.data.variables:
            if name not in ("time", "joint", "rollout"):
                assert_used(run, run.data.drop_vars(name))


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e308, -1e160, 1e100, 0.0])
def test_numbers_may_be_anything(value, runs):
    """Everywhere in one variable of a run, and at one time in the next one, of the other run the other way round."""
    for first, run in enumerate(runs):
        for i, (name, variable) in enumerate(run.data.data_vars.items()):
            values = variable.to_numpy().astype(float)
            values[(...,) if (first + i) % 2 else (0, -1)] = value
            assert_used(run, run.data.assign({name: (variable.dims, values, variable.attrs)}))


def test_a_missing_variable_is_told_with_those_there_are(runs):
    run = runs[0].with_data(runs[0].data.drop_vars("e_v"))
    for ask in (run.array, run.norm, run.__getitem__):
        with pytest.raises(UnknownNameError, match=r"no variable 'e_v'; there are .*tau_demand.*e_p"):
            ask("e_v")
    with pytest.raises(UnknownNameError, match="no variable 'e_v'"):
        pc.metrics(run)


def test_a_run_of_nothing_is_refused(runs):
    for name in ("rollout", "time", "joint"):
        with pytest.raises(InputError, match=f"have no {name}"):
            runs[0].with_data(runs[0].data.isel({name: slice(0, 0)}))


def test_other_joints_than_those_of_the_task_are_refused(runs):
    run = runs[0].with_data(runs[0].data.isel(joint=[0]))
    for use in ("metrics", "contour_error", "lag_error", "lyapunov"):
        with pytest.raises(InputError, match="the task has 2 joints, the run 1"):
            USES[use](run)


def test_a_variable_over_other_dimensions_is_refused(runs):
    data = runs[0].data.assign(tau=(("a", "b"), np.zeros((3, 4))))
    with pytest.raises(InputError, match=r"tau of the run is over \('a', 'b'\), expected \('rollout', 'time', 'joint'"):
        pc.metrics(runs[0].with_data(data))


def test_points_far_beyond_have_no_nearest_point_and_no_distance(runs):
    task, data = pc.Ellipse([0.5, 0.3], 2.0), runs[0].data
    far = np.array([[1e308, 0.0], [0.0, -1e200], [0.5, 0.0]])
    assert np.isnan(task.sigma_bar(far)).tolist() == [True, True, False]
    values = data["q"].to_numpy().copy()
    values[0, 3] = 1e308
    error = pc.contour_error(runs[0].with_data(data.assign(q=(data["q"].dims, values, data["q"].attrs))), task)
    assert np.flatnonzero(np.isnan(error[0])).tolist() == [3]


# --- what is not in the file -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["external", "virtual", "link", "soft link"])
def test_numbers_in_another_file_are_refused(kind, runs, tmp_path):
    file = runs[0].save(tmp_path / "run.nc")
    (tmp_path / "secret").write_bytes(bytes(8 * 1000))
    with h5py.File(file, "a") as opened:
        shape = opened["q"].shape
        attributes = dict(opened["q"].attrs)
        opened.move("q", "before") if kind == "soft link" else opened.pop("q")
        if kind == "external":
            opened.create_dataset("q", shape, "f8", external=[(str(tmp_path / "secret"), 0, h5py.h5f.UNLIMITED)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout(shape, "f8")
            layout[:] = h5py.VirtualSource(str(runs[0].save(tmp_path / "other.nc")), "q", shape)
            opened.create_virtual_dataset("q", layout)
        else:
            opened["q"] = h5py.SoftLink("/before") if kind == "soft link" else h5py.ExternalLink("other.nc", "/q")
        if kind in ("external", "virtual"):
            opened["q"].attrs["units"] = attributes["units"]
    said = "is a link to somewhere else" if "link" in kind else "the numbers of q are said to be in another file"
    with pytest.raises(InputError, match=said):
        pc.Run.load(file)


# --- bounds ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [{"population": 10**9}, {"generations": 10**10}, {"population": 10**300}])
def test_more_candidates_than_a_sweep_has_samples_are_refused_at_once(size, tmp_path):
    def never(p, samples):
        raise AssertionError("nothing is simulated")

    space = pc.Space.random({"K_p": stats.loguniform(100.0, 1e4)}, 1)
    options = {"out": tmp_path / "out", "progress": False} | {"population": 8, "generations": 2} | size
    with pytest.raises(InputError, match=rf"{next(iter(size))} = 10+.* expected at most \d+ simulations"):
        pc.tune(never, space, ["e_p_peak"], **options)
    assert not (tmp_path / "out").exists()
