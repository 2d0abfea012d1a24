"""A run is the same to its users whether anybody has asked for its labels before or not."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import xarray as xr

from pathcontrol import (
    ExtendedMotionPlan,
    Line,
    PathControlWarning,
    Projection,
    Run,
    SampledLoop,
    UnknownNameError,
    simulate,
    simulate_sequence,
    steady_state,
)


def plan(arm, task):
    return ExtendedMotionPlan(arm, task, 800.0, [45.0, 100.0], 20.0)


def closed(arm, circle):
    loop = SampledLoop(torque_limits=True)
    return simulate(Projection(arm, circle, 800.0, [45.0, 100.0]), [0.7, 1.2], duration=0.6, loop=loop, progress=False)


def many(arm, circle):
    return simulate(plan(arm, circle), np.linspace(0.3, 0.9, 6).reshape(3, 2), duration=0.2, progress=False)


def diverged(arm, circle):
    """One of two rollouts has far too much gain."""
    law = ExtendedMotionPlan(arm, circle, [[800.0, 800.0], [1e9, 1e9]], [45.0, 100.0], 20.0)
    with pytest.warns(PathControlWarning, match="rollout 1"):
        return simulate(law, [[0.7, 1.2]] * 2, duration=0.2, progress=False)


def several_paths(arm, circle):
    there, back = Line([0.0, 0.0], [0.1, 0.1], 1.0), Line([0.1, 0.1], [0.0, 0.0], 1.0)
    return simulate_sequence([plan(arm, there), plan(arm, back)], [0.0, 0.0], duration=2.0, progress=False)


def sliding(arm, circle):
    arrays = {name: np.random.default_rng(0).normal(size=(1, 4, 2)) for name in ("q", "qd", "tau", "e_p")}
    arrays |= {"s": np.arange(4.0)[None], "regular": np.array([[True, False, True, True]])}
    return Run.from_arrays(0.1 * np.arange(4), {"a": "rad", "b": "m"}, arrays, {})


MAKERS = [closed, many, diverged, several_paths, sliding]


@pytest.fixture(params=MAKERS, ids=lambda make: make.__name__)
def pair(request, arm, circle):
    """A run twice: as it comes, and labelled."""
    with np.errstate(all="ignore"):
        plain, labelled = request.param(arm, circle), request.param(arm, circle)
    assert labelled.data.sizes["time"] == len(plain.time)
    return plain, labelled


def tree(path):
    """All that is in an HDF5 file, but for how dimensions refer to each other."""
    found = {}

    def look(name, item):
        about = {k: repr(v) for k, v in item.attrs.items() if k not in ("DIMENSION_LIST", "REFERENCE_LIST")}
        if isinstance(item, h5py.Dataset) and not about.get("NAME", "").startswith("np.bytes_(b'This is a netCDF dim"):
            packing = item.dtype.str, item.compression, item.compression_opts, item.shuffle, item.chunks
            found[name] = about, packing, item.shape, repr(item[()].tolist())
        else:
            found[name] = about

    with h5py.File(path) as file:
        look("/", file)
        file.visititems(look)
    return found


def test_its_file_is_the_same(pair, tmp_path):
    """Names, dimensions, attributes, types, compression and numbers."""
    paths = [run.save(tmp_path / f"{k}.nc") for k, run in enumerate(pair)]
    plain, labelled = map(tree, paths)
    assert plain.keys() == labelled.keys()
    for name, content in plain.items():
        assert content == labelled[name], name
    with xr.open_dataset(paths[0], engine="h5netcdf", decode_times=False) as by_xarray:
        expected = pair[1].data
        assert set(by_xarray.coords) == set(expected.coords)
        xr.testing.assert_equal(by_xarray.load().drop_attrs(), expected.drop_attrs())
    for path in paths:
        xr.testing.assert_identical(Run.load(path).data, pair[1].data)


def test_names_and_units_are_the_same(pair):
    plain, labelled = pair
    names = list(labelled.data.variables)
    assert {name: plain.unit(name) for name in names} == {name: labelled.unit(name) for name in names}
    assert plain.joints == labelled.joints == [str(name) for name in labelled["joint"].to_numpy()]
    for run in pair:
        with pytest.raises(UnknownNameError, match="no variable 'nothing'"):
            run.unit("nothing")


def test_units_of_turning_and_sliding_joints():
    run = sliding(None, None)
    assert [run.unit(name) for name in ("q", "qd", "tau", "s", "time")] == [
        "rad or m",
        "rad/s or m/s",
        "N m or N",
        "1",
        "s",
    ]


def test_parts_are_the_same(pair):
    plain, labelled = pair
    for index in (0, -1):
        xr.testing.assert_identical(plain.rollout(index).data, labelled.rollout(index).data)
    late = steady_state(plain), steady_state(labelled)
    xr.testing.assert_identical(late[0].data, late[1].data)


def test_what_is_done_to_a_rollout_does_not_reach_the_run(pair):
    for run in pair:
        before, part = run.array("q").copy(), run.rollout(0)
        part.data["q"] += 1.0
        np.testing.assert_array_equal(run.array("q"), before)
