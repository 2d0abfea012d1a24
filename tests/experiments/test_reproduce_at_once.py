"""Both experiments at once, in a process each, write what they write one after the other."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading

import pytest

from pathcontrol.experiments import reproduce as module

COMMAND = [sys.executable, "-m", "pathcontrol", "reproduce", "--out"]


def run(out, cores):
    """Run the command on some cores only."""
    return subprocess.run(
        [*COMMAND, str(out)],
        capture_output=True,
        text=True,
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="there is one core only")
def test_files_are_the_same_to_the_last_bit_on_one_core_and_on_two(tmp_path):
    cores = sorted(os.sched_getaffinity(0))[:2]
    for name, some in (("one", cores[:1]), ("two", cores)):
        done = run(tmp_path / name, some)
        assert done.returncode == 0, done.stderr
    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "two").iterdir())
    assert len(files) == 2 * 2 + 2 * 2 * 2 + 1
    for name in files:
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        if name == "summary.json":
            one, two = (json.loads(text) | {"seconds": 0.0} for text in (one, two))
        assert one == two, name


@pytest.mark.parametrize("count", [1, 2])
def test_errors_of_a_process_are_told_in_one_sentence(tmp_path, count):
    cores = sorted(os.sched_getaffinity(0))[:count]
    (tmp_path / "out" / "figure_09.png").mkdir(parents=True)
    done = run(tmp_path / "out", cores)
    assert done.returncode == 2
    assert "figure_09.png" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out" / "summary.json").exists()


def test_a_program_with_threads_is_not_forked():
    over = threading.Event()
    waiting = threading.Thread(target=over.wait)
    waiting.start()
    try:
        with module._mapped() as apply:
            assert apply is map
    finally:
        over.set()
        waiting.join()
