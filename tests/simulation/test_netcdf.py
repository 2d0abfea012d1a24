"""The file of a run is netCDF: the reference implementation reads it, and may add to it."""

from __future__ import annotations

import netCDF4
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import pathcontrol as pc


@pytest.fixture(scope="module")
def run(arm):
    law = pc.ExtendedMotionPlan(arm, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    return pc.simulate(law, [[0.9, 0.1], [1.0, 0.0], [1.1, -0.1]], duration=0.1, progress=False)


@pytest.mark.parametrize("loaded", [False, True], ids=["simulated", "loaded and saved again"])
def test_the_reference_implementation_finds_variables_on_their_axes(run, tmp_path, loaded):
    run.save(tmp_path / "a.nc")
    if loaded:
        pc.Run.load(tmp_path / "a.nc").save(tmp_path / "b.nc")
    with netCDF4.Dataset(tmp_path / ("b.nc" if loaded else "a.nc")) as file:
        assert {name: len(axis) for name, axis in file.dimensions.items()} == dict(run.data.sizes)
        assert set(file.variables) == set(run.data.variables)
        for name, variable in run.data.variables.items():
            assert file[name].dimensions == variable.dims
            values = variable.to_numpy()
            expected = values.astype(object) if values.dtype.kind == "U" else values
            assert_array_equal(np.ma.getdata(file[name][...]), expected)
        assert file["q"].units == run.data["q"].attrs["units"]
        assert set(file.groups) == {"origin"}


def test_what_the_reference_implementation_adds_is_kept(run, tmp_path):
    run.save(tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc", "a") as file:
        file.createVariable("temperature", "f8", ("time",))[:] = np.arange(len(run.time))
        file.comment = "outdoors"
    data = pc.Run.load(tmp_path / "a.nc").data
    assert_array_equal(data["temperature"], np.arange(len(run.time)))
    assert data.attrs["comment"] == "outdoors"
    assert_array_equal(data["q"], run.data["q"])
