"""Warnings are of the library's own class, and point at the line of the user's code that they are about."""

from __future__ import annotations

import ast
import warnings
from pathlib import Path

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import PathControlWarning

LIBRARY = Path(pc.__file__).parent
TWO = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)


def test_every_warning_is_given_by_one_function():
    for file in LIBRARY.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if "warn(" not in text:
            continue
        for call in ast.walk(ast.parse(text)):
            if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name | ast.Attribute):
                continue
            name = ast.unparse(call.func)
            assert name != "warnings.warn" or file.name == "errors.py", f"{file}: line {call.lineno}"
            if name == "warn" and len(call.args) > 1:
                assert ast.unparse(call.args[1]) == "StepWarning", f"{file}: line {call.lineno}"


def start_in_degrees(folder):
    pc.simulate(pc.Projection(TWO, CIRCLE, 800.0, [45.0, 100.0]), [40.0, 70.0], duration=0.1, progress=False)


def step_that_is_too_long(folder):
    class Damper(pc.Disturbance):
        def torque(self, t, q, qd):
            return -500.0 * qd

    law = pc.Projection(TWO, CIRCLE, 800.0, [45.0, 100.0])
    loop = pc.SampledLoop(torque_limits=True)
    pc.simulate(law, [0.7, 1.2], duration=0.0025, loop=loop, disturbance=Damper(), progress=False)


def joint_locked_beyond_its_limits(folder):
    text = TWO.source.text.replace('type="continuous"', 'type="revolute"')
    pc.load_robot(text.replace('effort="150', 'upper="1" effort="150'), lock={"joint_1": 2.0})


def toolpath_with_a_note(folder):
    (folder / "a.ngc").write_text("G21 G90\nG0 X0 Y0 Z0\nM1234\nG1 X5 F300\n")
    pc.read_toolpath(folder / "a.ngc", unknown="warn")


def task_in_millimetres(folder):
    with pytest.raises(pc.TaskError):
        pc.CartesianPath(TWO, "tool", pc.ToolCurve.line([400, 0, 300], [450, 0, 300]))


def law_made_with_single(folder):
    class Law(pc.MotionController, single=True):
        def torque(self, q, qd, ref):
            return q


@pytest.mark.parametrize(
    "slip",
    [
        start_in_degrees,
        step_that_is_too_long,
        joint_locked_beyond_its_limits,
        toolpath_with_a_note,
        task_in_millimetres,
        law_made_with_single,
    ],
)
def test_a_warning_points_at_the_users_own_line(slip, tmp_path):
    with pytest.warns(PathControlWarning) as told:
        slip(tmp_path)
    first, lines = slip.__code__.co_firstlineno, 9
    for warning in told:
        if issubclass(warning.category, PathControlWarning):
            assert warning.filename == __file__, warning.message
            assert first < warning.lineno <= first + lines, warning.message


def test_a_warning_is_shown_once_for_a_line_that_is_run_often():
    law = pc.Projection(TWO, CIRCLE, 800.0, [45.0, 100.0])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")
        for _ in range(3):
            pc.simulate(law, np.array([40.0, 70.0]), duration=0.01, progress=False)
    assert len([w for w in told if issubclass(w.category, PathControlWarning)]) == 1
