"""Messages name options as their reader gives them: on the command line, in an experiment file, in Python."""

from __future__ import annotations

import inspect
import json
import re

import click
import numpy as np
import pytest
from test_toolpath_cli import EXPERIMENT, called

import pathcontrol as pc
from pathcontrol import ExperimentError, InputError, read_toolpath
from pathcontrol.cli import main
from pathcontrol.cli.group import in_options
from pathcontrol.experiments.builders import tasks
from pathcontrol.experiments.runner import load_setup
from pathcontrol.experiments.schema.task_sections import toolpath_section
from pathcontrol.toolpaths.read import readers

TOOLPATH = main.commands["toolpath"]


@pytest.mark.parametrize(
    ("message", "spelled"),
    [
        ("read it with unknown='warn'", "read it with --lenient"),
        ("or read the file with unit='mm' or unit='in'", "or read the file with --unit mm or --unit in"),
        ("choose layers=['A', 'B C'] of them", "choose --layer A --layer 'B C' of them"),
        ("read the file with start=(x, y, z)", "read the file with --start x y z"),
        ("columns=('x', 'y', 'z') or the like", "--columns x,y,z or the like"),
        ("with arc_tolerance=1.2e-05, or", "with --arc-tolerance '0.012 mm', or"),
        ("gap=5e-06 closes", "--gap '0.005 mm' closes"),
        ("feed=50, or", "--feed '50000 mm/s', or"),
        ("with decimal=',' or", "with --decimal , or"),
        ("give it: unit= one of m, mm", "give it: --unit one of m, mm"),
        ("unit = 'ft', expected one of", "--unit ft, expected one of"),
        ("with feed=", "with --feed"),
        ("task.unit = 'ft', expected", "task.unit = 'ft', expected"),
        ("their unit is right; a layer", "their unit is right; a layer"),
        ("N10X1Z=5", "N10X1Z=5"),
    ],
)
def test_options_are_spelled_as_the_commands_own(message, spelled):
    assert in_options(message, TOOLPATH) == spelled
    assert in_options(message, None) == message


def test_a_file_takes_all_options_of_readers_and_all_arguments_of_the_task():
    options = {name for reader in readers() for name in inspect.signature(reader).parameters} - {"path", "start"}
    arguments = {*inspect.signature(pc.ToolpathTask).parameters} - {"robot", "toolpath"}
    assert {*toolpath_section().model_fields} == options | arguments | {"type", "file", "tool_start"}


def test_every_option_of_a_reader_is_an_option_of_the_command():
    with pytest.raises(InputError) as caught:
        read_toolpath("x.ngc", nothing=1)
    takes = re.findall(r"(\w+)=", str(caught.value).partition("which takes")[2].partition(", not")[0])
    for suffix in ("csv", "svg", "dxf"):
        with pytest.raises(InputError) as caught:
            read_toolpath(f"x.{suffix}", nothing=1)
        takes += re.findall(r"(\w+)=", str(caught.value).partition("which takes")[2].partition(", not")[0])
    options = {option.name for option in TOOLPATH.params if isinstance(option, click.Option)}
    assert {*takes} - options == set()
    assert {"unit", "layers", "skip", "gap", "columns", "decimal", "z", "arc_tolerance", "unknown", "start"} <= {*takes}


@pytest.mark.parametrize(
    ("name", "text", "message", "options"),
    [
        ("a.ngc", "G21 G90\nG0 X0 Y0 Z0\nM321\nG1 X1 F60", "pass it over with --lenient", ["--lenient"]),
        ("b.ngc", "G21 G90\nG0 X0 Y0 Z0\nG1 X5", "read the file with --feed", ["--feed", "0.01"]),
        ("c.ngc", "G0 X0 Y0 Z0\nG1 X5 F60", "read the file with --unit mm or --unit in", ["--unit", "mm"]),
        ("d.ngc", "G21 F60\nG1 X5 Y0 Z0", "read the file with --start x y z", ["--start", "0", "0", "0"]),
        (
            "e.ngc",
            "G21 G90\nG0 X-2.83 Y135 Z0\nG1 Z-4.5 F100\nG2X1.41Y137.45I2.82J0.0",
            "by up to 0.012 mm, read it with --arc-tolerance '0.012 mm'",
            ["--arc-tolerance", "0.012 mm"],
        ),
        ("f.csv", "0,0,0,180,0,0\n1,0,0,180,0,0", "with --columns x,y,z,i,j,k or", ["--columns", "x,y,z,_,_,_"]),
        ("g.csv", "0,0\n1,0", "x y alone need --z, their height", ["--z", "0.1"]),
        ("h.csv", "1,500;0;0\n2,500;0;0", "with --decimal , or", ["--decimal", ","]),
    ],
)
def test_what_a_message_says_helps(tmp_path, name, text, message, options):
    (tmp_path / name).write_text(text)
    code, _, err = called("toolpath", tmp_path / name, "--json")
    assert code == 2
    assert message in err
    code, out, err = called("toolpath", tmp_path / name, "--json", *options)
    assert code == 0
    assert json.loads(out)["cut_length_m"] > 0


def test_warnings_spell_options_too(tmp_path):
    (tmp_path / "a.csv").write_text("# in mm\n0 0 0\n1 0 0")
    code, _, err = called("toolpath", tmp_path / "a.csv")
    assert code == 0
    assert err.startswith(
        "warning: a.csv: line 1 speaks of 'mm', but the coordinates are taken for metres: give --unit "
    )
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("program", "message", "key"),
    [
        ("G21 F60\nG1 X5 Y0 Z0\nX100", r"read the file with tool_start = \[x, y, z\]", "tool_start = [0.0, 0.0, 0.0]"),
        ("G0 X0 Y0 Z0\nG1 X100 F1200", 'read the file with unit = "mm" or unit = "in"', 'unit = "mm"'),
        ("G21 G0 X0 Y0 Z0\nG1 X100", "read the file with feed", "feed = 0.02"),
        ("G21 G0 X0 Y0 Z0\nM321\nG1 X100 F1200", 'pass it over with unknown = "warn"', 'unknown = "warn"'),
    ],
)
def test_experiment_files_have_keys(tmp_path, program, message, key):
    (tmp_path / "part.ngc").write_text(program)
    (tmp_path / "part.toml").write_text(EXPERIMENT)
    with pytest.raises(ExperimentError, match=f"task.file: .*{message}"):
        load_setup(tmp_path / "part.toml")
    (tmp_path / "part.toml").write_text(EXPERIMENT.replace("clearance = 0.0", f"clearance = 0.0\n{key}"))
    load_setup(tmp_path / "part.toml")


@pytest.mark.parametrize("columns", ['"x,y,z,_"', '["x", "y", "z", "_"]', "{ x = 0, y = 1, z = 2 }"])
def test_columns_in_an_experiment_file(tmp_path, columns):
    (tmp_path / "part.csv").write_text("0;0;0;9\n0,1;0;0;9\n")
    text = EXPERIMENT.replace("part.ngc", "part.csv").replace("clearance = 0.0", f"feed = 0.02\ncolumns = {columns}")
    (tmp_path / "part.toml").write_text(text.replace("feed =", 'decimal = ","\nfeed ='))
    assert len(load_setup(tmp_path / "part.toml").task) == 1


def test_a_toolpath_of_a_file_may_have_an_orientation_as_a_table(tmp_path, monkeypatch):
    (tmp_path / "part.ngc").write_text("G21 G90\nG0 X0 Y0 Z0\nG1 X5 F60")
    file, up = tmp_path / "e.toml", [0.0, 0.6, -0.8]
    file.write_text(EXPERIMENT.replace("clearance = 0.0", f'orientation = {{ type = "tangent", up = {up} }}'))
    made = []
    monkeypatch.setattr(tasks, "ToolpathTask", lambda *_, orientation, **__: made.append(orientation))
    with pytest.raises(ExperimentError, match="task = None"):
        load_setup(file)
    assert isinstance(made[0], pc.TangentOrientation)
    np.testing.assert_array_equal(made[0].up, pc.TangentOrientation(up).up)
