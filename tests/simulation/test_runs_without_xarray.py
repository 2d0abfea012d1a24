"""Files of runs are read without xarray where they are just as they were written, and mean what it reads in them."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_array_equal

import pathcontrol as pc
from pathcontrol.errors import InputError
from pathcontrol.simulation.samples import Samples
from pathcontrol.simulation.storage.netcdf import read_run

pytestmark = pytest.mark.filterwarnings("ignore:.*has no checksum")
ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(0.3, 1.0, center=[0.5, 0.5])


def one():
    return pc.simulate(pc.Projection(ROBOT, CIRCLE, 800.0, 45.0), [0.8, 0.5], duration=0.05, progress=False)


def several():
    law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, 800.0, K_v=[45.0, 100.0], k=20.0)
    return pc.simulate(law, np.array([[0.8, 0.5], [0.81, 0.5], [0.8, 0.52]]), duration=0.05, progress=False)


def sequence():
    laws = [pc.ComputedTorque(ROBOT, pc.Line([0, 0], [0.1, 0.1], 1.0), 400.0, 40.0) for _ in range(2)]
    return pc.simulate_sequence(laws, [0, 0], duration=0.05, gaps=True, progress=False)


@pytest.fixture
def file(tmp_path):
    return one().save(tmp_path / "run.nc")


@pytest.mark.parametrize("make", [one, several, sequence])
def test_samples_are_what_xarray_reads(make, tmp_path):
    file = make().save(tmp_path / "run.nc")
    data, *_ = read_run(file)
    assert isinstance(data, Samples)
    with xr.open_dataset(file, engine="h5netcdf", decode_times=False) as found:
        assert data.dataset().identical(found.load().drop_attrs(deep=False))


def changed(file, change):
    """The file after a change of its content, without the checksum of that."""
    with h5py.File(file, "r+") as content:
        del content.attrs["pathcontrol_sha256"]
        change(content)
    return pc.Run.load(file)


def replace(content, name, array, dims=(), **attributes):
    """Put another variable in the place of one, with its attributes."""
    attributes = dict(content[name].attrs) | attributes
    del content[name]
    content[name] = array
    for key, value in attributes.items():
        if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
            content[name].attrs[key] = value
    for axis, dim in enumerate(dims):
        content[name].dims[axis].attach_scale(content[dim])


def test_what_another_program_says_is_kept(file):
    run = changed(file, lambda content: content["q"].attrs.update(remark="of Tuesday"))
    assert run.data["q"].attrs["remark"] == "of Tuesday"
    assert run.unit("q") == "rad"


def test_a_scale_that_another_program_gives_is_applied(file):
    q = pc.Run.load(file).array("q")
    run = changed(file, lambda content: content["q"].attrs.update(scale_factor=2.0))
    assert_array_equal(run.array("q"), 2 * q)


def test_a_variable_of_another_program_is_kept(file):
    def add(content):
        content["weight"] = np.array([3.0])
        content["weight"].dims[0].attach_scale(content["rollout"])

    assert changed(file, add).data["weight"].to_numpy() == [3.0]


def test_bytes_in_another_order_are_the_same_numbers(file):
    s = pc.Run.load(file).array("s")
    run = changed(file, lambda content: replace(content, "s", s.astype(">f8"), ("rollout", "time")))
    assert_array_equal(run.array("s"), s)
    assert run.array("s").dtype.isnative


def test_laps_are_no_truth_values(file):
    def change(content):
        replace(content, "laps", np.array([1], dtype="i1"), ("rollout",), dtype="bool")

    with pytest.raises(InputError, match="laps is bool, expected whole numbers"):
        changed(file, change)


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("joint", ["q1", "q1"], "expected names that differ"),
        ("time", np.nan, "its times are not finite"),
        ("time", 0.0, "its times do not increase"),
    ],
)
def test_wrong_labels_are_told(name, values, said, file):
    def change(content):
        content[name][...] = values

    with pytest.raises(InputError, match=said):
        changed(file, change)


def test_the_task_is_that_of_the_data(tmp_path):
    def change(content):
        content["path_index"][...] = 7

    run = changed(sequence().save(tmp_path / "run.nc"), change)
    with pytest.raises(InputError, match="the data are of other paths than the 2 of the task"):
        _ = run.task
