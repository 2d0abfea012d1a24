"""What an error is about stands beside its message, for programs that react to it."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import pathcontrol as pc
from pathcontrol import errors

ARM = """<robot name="a"><link name="base"/><link name="tip"/>
<joint name="j" type="revolute"><parent link="base"/><child link="nowhere"/><axis xyz="0 0 1"/></joint></robot>"""


class Backwards(pc.PathTask):
    s_end = 1.0

    def q_d(self, s):
        return np.stack([s, s], axis=-1)

    def theta(self, s):
        return 0.5 - s


def raised(kind, call):
    with pytest.raises(kind) as caught:
        call()
    return caught.value


def test_arguments_are_named_with_their_values(arm, circle):
    error = raised(pc.InputError, lambda: pc.Circle(-1.0, 2.0))
    assert (error.argument, error.value) == ("radius", -1.0)
    error = raised(pc.InputError, lambda: pc.SampledLoop(period=np.nan))
    assert error.argument == "period"
    assert np.isnan(error.value)
    error = raised(pc.InputError, lambda: pc.Projection("ur5", circle, 800.0, 45.0))
    assert error.value == "ur5"
    error = raised(pc.UnknownNameError, lambda: arm.frame_pose(np.zeros(2), "gripper"))
    assert error.value == "gripper"
    assert set(error.choices) == set(arm.frame_names)


def test_places_on_a_path_are_told(circle):
    error = raised(pc.TaskError, lambda: pc.check_task(Backwards(), 2))
    assert 0.5 <= error.s <= 1.0
    assert error.value == pytest.approx(0.5 - error.s)
    error = raised(pc.InputError, lambda: pc.arc_length(pc.Line([0.0, 0.0], [1.0, 0.0], 1.0), 0.0, 7.0))
    assert (error.argument, error.value, error.limit[0]) == ("s_end", 7.0, 0.0)


def test_a_joint_at_its_limit_is_told():
    """A start posture may not be beyond the limits of a joint."""
    robot = pc.load_robot("panda", lock={"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0})
    q = np.clip(np.zeros(7), robot.limits.lower, robot.limits.upper)
    q[0] = robot.limits.upper[0] + 0.1
    curve = pc.ToolCurve.line([0.5, 0.0, 0.3], [0.5, 0.1, 0.3])
    error = raised(pc.InputError, lambda: pc.CartesianPath(robot, "panda_hand", curve, 0.1, start=q))
    assert (error.argument, error.joint, error.value) == ("start", robot.joint_names[0], q[0])
    assert error.limit == (robot.limits.lower[0], robot.limits.upper[0])


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


def test_all_is_none_where_an_error_is_not_about_it():
    error = errors.InputError("a sentence")
    for name in ("argument", "value", "limit", "choices", "joint", "s", "time", "file", "line"):
        assert getattr(error, name) is None


@pytest.mark.parametrize(
    "error",
    [
        errors.ToolpathError("a", line=3, file="b.ngc"),
        errors.SimulationError("a", None, time=1.5),
        errors.MissingExtraError("pymoo", "tune", "tuning"),
        errors.TaskError("a", joint="elbow", value=1.0, limit=(0.0, 0.5), s=0.25),
    ],
)
def test_details_travel_with_errors_between_processes(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_a_diverged_run_says_when(arm, circle):
    law = pc.Projection(arm, circle, 1e7, 1e7)
    error = raised(
        pc.SimulationError, lambda: pc.simulate(law, [1.0, 0.1], duration=5.0, loop=pc.SampledLoop(), progress=False)
    )
    assert 0 < error.time <= 5.0
    assert (error.run.status == "diverged").all()
