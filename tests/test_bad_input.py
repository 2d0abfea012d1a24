"""Mistakes a user makes, each answered by one line that names the value and says what to do."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from pathcontrol import (
    Circle,
    ComputedTorque,
    Coulomb,
    ExtendedMotionPlan,
    InputError,
    MissingExtraError,
    PathControlError,
    PDPlus,
    Projection,
    SlotineLi,
    Stribeck,
    TaskError,
    UnknownNameError,
    UrdfError,
    Viscous,
    load_robot,
)

TASK = Circle(1.0, 2.0)


class Slow(Circle):
    """ϑ falls to zero half-way round."""

    def theta(self, s):
        return 1 + np.cos(s)


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda arm: ExtendedMotionPlan(arm, TASK, -1.0, 1.0, 1.0), InputError, ["K_p = -1", "greater than 0"]),
        (lambda arm: ExtendedMotionPlan(arm, TASK, 1.0, [1.0, 0.0], 1.0), InputError, ["K_v = [1.0, 0.0]"]),
        (lambda arm: ExtendedMotionPlan(arm, TASK, 1.0, 1.0, -2.0), InputError, ["k = -2.0", "k ≥ 0"]),
        (lambda arm: ExtendedMotionPlan(arm, TASK, 1.0, 1.0, np.nan), InputError, ["k", "nan", "finite"]),
        (lambda arm: ExtendedMotionPlan(arm, TASK, [1.0, 2.0, 3.0], 1.0, 1.0), InputError, ["K_p", "(3,)", "(2,)"]),
        (lambda arm: Projection(arm, TASK, [800.0, 900.0], 1.0), InputError, ["k_p = [800.0, 900.0]", "scalar"]),
        (lambda arm: Projection(arm, TASK, 0.0, 1.0), InputError, ["k_p = 0.0", "greater than 0"]),
        (lambda arm: ComputedTorque(arm, TASK, "stiff", 1.0), InputError, ["K_p = 'stiff'", "numbers"]),
        (lambda arm: PDPlus(arm, TASK, 1.0, np.inf), InputError, ["K_v", "inf"]),
        (lambda arm: SlotineLi(arm, TASK, -1.0, 1.0), InputError, ["Lambda = -1"]),
        (lambda arm: Projection(arm, TASK, 1.0, 1.0, friction="dry"), UnknownNameError, ["'dry'", "'viscous'"]),
        (lambda arm: Projection(arm, TASK, 1.0, 1.0, start="here"), UnknownNameError, ["'here'", "'nearest'"]),
        (lambda arm: Projection(arm, Slow(1.0, 2.0), 1.0, 1.0), TaskError, ["Slow.theta(s=3.14159) = 0", "ϑ > 0"]),
        (lambda arm: Projection(arm, None, 1.0, 1.0), TaskError, ["None", "PathTask"]),
        (lambda arm: arm.with_friction(Viscous([1.0])), InputError, ["1 joints", "has 2"]),
        (lambda arm: arm.with_friction(Viscous([1.0, -1.0])), InputError, ["-1.0", "no negative"]),
        (lambda arm: Coulomb([1.0, 1.0], [1.0]), InputError, ["2 joints forward and 1 backward"]),
        (lambda arm: Stribeck([1.0], [0.5], [0.1]), InputError, ["static", "≥ Coulomb"]),
        (lambda arm: Stribeck([1.0, 1.0], [2.0], [0.1]), InputError, ["different numbers of joints"]),
        (lambda arm: arm.with_payload(-1.0, "tool"), InputError, ["mass = -1"]),
        (lambda arm: arm.with_payload(1.0, "hand"), UnknownNameError, ["'hand'", "tool"]),
        (lambda arm: load_robot("cicese_2dof", lock=["joint_2"]), InputError, ["lock = ['joint_2']", "0.0"]),
        (lambda arm: load_robot("no_such_arm"), UnknownNameError, ["'no_such_arm'", "cicese_2dof"]),
        (lambda arm: load_robot("lost/arm.urdf"), UrdfError, ["lost/arm.urdf", "No such file"]),
        (lambda arm: load_robot("x" * 5000 + ".urdf"), UrdfError, ["too long"]),
    ],
)
def test_one_line_that_says_what_to_do(arm, make, kind, words):
    with pytest.raises(kind) as error:
        make(arm)
    message = str(error.value)
    assert isinstance(error.value, PathControlError)
    assert "\n" not in message
    assert all(word in message for word in words), message


def test_a_task_for_two_joints_on_a_six_joint_arm():
    pytest.importorskip("example_robot_data")
    with pytest.raises(TaskError, match="the path is for 2 joints, the arm has 6"):
        Projection(load_robot("ur5"), TASK, 1.0, 1.0)


def test_a_missing_extra_is_named(monkeypatch):
    for module in [name for name in sys.modules if name.startswith("example_robot_data.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "example_robot_data", None)
    with pytest.raises(UnknownNameError, match=r"pip install 'pathcontrol\[robots\]'") as error:
        load_robot("ur5")
    assert isinstance(error.value.__cause__, MissingExtraError)
    assert load_robot("cicese_2dof").n == 2


def test_every_error_is_also_the_builtin_one_expects():
    assert issubclass(InputError, ValueError)
    assert issubclass(UnknownNameError, LookupError)
    assert issubclass(MissingExtraError, ImportError)
