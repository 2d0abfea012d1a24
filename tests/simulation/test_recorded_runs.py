"""The record of a run: its labels, its file, and the room that it takes."""

from __future__ import annotations

import ctypes
import json
import mmap
import sys
from pathlib import Path

import numpy as np
import pytest
from test_simulation import START, paper_law

from pathcontrol import (
    Circle,
    ComputedTorque,
    ContinuousTime,
    InputError,
    Projection,
    Run,
    SampledLoop,
    simulate,
)
from pathcontrol.simulation import record_memory, recorder
from pathcontrol.simulation.recorder import Recorder


def test_a_run_is_labelled(arm, circle):
    run = simulate(paper_law(arm, circle), [START, START + 0.1, START - 0.1], duration=0.1, progress=False)
    assert dict(run.data.sizes) == {"rollout": 3, "time": 41, "joint": 2}
    assert run["q"].dims == ("rollout", "time", "joint")
    assert list(run["joint"].to_numpy()) == ["joint_1", "joint_2"]
    assert run["tau"].attrs["units"] == "N m"
    assert run["time"].attrs["units"] == "s"
    assert run.time[-1] == pytest.approx(0.1)
    assert run.config["controller"]["k"] == 20.0
    assert run.config["controller"]["task"]["radius"] == circle.radius
    assert run.config["plant"]["friction"]["law"] == "FrictionSum"
    assert np.array_equal(run.rollout(1).array("q")[0], run.array("q")[1])


def test_a_run_survives_the_disk(arm, circle, tmp_path):
    run = simulate(paper_law(arm, circle), START, duration=0.1, progress=False)
    path = run.save(tmp_path / "deep" / "run.nc")
    again = Run.load(path)
    assert again.data.identical(run.data)
    assert again.config == json.loads(json.dumps(run.config))
    assert path.read_bytes()[:8] == b"\x89HDF\r\n\x1a\n"  # plain netCDF-4, nothing pickled
    assert [p.name for p in path.parent.iterdir()] == ["run.nc"]


def test_a_file_is_whole_or_not_there(arm, circle, tmp_path, monkeypatch):
    run = simulate(paper_law(arm, circle), START, duration=0.1, progress=False)
    path = run.save(tmp_path / "run.nc")
    before = path.read_bytes()

    def interrupted(self, target):
        self.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]


def test_loading_something_else(tmp_path):
    with pytest.raises(InputError, match="there is no file"):
        Run.load(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("not a run")
    with pytest.raises(InputError, match="not a run saved by"):
        Run.load(tmp_path / "text.nc")


def test_a_law_that_knows_the_time_is_recorded_as_it_acted(ideal_arm, circle):
    class Clock(ComputedTorque):
        def law(self, t, q, qd, z):
            return super().law(t, q, qd, z)._replace(tau=np.full(q.shape, t))

    for loop in (SampledLoop(), ContinuousTime()):
        run = simulate(Clock(ideal_arm, circle, 1.0, 1.0), START, duration=0.1, loop=loop, progress=False)
        assert np.allclose(run.array("tau")[0, :, 0], run.time)


def test_a_task_may_carry_anything(ideal_arm):
    """What cannot be written into the record of a run is left out of it, and never costs the run."""

    class Loaded(Circle):
        def __init__(self):
            super().__init__(1.0, 1.0)
            self.ragged, self.function, self.label = [[1], [1, 2]], np.sin, "inner contour"

    run = simulate(Projection(ideal_arm, Loaded(), 100.0, 20.0), START, duration=0.01, progress=False)
    described = run.config["controller"]["task"]
    assert described["label"] == "inner contour"
    assert described["radius"] == 1.0
    assert "ragged" not in described
    json.dumps(run.config)


@pytest.mark.parametrize("room", [1, 3000, 1 << 20])
def test_a_run_is_the_same_however_often_its_room_grows(arm, circle, room, monkeypatch):
    def run():
        return simulate(paper_law(arm, circle), [START, START / 2], duration=0.3, progress=False)

    plenty = run()
    monkeypatch.setattr(recorder, "_ROOM", room)
    for name in plenty.data.data_vars:
        np.testing.assert_array_equal(run().array(name), plenty.array(name), err_msg=name)


def resident(array):
    """How many bytes of an array are in memory; the rest is only reserved."""
    page, libc = mmap.PAGESIZE, ctypes.CDLL(None, use_errno=True)
    begin = array.__array_interface__["data"][0] // page * page
    pages = (ctypes.c_ubyte * (-(-array.nbytes // page)))()
    assert libc.mincore(ctypes.c_void_p(begin), ctypes.c_size_t(array.nbytes), pages) == 0
    return page * sum(state & 1 for state in pages)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells which pages are in memory")
@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_a_run_that_ends_long_before_its_time_keeps_no_room_for_the_rest(arm, circle, engine, monkeypatch):
    monkeypatch.setattr(record_memory, "_kept", [])  # that of other tests may be in memory still
    recorders, module = [], {"compiled": "compiled", "pinocchio": "sampled"}[engine]
    monkeypatch.setattr(
        f"pathcontrol.simulation.{module}.Recorder", lambda *a: recorders.append(Recorder(*a)) or recorders[-1]
    )
    run = simulate(paper_law(arm, circle), START, duration=1e7, laps=1, engine=engine, progress=False)
    assert run.finish_time[0] < 5
    arrays = recorders[0].arrays()
    kept = sum(array.nbytes for array in arrays.values())
    assert kept < 1e6
    used = resident(recorders[0]._block)
    assert kept <= used < kept + (4 << 20), used  # a large page more at either end
