"""Ctrl-C while a chunk is being noted: the chunk counts, and its files are there."""

from __future__ import annotations

import signal

import pytest

import pathcontrol as pc
from pathcontrol.sweeps import manifest
from pathcontrol.sweeps.store import Store

pytest.importorskip("pyarrow")
SPACE = pc.Space.given({"k": [1.0, 2.0, 3.0, 4.0]})


def build(p, samples):
    law = pc.ExtendedMotionPlan(pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0), 800.0, 45.0, p["k"])
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.01}


@pytest.mark.parametrize("pressed", ["before", "after"])
@pytest.mark.parametrize("kept", [0, 1])
@pytest.mark.parametrize("chunk", [1, 2])
def test_a_chunk_that_is_noted_is_there(pressed, kept, chunk, tmp_path, monkeypatch):
    real, calls = manifest.append_line, []

    def append(path, line):
        calls.append(line)
        if pressed == "before" and len(calls) == chunk:
            signal.raise_signal(signal.SIGINT)
        real(path, line)
        if pressed == "after" and len(calls) == chunk:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(manifest, "append_line", append)
    options = {"metrics": ["e_p_peak"], "keep": pc.Keep(random=2 * kept), "chunk": 1, "progress": False}
    with pytest.raises(KeyboardInterrupt):
        pc.sweep(build, SPACE, tmp_path / "out", **options)
    assert len(Store(tmp_path / "out").columns()["sample"]) == chunk
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    whole = pc.sweep(build, SPACE, tmp_path / "out", resume=True, **options)
    assert whole.finished == 4
    assert len(calls) == 4
