"""A file that a command cannot use is refused at once, by what it is and with the command that can."""

from __future__ import annotations

import subprocess
import sys

import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.cli.files import recognise_file

URDF = "<robot name='r'><link name='a'/></robot>"
FILES = {
    "e.toml": ("an experiment", "duration = 1\n", "pathcontrol run "),
    "r.urdf": ("a robot", URDF, "pathcontrol view "),
    "t.ngc": ("a toolpath", "G21 G90\nG0 X0 Y0 Z0\nG1 X1 F60\n", "pathcontrol toolpath "),
    "g.nc": ("a toolpath", "G21 G90\nG0 X0 Y0 Z0\nG1 X1 F60\n", "pathcontrol toolpath "),
    "d.svg": ("a toolpath", "<svg/>", "pathcontrol toolpath "),
    "p.html": ("a page", "<html>", "browser"),
    "s.py": ("a Python program", "print(1)", "python "),
    "run.nc": ("a saved run", "", "pathcontrol report "),
}
TAKES = {
    "run": {"an experiment"},
    "sweep": {"an experiment"},
    "tune": {"an experiment"},
    "view": {"a saved run", "a robot"},
    "report": {"a saved run"},
    "check": {"a robot"},
    "toolpath": {"a toolpath"},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    for name, (_, text, _) in FILES.items():
        (folder / name).write_text(text)
    law = pc.Projection(pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0])
    pc.simulate(law, [0.9, 0.1], duration=0.05, progress=False).save(folder / "run.nc")
    return folder


def called(*arguments):
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    return result.exit_code, result.stderr


@pytest.mark.parametrize("name", FILES)
def test_the_kind_of_a_file_is_known(folder, name):
    assert recognise_file(folder / name) == FILES[name][0]


@pytest.mark.parametrize("command", TAKES)
@pytest.mark.parametrize("name", FILES)
def test_a_file_of_another_kind_is_refused_with_the_command_for_it(folder, command, name):
    kind, _, advice = FILES[name]
    if kind in TAKES[command]:
        return
    code, err = called(command, folder / name)
    assert (code, err.count("\n")) == (2, 1)
    assert kind in err
    assert ("pathcontrol view" if kind == "a robot" else advice) in err


@pytest.mark.parametrize("command", TAKES)
def test_a_missing_file_and_a_folder_are_told_as_such(tmp_path, command):
    code, err = called(command, tmp_path / "none.x")
    assert (code, err.count("\n")) == (2, 1)
    assert f"there is no file '{tmp_path / 'none.x'}', expected " in err
    code, err = called(command, tmp_path)
    assert (code, err.count("\n")) == (2, 1)
    assert "folder" in err


@pytest.mark.parametrize("content", [b"", b"CDF\x01\0\0", b"\x89HDg\r\n\x1a\n\0\0"])
def test_a_damaged_run_is_not_taken_for_a_toolpath(tmp_path, content):
    (tmp_path / "run.nc").write_bytes(content)
    assert recognise_file(tmp_path / "run.nc") == ""
    code, err = called("view", tmp_path / "run.nc")
    assert code == 2
    assert "is not a run saved by Run.save" in err


@pytest.mark.parametrize("command", ["run", "sweep", "tune", "view", "report", "toolpath"])
def test_a_missing_file_is_told_before_anything_large_is_loaded(tmp_path, command):
    program = "import sys\nfrom pathcontrol.cli import main\ntry:\n    main()\nfinally:\n    print(*sys.modules)\n"
    done = subprocess.run(
        [sys.executable, "-c", program, command, "none.nc"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "there is no file" in done.stderr
    assert not {"pinocchio", "matplotlib", "pydantic", "scipy"} & set(done.stdout.split())


def test_a_robot_is_shown_by_its_name_or_its_file(tmp_path):
    code, err = called("view", "no_such_robot")
    assert code == 2
    assert "the name of a known robot" in err
    code, err = called("report", "cicese_2dof")
    assert code == 2
    assert "'cicese_2dof' is a robot and no run; look at it with `pathcontrol view`" in err
    code, err = called("view", tmp_path / "none.urdf")
    assert code == 2
    assert "there is no file" in err


@pytest.mark.parametrize("name", ["jammed-joint", "jamed-joint", "JAMMED-JOINT"])
def test_the_name_of_a_scenario_is_no_file(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, said = called("compare", name)
    assert code == 2
    assert "`pathcontrol compare --scenario jammed-joint`" in said


def test_a_wrong_suffix_is_answered_in_the_words_of_who_gave_it(folder, tmp_path):
    """A command names a command, Python a call; what was called is not advised again."""
    for name, advice in (("x.mp4", "view RUN --mp4"), ("x.csv", "signals as CSV"), ("x.png", "a page with figures")):
        code, said = called("view", folder / "run.nc", "--out", tmp_path / name)
        assert code == 2
        assert advice in said
        assert "(run" not in said
    code, said = called("view", folder / "run.nc", "--mp4", tmp_path / "x.html")
    assert "view RUN --out FILE.html" in said
    figure = pc.error_figure(pc.Run.load(folder / "run.nc"))
    with pytest.raises(pc.InputError, match=r"without \.jpg, or with \.svg, \.png or \.pdf$"):
        pc.save_figure(figure, tmp_path / "a.jpg")
    with pytest.raises(pc.InputError, match="save_video"):
        pc.save_figure(figure, tmp_path / "a.mp4")


def test_the_folder_of_a_run_is_no_file(folder, tmp_path):
    with pytest.raises(pc.InputError, match=r"is a folder, expected the file of a run; in it is 'run\.nc'"):
        pc.Run.load(folder)
    with pytest.raises(pc.InputError, match=r"is a folder, expected the file of a run$"):
        pc.Run.load(tmp_path)


def test_names_of_frames_and_joints_have_a_near_one():
    arm = pc.load_robot("cicese_2dof")
    for call in (
        lambda: arm.frame_pose([0.0, 0.0], "tol"),
        lambda: arm.limit("joint2"),
        lambda: pc.load_robot("cicese_2dof", lock={"joint2": 0.0}),
    ):
        with pytest.raises(pc.UnknownNameError, match=r"; did you mean '(tool|joint_2)'"):
            call()
