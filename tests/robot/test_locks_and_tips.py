"""What is locked, kept and given mass, as people slip: each is told by its name."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import InputError, PathControlWarning, UnknownNameError, UrdfError
from pathcontrol.robot.recipe import recipe_of, robot_of
from pathcontrol.robot.urdf import check_urdf

MASS = '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'


def joint(name: str, parent: str, child: str, inside: str = "", limits: tuple[float, float] = (-1, 1)) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 .3"/>'
        f'<axis xyz="0 1 0"/><limit lower="{limits[0]}" upper="{limits[1]}" effort="9" velocity="3"/>{inside}</joint>'
    )


def gripper(mimic: str = '<mimic joint="g" multiplier="-2" offset="0.1"/>', inside: str = MASS) -> str:
    """Two joints and a gripper of two fingers, of which the second follows the first."""
    links = "".join(f'<link name="{name}">{inside}</link>' for name in ("b", "a1", "a2", "f1", "f2"))
    fingers = joint("g", "a2", "f1", limits=(0, 0.5)) + joint("m", "a2", "f2", mimic)
    return f'<robot name="r">{links}{joint("j1", "b", "a1")}{joint("j2", "a1", "a2")}{fingers}</robot>'


@pytest.fixture(scope="module")
def arm():
    return pc.load_robot(gripper(), lock={"g": 0.2})


def test_a_finger_that_follows_is_locked_at_multiplier_and_offset(arm):
    turn = arm.frame_pose([0.0, 0.0], "f2")[:3, :3]
    angle = -2 * 0.2 + 0.1
    np.testing.assert_allclose(turn[0], [np.cos(angle), 0.0, np.sin(angle)], atol=1e-12)


@pytest.mark.parametrize(("lock", "told"), [({"g": 2.0}, "g = 2 rad"), ({"g": 0.5, "m": 1.5}, "m = 1.5 rad")])
def test_a_lock_outside_the_limits_is_told(lock, told):
    with pytest.warns(PathControlWarning, match=f"{told} is outside its limits"):
        pc.load_robot(gripper(), lock=lock)


def test_a_finger_that_follows_beyond_its_limits_is_told():
    said = r"g = 0\.4 rad puts m, which follows it, at -1\.9 rad, outside its limits of .* rad$"
    with pytest.warns(PathControlWarning, match=said) as told:
        pc.load_robot(gripper('<mimic joint="g" multiplier="-5" offset="0.1"/>'), lock={"g": 0.4})
    assert len(told) == 1


def test_degrees_are_asked_of_the_leader_alone():
    with pytest.warns(PathControlWarning) as told:
        pc.load_robot(gripper(), lock={"g": 20.0})
    leader, follower = (str(one.message) for one in told)
    assert leader.endswith("lock: g = 20 rad is outside its limits of 0 to 0.5 rad; did you mean degrees?")
    assert "g = 20 rad puts m, which follows it, at -39.9 rad" in follower
    assert "degrees" not in follower


def test_an_arm_reduced_outside_its_limits_is_told_once(arm):
    with pytest.warns(PathControlWarning, match="did you mean degrees") as told:
        reduced = arm.reduced({"j1": 45.0})
    assert len(told) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a recorded one was told of when it was made
        again = robot_of(recipe_of(reduced))
    assert again.steps == reduced.steps
    np.testing.assert_array_equal(again.mass_matrix([0.3]), reduced.mass_matrix([0.3]))


@pytest.mark.parametrize(
    ("choice", "error", "words"),
    [
        ({"keep": 3}, InputError, "keep = 3"),
        ({"keep": [3]}, InputError, r"keep = \[3\]"),
        ({"keep": [["j1"]]}, InputError, "expected names of joints"),
        ({"keep": ["j1", "j9"]}, UnknownNameError, "'j9'"),
        ({"tip": ["a1", "a2"]}, InputError, "one frame"),
        ({"tip": 5}, InputError, "tip = 5"),
        ({"tip": "hand"}, UnknownNameError, "'hand'"),
        ({"tip": "b"}, (InputError, UrdfError), "no joint|0 of 4 joints can move"),
    ],
)
def test_what_cannot_be_kept_is_told(arm, choice, error, words):
    for call in (lambda: pc.load_robot(gripper(), **choice), lambda: arm.reduced(**choice)):
        with pytest.raises(error, match=words):
            call()


def test_none_is_kept_as_nothing_is_said(arm):
    assert arm.reduced({"j1": 0.1}, keep=None).joint_names == ("j2",)
    assert pc.load_robot(gripper(), lock={"g": 0.0}, keep=None).joint_names == ("j1", "j2")
    assert pc.load_robot(gripper(), keep="j1").joint_names == arm.reduced(keep="j1").joint_names == ("j1",)
    assert pc.load_robot(gripper(), tip="a2").joint_names == arm.reduced(tip="a2").joint_names == ("j1", "j2")


@pytest.mark.parametrize("leader", ["m", "nobody"])
def test_a_joint_that_follows_none_is_not_told_to_lock_its_leader(leader):
    (message,) = (
        f.message for f in check_urdf(gripper(f'<mimic joint="{leader}"/>')).errors if f.code == "joint-mimic"
    )
    assert "no other joint has that name" in message


def test_joints_that_would_move_no_mass_are_named():
    bare = pc.load_robot(gripper('<mimic joint="g"/>', inside=""), lock={"g": 0.0})
    with pytest.raises(UrdfError, match=r"j2 would move no mass.*with_masses\(kg=\{'j2'"):
        bare.with_masses(kg={"j1": 2.0}).forward_dynamics([0.0, 0.0], [0.0, 0.0], [1.0, 1.0])
    for whole in (
        bare.with_masses(kg={"j2": 1.0}),  # which joint 1 moves too
        bare.with_masses(kg={"j1": 1.0}).with_masses(kg={"j2": 1.0}),
        bare.with_masses(kg={"j1": 1.0}).with_armature([0.0, 0.1]),
    ):
        assert (np.linalg.eigvalsh(whole.mass_matrix([0.3, 0.4])) > 0).all()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "a", None, [0.1]])
def test_a_recorded_lock_is_a_number(arm, value):
    recipe = recipe_of(arm)
    recipe["steps"][0][1]["lock"] = recipe["steps"][0][1]["lock"] | {"g": value}
    with pytest.raises(InputError, match="angle of g"):
        robot_of(recipe)


def test_a_folder_is_no_robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("arm", "arm.urdf"):
        (tmp_path / name).mkdir()
        with pytest.raises(UrdfError, match=r"folder|regular file"):
            pc.load_robot(name)
