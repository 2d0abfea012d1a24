"""``pathcontrol toolpath`` and experiments along a toolpath, as a user runs them."""

from __future__ import annotations

import json
import math
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from pathcontrol import ExperimentError, Run
from pathcontrol.cli import main
from pathcontrol.cli.tables import _deal_columns, peaks_table, toolpath_tables
from pathcontrol.experiments.runner import load_setup, run_experiment
from pathcontrol.view.figures.style import save_figure

SQUARE = """G21 G90 G17
G0 X0 Y0 Z0
G1 X100 F1200
G1 Y50
G3 X80 Y70 I-20 J0
G1 X0
G1 Y0
M30
"""

EXPERIMENT = """
angle_unit = "deg"
[robot]
source = "cicese_2dof"
tool = { frame = "tool", position = [0.0, 0.0, -0.05] }
[task]
type = "toolpath"
file = "part.ngc"
frame = "tip"
workpiece = { position = [0.3, -0.05, 0.7], rpy = [90.0, 0.0, 0.0] }
clearance = 0.0
acceleration = 2.0
[controller]
type = "extended_motion_plan"
K_p = 800.0
K_v = 45.0
k = 2.0
friction = "full"
[loop]
torque_limits = true
[output]
html = "part.html"
figure = "part"
summary = "part.json"
"""


def called(*arguments) -> tuple[int, str, str]:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture
def part(tmp_path) -> Path:
    path = tmp_path / "part.ngc"
    path.write_text(SQUARE, encoding="utf-8")
    return path


def test_json_says_what_is_in_a_file(part):
    code, out, _ = called("toolpath", part, "--json")
    content = json.loads(out)
    assert code == 0
    (cut,) = content["contours"]
    assert cut["length_m"] == pytest.approx(0.1 + 0.05 + 0.02 * math.pi / 2 + 0.08 + 0.07)
    assert (cut["closed"], cut["rapid"], cut["corners"]) == (True, False, 3)
    assert cut["feed_m_s"] == pytest.approx(0.02)
    assert cut["sharpest_deg"] == pytest.approx(90.0)
    assert np.allclose(content["bounds_m"], [[0, 0, 0], [0.1, 0.07, 0]])
    assert content["cut_length_m"] == pytest.approx(cut["length_m"])


def test_the_table_is_in_millimetres(part):
    code, out, _ = called("toolpath", part)
    words = " ".join(out.split())
    assert code == 0
    assert "331.416 mm of cuts" in words
    assert "within 100 × 70 × 0 mm" in words
    assert "closed" in words


def test_plot_writes_a_picture(part, tmp_path):
    code, out, _ = called("toolpath", part, "--plot", tmp_path / "plan.svg", "--json")
    assert code == 0
    assert [Path(name).name for name in json.loads(out)["figures"]] == ["plan.svg", "plan.png"]
    assert "corner (3)" in (tmp_path / "plan.svg").read_text()
    assert (tmp_path / "plan.png").stat().st_size > 5000


def test_names_from_a_file_are_text(tmp_path, monkeypatch):
    """Neither the markup of the terminal nor that of the figure."""
    path = tmp_path / "odd.svg"
    line = '<path id="[bold]$x$[/]" d="M0 0 H9"/>'
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm">{line}</svg>')
    monkeypatch.setenv("COLUMNS", "200")
    code, out, _ = called("toolpath", path)
    assert code == 0
    assert "[bold]$x$[/]" in out


@pytest.mark.parametrize(
    ("name", "text", "options", "message"),
    [
        ("part.ngc", "G21 G90\nG1 X1\n", [], "line 2"),
        ("part.stp", "", [], "ends in '.stp', expected one of .csv"),
        ("part.ngc", SQUARE, ["--ppi", "96"], "which takes --unit, --start, .*, not --ppi"),
        ("part.csv", "x,y,z\n0,0,0\n1,nan,0\n", [], "line 3"),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, name, text, options, message):
    (tmp_path / name).write_text(text)
    code, _, err = called("toolpath", tmp_path / name, *options)
    assert code == 2
    assert re.search(message, err)


def test_a_file_cannot_command_the_terminal(tmp_path):
    path = tmp_path / "odd.dxf"
    path.write_text("\033[31mEVIL\033]0;pwned\007 x\n0\n")
    code, _, err = called("toolpath", path)
    assert code == 2
    assert "\033" not in err


def test_a_feed_does_not_hurt_a_program_and_a_start_helps_it(part):
    assert called("toolpath", part, "--feed", "0.05")[0] == 0
    part.write_text("G21 G90\nG1 X10 F600\n")
    assert called("toolpath", part)[0] == 2
    code, out, _ = called("toolpath", part, "--start", "0", "0", "0", "--json")
    assert code == 0
    assert json.loads(out)["cut_length_m"] == pytest.approx(0.01)


def test_a_missing_file_is_refused(tmp_path):
    code, _, err = called("toolpath", tmp_path / "none.dxf")
    assert code == 2
    assert "none.dxf" in err


# --- experiments --------------------------------------------------------------------------------------------


@pytest.fixture
def experiment(part) -> Path:
    path = part.with_name("part.toml")
    path.write_text(EXPERIMENT, encoding="utf-8")
    return path


def test_an_experiment_follows_the_program(experiment, tmp_path, monkeypatch):
    # test_every_output has figures in all formats
    monkeypatch.setattr("pathcontrol.view.figures.style.save_figure", partial(save_figure, formats=("svg",)))
    done = run_experiment(experiment, tmp_path / "out", progress=False)
    assert done.run.status[0] == "finished"
    assert done.metrics["tool_deviation_peak"][0] < 1e-3
    assert done.metrics["smoothing_deviation"][0] <= 1.001e-4
    assert {path.name for path in done.written.values()} >= {"run.nc", "part.json", "part.html", "part-deviation.svg"}
    again = Run.load(done.written["data"])
    assert list(again["path_status"].to_numpy()) == ["finished"]


def test_the_arm_begins_on_the_path_and_in_time(experiment):
    setup = load_setup(experiment)
    assert np.array_equal(setup.q, setup.task.q_d(np.array(0.0)))
    tip = setup.plant.frame_pose(setup.q, "tip")[:3, 3]
    assert np.allclose(tip, [0.3, -0.05, 0.7], atol=2e-4)
    s = np.linspace(0, setup.task.s_end, 4001)
    assert setup.duration == pytest.approx(2 * np.trapezoid(1 / setup.task.theta(s), s) + 5, rel=1e-2)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('file = "part.ngc"', 'file = "xyz.ngc"', "task.file: there is no file 'xyz.ngc' in .*, the folder of the exp"),
        ('file = "part.ngc"', 'file = "prat.ngc"', "; did you mean 'part.ngc'"),
        ('frame = "tip"', 'frame = "top"', "has no frame 'top'.*; did you mean 't"),
        ("position = [0.3, -0.05, 0.7]", 'position = ["300", -0.05, 0.7]', r"position\[0\] = '300', expected a unit "),
        (
            "position = [0.3, -0.05, 0.7]",
            "position = [300.0, -50.0, 700.0]",
            r"task.workpiece.position = \[300.0, -50.0, 700.0\] has the drawing 7.* m from .* did you mean millimetres",
        ),
        ("position = [0.3, -0.05, 0.7]", "position = [0.3, -0.05]", "workpiece.position = .*expected three"),
        ("position = [0.3, -0.05, 0.7]", "position = [3.0, -0.05, 0.7]", "task: contour 0 of 1 .*: "),
        ("clearance = 0.0", "clearance = -1.0", "task.clearance = -1.0, expected a number not below 0"),
        ("clearance = 0.0", 'unit = "furlong"', "furlong"),
        ("clearance = 0.0", "ppi = 96.0", "task.file: .*which takes unit =, tool_start =, .*, not ppi ="),
        ('tool = { frame = "tool"', 'tool = { frame = "hand"', "robot.tool: .*has no frame 'hand'"),
        ("clearance = 0.0", 'orientation = "up"', "task.orientation = 'up', expected one of 'free', 'down'"),
        ('angle_unit = "deg"', 'angle_unit = "deg"\nlaps = 2', "laps = 2, expected .*closed path"),
    ],
)
def test_mistakes_are_told_by_key(experiment, old, new, message):
    text = EXPERIMENT.replace(old, new)
    assert text != EXPERIMENT
    experiment.write_text(text)
    with pytest.raises(ExperimentError, match=message):
        load_setup(experiment)


def test_the_table_of_peaks_fits_into_80_letters_without_a_break():
    row = {"e_p_peak_deg": 1.57, "e_v_peak_deg_s": 15.79, "paper": {"e_p_peak_deg": 1.5, "e_v_peak_deg_s": 14.5}}
    console = Console(width=80)
    with console.capture() as shown:
        console.print(peaks_table({"extended_motion_plan": row, "projection": row}))
    assert "extended motion plan" in shown.get()
    assert len(shown.get().splitlines()) == 7  # title, head, two rows and three lines
    assert "deg and deg/s" in shown.get()


def test_a_table_has_no_blank_column_of_labels():
    rows = [["contour", "", "time"], ["slot", "", "1.5"]]
    assert [column.header.plain for column in _deal_columns(rows, 2, 80)[0].columns] == ["contour", "time"]
    rows[1][1] = "rapid"
    assert [column.header.plain for column in _deal_columns(rows, 2, 80)[0].columns] == ["contour", "", "time"]


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_tables_of_contours_break_no_number_at_any_width(width):
    """Whole numbers and words come out, and no line is wider than the terminal; a very long name is folded."""
    rows = [(f"line {n}", 88860.125 * 10**-n, 12345.678 / n) for n in range(1, 5)] + [("pocket_" * 40, 1.0, 2.0)]
    contours = [
        {"name": name, "rapid": False, "closed": n % 2 == 0, "length_m": length, "feed_m_s": feed, "points": 10**n}
        | {"corners": 3, "sharpest_deg": 90.0}
        for n, (name, length, feed) in enumerate(rows)
    ]
    content = {"source": "a.ngc", "contours": contours, "bounds_m": [[0, 0], [1, 1]], "unit": "mm"}
    _, *tables = toolpath_tables(content | {"cut_length_m": 1.0, "rapid_length_m": 0.0}, width)
    console = Console(width=width)
    with console.capture() as shown:
        for table in tables:
            console.print(table)
    lines, words = shown.get().splitlines(), shown.get().split()
    assert max(map(len, lines)) <= width
    assert "…" not in shown.get()
    for one in contours:
        assert {f"{1e3 * one['length_m']:.6g}", f"{1e3 * one['feed_m_s']:.4g}", str(one["points"])} <= set(words)
