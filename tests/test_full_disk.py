"""A disk that takes no more is one plain error, and leaves no half of a file, whoever writes and wherever it ends."""

from __future__ import annotations

import ast
import errno
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import traceback
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import pathcontrol as pc
from pathcontrol import _files
from pathcontrol._files import append_line, write_whole
from pathcontrol.cli import main
from pathcontrol.errors import InputError, StorageError

pytest.importorskip("pyarrow")

ROBOT = pc.load_robot("cicese_2dof")
SPACE = pc.Space.random({"K_p": stats.loguniform(100.0, 1e4)}, 6)
EXPERIMENT = """
duration = 0.02
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 2.0
[controller]
type = "projection"
k_p = 800.0
K_v = 45.0
[output]
html = "run.html"
figure = "run"
summary = "summary.json"
"""


def circle(p, samples):
    law = pc.ComputedTorque(ROBOT, pc.Circle(1.0, 2.0), p["K_p"][:, None], [45.0, 100.0])
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.02}


def swept(folder, **options):
    usual = {"metrics": ["e_p_peak"], "keep": pc.Keep(worst=1, by="e_p_peak"), "chunk": 2, "progress": False}
    return pc.sweep(circle, SPACE, folder, **usual | options)


def tuned(folder, **options):
    pytest.importorskip("pymoo")
    size = {"population": 5, "generations": 2}
    return pc.tune(circle, SPACE, ["e_p_peak"], out=folder, progress=False, **size, **options)


@pytest.fixture(scope="module")
def run():
    return pc.simulate(**circle({"K_p": np.array([800.0])}, np.arange(1)), progress=False)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The files of a sweep or a search that nothing stopped, by what makes them."""

    @cache
    def made(act) -> dict[str, bytes]:
        folder = tmp_path_factory.mktemp("whole") / "whole"
        act(folder)
        return content(folder)

    return made


def content(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def limited(act, most: int, after) -> None:
    """Run ``act`` where no file may have more than ``most`` bytes, which stands for a full disk, and ``after`` then."""

    def child():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))
        try:
            with pytest.raises(
                StorageError, match=r"^'[^\n]*' cannot be written: [^\n]*; no half-written file"
            ) as error:
                act()
            assert error.value.errno == errno.EFBIG
            resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
            after()
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        os._exit(0)

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    process.join(300)
    assert process.exitcode == 0


WRITERS = {
    "save": lambda run, folder: run.save(folder / "run.nc"),
    "page": lambda run, folder: pc.record(run).save(folder / "run.html"),
    "report": lambda run, folder: pc.report(run, folder / "report.html"),
    "figures": lambda run, folder: pc.save_figure(
        pc.error_figure(run), folder / "figure", formats=("svg", "png", "pdf")
    ),
}


@pytest.mark.parametrize(
    ("writer", "most"), [("save", 0), ("save", 8000), ("page", 0), ("page", 8000), ("report", 8000), ("figures", 8000)]
)
def test_what_was_there_before_stays_and_nothing_else(writer, most, run, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])  # drawn in memory
    for name in ("run.nc", "run.html", "report.html", "figure.svg", "figure.png", "figure.pdf"):
        (tmp_path / name).write_bytes(b"before")
    before = content(tmp_path)

    def unchanged():
        assert content(tmp_path) == before

    limited(lambda: WRITERS[writer](run, tmp_path), most, unchanged)


@pytest.mark.parametrize("most", [0, 1000, 2500, 6000])
@pytest.mark.parametrize("act", [swept, tuned])
def test_what_was_finished_before_the_disk_was_full_is_whole_and_gone_on_with(act, most, whole, tmp_path):
    finished = whole(act)

    def gone_on_with():
        assert not [file for file in tmp_path.rglob(".*") if file.is_file()]
        act(tmp_path / "part", resume=True)
        assert content(tmp_path / "part") == finished

    if most < max(map(len, finished.values())):
        limited(lambda: act(tmp_path / "part"), most, gone_on_with)


@pytest.mark.parametrize("taken", [0, 1, 6])
def test_a_line_is_noted_whole_or_not_at_all(taken, monkeypatch, tmp_path):
    """A disk may take some bytes of what is written, and no more only then."""
    file, write = tmp_path / "files.log", os.write
    append_line(file, "first")

    def short(descriptor, content):
        if len(content) <= 7 - taken:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, content[:taken])

    monkeypatch.setattr(_files.os, "write", short)
    with pytest.raises(StorageError, match=r"files\.log' cannot be written: No space left"):
        append_line(file, "second" if taken else "")
    monkeypatch.undo()
    append_line(file, "third")
    assert file.read_text() == "first\nthird\n"


def test_a_folder_that_is_a_file_or_takes_nothing_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/run\.nc' cannot be written: '.*file' is a file, expected a folder"):
        write_whole(tmp_path / "file" / "run.nc", b"")
    with pytest.raises(StorageError, match="name too long"):
        write_whole(tmp_path / ("a" * 300 + ".nc"), b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("words", [["--help"], ["check", "cicese_2dof", "--json"]])
def test_output_to_a_full_disk_is_one_line(words):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "pathcontrol", *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1


def test_a_command_on_a_full_disk_is_one_line(tmp_path):
    (tmp_path / "e.toml").write_text(EXPERIMENT)

    def written():
        assert [file.name for file in tmp_path.rglob("*") if file.is_file()] == ["e.toml"]

    def act():
        main(["run", str(tmp_path / "e.toml"), "--out", str(tmp_path / "out")], standalone_mode=False)

    def child():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        act()

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    process.join(300)
    assert process.exitcode == 2
    written()


def test_every_writer_writes_whole_files():
    """Nothing in the package opens a file to write but where a temporary one is given."""
    for file in Path(pc.__file__).parent.rglob("*.py"):
        text = file.read_text()
        if "open(" not in text and ".write_" not in text:
            continue
        for call in (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)):
            name = ast.unparse(call.func)
            writes = name.endswith((".write_text", ".write_bytes"))
            writes |= name.endswith("open") and any(ast.unparse(a) in ("'w'", "'wb'", "'a'") for a in call.args)
            # on a worker's own scratch disk, and a log that is written while its loop runs and read without its end
            if writes and file.name not in ("shipping.py", "loop_log.py"):
                assert name.startswith("temporary."), f"{file}: line {call.lineno}: {name}"
