"""Errors of files name the file, the line and the key, beside their message."""

from __future__ import annotations

import pickle

import pytest
from numpy.testing import assert_array_equal

import pathcontrol as pc

ARM = """<robot name="a"><link name="base"/><link name="tip"/>
<joint name="j" type="revolute"><parent link="base"/><child link="nowhere"/><axis xyz="0 0 1"/></joint></robot>"""


def raised(kind, call):
    with pytest.raises(kind) as caught:
        call()
    return caught.value


@pytest.mark.parametrize(
    ("end", "text", "line"), [("ngc", "G21 G90\nG1 X1 F100\nG1 X[2]\n", 3), ("csv", "0,0,0\n1,0,0\n1,x,0\n", 3)]
)
def test_files_and_lines_are_told(tmp_path, end, text, line):
    file = tmp_path / f"part.{end}"
    file.write_text(text)
    options = {"start": (0, 0, 0)} if end == "ngc" else {"unit": "mm"}
    error = raised(pc.ToolpathError, lambda: pc.read_toolpath(file, **options))
    assert (error.file, error.line) == (str(file), line)
    assert f"line {line}" in str(error)


@pytest.mark.parametrize(
    ("text", "line", "value"),
    [("G21 G90\nG1 X1 F-5\n", 2, -5.0), ("G21 G90\nG0 X1\nG2 I1 F60 P0\n", 3, 0.0), ("G21 G90 G7\n", 1, 7.0)],
)
def test_words_that_are_refused_are_told_with_their_line(tmp_path, text, line, value):
    file = tmp_path / "part.ngc"
    file.write_text(text)
    error = raised(pc.ToolpathError, lambda: pc.read_toolpath(file, start=(0, 0, 0)))
    assert (error.file, error.line, error.value) == (str(file), line, value)
    assert f"{value:g}" in str(error)


def test_robots_are_told_with_the_line(tmp_path):
    (tmp_path / "arm.urdf").write_text('<robot name="a">\n<link name="base">\n<oops\n')
    error = raised(pc.UrdfError, lambda: pc.load_robot(tmp_path / "arm.urdf"))
    assert f"line {error.line}" in str(error)


def test_findings_are_told(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    error = raised(pc.UrdfError, lambda: pc.load_robot(tmp_path / "arm.urdf"))
    assert [finding.level for finding in error.findings] == ["error"] * len(error.findings) != []
    file = tmp_path / "e.toml"
    file.write_text("[robot]\nname = 3\n")
    error = raised(pc.ExperimentError, lambda: pc.run_experiment(file, tmp_path / "out"))
    assert error.file == str(file)
    assert any(finding.startswith("robot") for finding in error.findings)
    file.write_text("a = 1\nb =\n")
    assert raised(pc.ExperimentError, lambda: pc.run_experiment(file, tmp_path / "out")).line == 2


FILE = """duration = 1.0
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 1.0
[controller]
type = "pd_plus"
K_p = 100.0
K_v = 10.0
"""


@pytest.mark.parametrize(
    ("old", "new", "key", "value"),
    [
        ("radius = 1.0", "radius = true", "task.radius", True),  # of the file alone
        ("radius = 1.0", "radius = -1.0", "task.radius", -1.0),
        ("K_p = 100.0", "K_p = [100.0, -1.0]", "controller.K_p", [100.0, -1.0]),  # of what the law takes
        ("duration = 1.0", "duration = 1.0\nlaps = 0", "laps", 0),  # of both together
        ("duration = 1.0", "duration = 1.0\n[loop]\nperiod = 0.01\ndelay = 3.0", "loop.delay", 3.0),
        ("[task]", "[robot.friction]\nviscous = [1.0]\n[task]", "robot.friction.viscous", [1.0]),  # of the arm
        ("duration = 1.0", "duration = 1.0\n[loop]\nencoders = [1.0]", "loop.encoders", [1.0]),
        ("duration = 1.0", "duration = 1.0\n[output]\nfigure_joints = [0, 4]", "output.figure_joints", [0, 4]),
    ],
)
def test_an_experiment_file_names_the_key_and_its_value(tmp_path, old, new, key, value):
    file = tmp_path / "e.toml"
    file.write_text(FILE.replace(old, new))
    error = raised(pc.ExperimentError, lambda: pc.run_experiment(file, tmp_path / "out"))
    assert (error.file, error.argument, error.line) == (str(file), key, None)
    assert_array_equal(error.value, value)
    assert pickle.loads(pickle.dumps(error)).argument == key


def test_a_drawing_that_cannot_be_read_names_its_own_line(tmp_path):
    drawing, file = tmp_path / "part.csv", tmp_path / "e.toml"
    drawing.write_text("0,0,0\n1,0,0\n1,x,0\n")
    start = FILE.index("[task]"), FILE.index("[controller]")
    task = '[task]\ntype = "toolpath"\nfile = "part.csv"\nframe = "tool"\nunit = "mm"\n'
    file.write_text(FILE[: start[0]] + task + FILE[start[1] :])
    error = raised(pc.ExperimentError, lambda: pc.run_experiment(file, tmp_path / "out"))
    assert (error.file, error.line) == (str(drawing), 3)
    assert error.findings[0].startswith("task.file: ")


def test_a_toolpath_without_feed_names_the_key_that_gives_one(tmp_path):
    (tmp_path / "part.csv").write_text("0,0,0\n1,0,0\n")
    file = tmp_path / "e.toml"
    start = FILE.index("[task]"), FILE.index("[controller]")
    task = '[task]\ntype = "toolpath"\nfile = "part.csv"\nframe = "tool"\nunit = "mm"\n'
    file.write_text(FILE[: start[0]] + task + FILE[start[1] :])
    assert raised(pc.ExperimentError, lambda: pc.run_experiment(file, tmp_path / "out")).argument == "task.feed"
