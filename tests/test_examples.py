"""Every example runs as a user would run it, and writes what it says."""

from __future__ import annotations

import importlib.util
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE

ROOT = Path(__file__).parent.parent
EXAMPLES = {
    "paper_experiments": 10,
    "motion_control": 12,
    "six_joints": 3,
    "lettering": 3,
    "mill_pocket": 3,
    "deburr_bracket": 3,
    "tune_gains": 3,
    "jammed_joint": 3,
    "operators_override": 3,
    "weak_motors": 3,
    "control_loop": 4,
    "lost_sign": 2,
    "basins": 3,
    "predictive_control": 2,
    "learning": 3,
}
OF_A_PACKAGE = {"tune_gains": "pymoo", "predictive_control": "casadi"}
OF_THE_EXTRA = {"six_joints", "mill_pocket", "deburr_bracket"}
BY_ITSELF = "custom_task"  # runs in a process of its own
ALONG_FILES = {"lettering", "mill_pocket", "deburr_bracket"}


def assert_written(folder, count):
    written = list(folder.iterdir())
    assert len(written) == count
    assert all(path.stat().st_size > 1000 for path in written)


@pytest.mark.filterwarnings("error::pathcontrol.errors.PathControlWarning")
@pytest.mark.parametrize("name", EXAMPLES)
def test_example(name, tmp_path, monkeypatch, capsys):
    if name in OF_THE_EXTRA:
        pytest.importorskip("example_robot_data")
    if name in OF_A_PACKAGE:
        pytest.importorskip(OF_A_PACKAGE[name])
    monkeypatch.setattr(sys, "argv", [f"{name}.py", str(tmp_path)])
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert_written(tmp_path, EXAMPLES[name])
    if name in ALONG_FILES:
        ended, distance = re.search(r", (\w+) after .*: (\d+) µm", printed, re.DOTALL).groups()
        assert ended == "finished"
        assert 0 < int(distance) < 500  # friction and payload that the law does not know leave some 0.1 to 0.4 mm
    if name == "motion_control":  # path control keeps nearer to the path
        errors = {m[1].strip(): float(m[2]) for m in re.finditer(r"^(\S.*?)\s{2,}([\d.]+)$", printed, re.MULTILINE)}
        assert len(errors) == 5
        assert max(errors["extended motion plan"], errors["projection"]) < min(errors["computed torque"], errors["PD+"])
    if name == "jammed_joint":  # path control is carried away less far
        peaks = {m[1]: float(m[2]) for m in re.finditer(r"^(\w+) +([\d.]+) +\d+ +[\d.]+$", printed, re.MULTILINE)}
        assert max(peaks["extended_motion_plan"], peaks["projection"]) < peaks["computed_torque"]
    if name == "learning":  # both begin with the law alone
        errors = [tuple(map(float, pair)) for pair in re.findall(r": +([\d.]+) deg, learned +([\d.]+) deg", printed)]
        assert len(errors) == 4
        assert errors[1][0] == errors[1][1]
        assert errors[3][1] < 0.2 * errors[3][0]
    if name == "tune_gains":
        rows = re.findall(r"^(paper|tuned) +(\d) kg +([\d.]+) +([\d.]+) +([\d.]+)$", printed, re.MULTILINE)
        error = {(who, load): float(e) for who, load, e, _, _ in rows}
        share = {(who, load): float(s) for who, load, _, s, _ in rows}
        assert error["tuned", "1"] < error["paper", "1"]
        assert max(share["tuned", "0"], share["tuned", "1"]) <= 1.0 < share["paper", "1"]


def test_an_example_is_a_script(tmp_path):
    """Started by itself, as a user does; the others run here, where all is imported."""
    script = ROOT / "examples" / f"{BY_ITSELF}.py"
    ran = subprocess.run([sys.executable, script, tmp_path], check=True, timeout=PATIENCE, capture_output=True)
    assert b"Warning" not in ran.stderr
    assert_written(tmp_path, 3)


def test_every_example_is_tested():
    assert {p.stem for p in (ROOT / "examples").glob("*.py")} == {*EXAMPLES, BY_ITSELF}


def test_the_readmes_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
    exec(compile(code, "README.md", "exec"), {"__name__": "readme"})
    assert {p.name for p in (tmp_path / "results").iterdir()} == {
        "triangle.svg",
        "triangle.png",
        "triangle.html",
        "triangle.nc",
        "triangle-report.html",
    }


def test_the_custom_task_is_ten_lines():
    source = (ROOT / "examples" / "custom_task.py").read_text()
    body = re.search(r"class RoundedTriangle.*?(?=\n\n\nif )", source, re.DOTALL)[0]
    lines = [line for line in body.splitlines() if line.strip() and not line.strip().startswith('"""')]
    assert len(lines) <= 10
    spec = importlib.util.spec_from_file_location("custom_task", ROOT / "examples" / "custom_task.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.RoundedTriangle(0.9, 1.5).n == 2
