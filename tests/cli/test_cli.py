"""The command line as a user meets it: in a process of its own."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from patience import PATIENCE, wait_until

from pathcontrol.cli import main

COMMAND = [sys.executable, "-m", "pathcontrol"]


def call(*arguments, **options):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE, **options)


@pytest.mark.parametrize(
    "arguments", [["--help"], *([name, "--help"] for name in ("reproduce", "run", "sweep", "view", "report", "check"))]
)
def test_help_imports_nothing_heavy(arguments):
    """What takes the time is the imports; a clock would only measure how busy the machine is."""
    code = (
        "import sys\nfrom pathcontrol.cli import main\n"
        f"main({arguments!r}, standalone_mode=False)\n"
        "heavy = {'numpy', 'scipy', 'pinocchio', 'xarray', 'matplotlib', 'meshcat', 'yourdfpy', 'pydantic', 'rich'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE)
    assert "Usage:" in done.stdout
    assert done.stderr.strip() == "[]"


def test_importing_the_package_is_light():
    code = (
        "import sys, pathcontrol\n"
        "assert 'Circle' in dir(pathcontrol)\n"
        "print(sorted({'matplotlib', 'meshcat', 'dask', 'pinocchio', 'xarray'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE)
    assert done.stdout.strip() == "[]"


def test_check_reports_and_exits_with_a_code(tmp_path):
    assert CliRunner().invoke(main, ["check", "cicese_2dof"]).exit_code == 0
    bad = tmp_path / "bad.urdf"
    bad.write_text("<robot name='x'><link name='a'/></robot>")
    done = call("check", bad, "--json")
    assert done.returncode == 1
    report = json.loads(done.stdout)
    assert not report["ok"]
    assert any(finding["level"] == "error" for finding in report["findings"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "none.urdf"], ["none.urdf"]),
        (["check", "no_such_robot"], ["no_such_robot", "cicese_2dof"]),
        (["run", "none.toml"], ["none.toml"]),
        (["run"], ["--example"]),
    ],
)
def test_errors_are_one_message_without_a_traceback(arguments, words):
    done = call(*arguments)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert all(word in done.stderr for word in words), done.stderr
    assert done.stdout == ""


def test_run_prints_metrics_and_writes_beside_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = CliRunner().invoke(main, ["run", "--example"]).stdout.replace("duration = 10.0", "duration = 0.2")
    text = text.replace('html = "run.html"', "").replace('figure = "run"', "")
    Path("mine.toml").write_text(text)
    done = CliRunner().invoke(main, ["run", "mine.toml", "--json"])
    assert done.exit_code == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["metrics"]["e_p_peak"][0] > 0
    assert Path(report["written"]["data"]).parent == Path("results/mine")
    again = CliRunner().invoke(main, ["run", "mine.toml"])
    assert "settling_time" in again.stdout
    peak = re.search(r"e_p_peak +([\d.]+) deg", again.stdout)[1]
    assert float(peak) == pytest.approx(np.rad2deg(report["metrics"]["e_p_peak"][0]), rel=1e-3)
    assert "speed_ratio" in again.stdout


def test_check_knows_the_joints_that_it_locks():
    done = CliRunner().invoke(main, ["check", "cicese_2dof", "--lock", "joint_2"])
    assert done.exit_code == 0
    assert "1 movable joints and 1 locked" in done.stdout
    done = CliRunner().invoke(main, ["check", "cicese_2dof", "--lock", "nose"])
    assert done.exit_code == 2
    assert "nose" in done.stderr


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="looks into /proc to see what is loaded")
@pytest.mark.parametrize("library", ["_multiarray_umath", "pinocchio_pywrap"])
def test_ctrl_c_while_everything_is_imported(tmp_path, library):
    process = subprocess.Popen(
        [*COMMAND, "reproduce", "--out", str(tmp_path / "out")], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    maps = Path(f"/proc/{process.pid}/maps")
    wait_until(lambda: library in maps.read_text() or process.poll() is not None, pause=0.002)
    os.kill(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, err
    assert b"Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_the_console_script_is_the_same_command():
    assert main.name == "main"
    known = {
        "reproduce",
        "run",
        "sweep",
        "tune",
        "compare",
        "view",
        "report",
        "check",
        "toolpath",
        "export",
        "identify",
        "stability",
        "sil",
    }
    assert set(main.commands) == known
