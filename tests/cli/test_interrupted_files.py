"""Ctrl-C at any moment of writing leaves the old file or the new one, and nothing beside it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import click
import pytest
from click.testing import CliRunner
from patience import PATIENCE

from pathcontrol import _files
from pathcontrol._files import whole_file, write_whole
from pathcontrol.cli.group import Group


def interrupted_at(step, act):
    """Run ``act`` with a KeyboardInterrupt before the ``step``-th instruction of the module; whether there is one."""
    left = step

    def trace(frame, event, argument):
        nonlocal left
        if frame.f_code.co_filename != _files.__file__:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            left -= 1
            if left == 0:
                raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        act()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def test_an_interrupt_before_any_instruction_leaves_the_old_file_or_the_new_one(tmp_path):
    target, step = tmp_path / "run.nc", 0
    found = set()
    while True:
        step += 1
        target.write_bytes(b"old")
        if not interrupted_at(step, lambda: write_whole(target, b"new")):
            break
        _files.remove_own_parts()  # as the interpreter does at its end
        assert [file.name for file in tmp_path.iterdir()] == ["run.nc"], step
        found.add(target.read_bytes())
    assert found == {b"old", b"new"}
    assert step > 100


def test_what_could_not_be_removed_at_once_goes_with_the_process(tmp_path):
    program = """
import os, sys
from pathlib import Path
from pathcontrol._files import whole_file

close = os.close

def interrupted(descriptor):
    close(descriptor)
    os.close = close
    raise KeyboardInterrupt

try:
    with whole_file(sys.argv[1]) as temporary:
        temporary.write_bytes(b"half")
        os.close = interrupted
        raise KeyboardInterrupt
except KeyboardInterrupt:
    assert temporary.exists()
"""
    subprocess.run([sys.executable, "-c", program, str(tmp_path / "run.nc")], check=True, timeout=PATIENCE)
    assert not list(tmp_path.iterdir())


def test_a_whole_file_is_written_after_one_that_was_interrupted(tmp_path):
    target = tmp_path / "run.nc"

    def write_half():
        with whole_file(target) as temporary:
            temporary.write_bytes(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert not list(tmp_path.iterdir())
    write_whole(target, b"whole")
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"whole"]


@pytest.mark.parametrize("times", [1, 3])
def test_an_interrupt_that_python_would_lose_is_kept(times):
    """In a callback of the garbage collector Python prints the exception and goes on."""

    class Dying:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0)

    @click.group(cls=Group)
    def main():
        """A command line."""

    @main.command()
    def work():
        """Work until it is interrupted, while objects are cleared away."""
        for _ in range(times):
            Dying()
        for _ in range(100):
            time.sleep(0.1)

    before = sys.unraisablehook
    done = CliRunner().invoke(main, ["work"])
    assert (done.exit_code, done.stderr) == (130, "interrupted; no half-written file is left behind\n")
    assert sys.unraisablehook is before
