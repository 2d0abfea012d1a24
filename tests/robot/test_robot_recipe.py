"""What a model is made of, in JSON: the robot that is made of that again has the same kinematics and dynamics."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats

from pathcontrol import Coulomb, FrictionLaw, InputError, Stribeck, UrdfError, Viscous, load_robot
from pathcontrol.robot.actuation import Actuation, Limits
from pathcontrol.robot.arm_dynamics import UrdfSource
from pathcontrol.robot.friction import no_friction, rebuild_law
from pathcontrol.robot.recipe import recipe_of, robot_of

FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.02}
few = settings(max_examples=12)


@cache
def load(name):
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    return load_robot(name, lock=FINGERS if name == "panda" else None)


def again(robot):
    """The robot of its recipe, through the text of a file."""
    return robot_of(json.loads(json.dumps(recipe_of(robot), allow_nan=False)))


def assert_same(robot, other, rng):
    q, qd, qdd = rng.normal(size=(3, 4, robot.n))
    assert other.joint_names == robot.joint_names
    assert other.frame_names == robot.frame_names
    assert other.position_units == robot.position_units
    assert np.array_equal(other.inverse_dynamics(q, qd, qdd), robot.inverse_dynamics(q, qd, qdd))
    assert np.array_equal(other.frame_poses(q, other.frame_names), robot.frame_poses(q, robot.frame_names))
    assert np.array_equal(
        other.frame_jacobian(q, other.frame_names[-1]), robot.frame_jacobian(q, robot.frame_names[-1])
    )
    assert np.array_equal(other.friction.torque(qd), robot.friction.torque(qd))
    for name in ("lower", "upper", "velocity", "effort"):
        assert np.array_equal(getattr(other.limits, name), getattr(robot.limits, name))
    counts = robot.actuation.encoder_counts
    assert (other.actuation.encoder_counts is None) == (counts is None)
    assert counts is None or np.array_equal(other.actuation.encoder_counts, counts)


@st.composite
def changes(draw):
    """A few of the things that can be done to a robot, each a function of it."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.normal(size=(3, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn * np.sign(np.linalg.det(turn)), rng.normal(size=3)
    mass, angle, name = rng.uniform(0, 5), rng.uniform(-1, 1), f"tip {rng.integers(10**9)}"
    laws = [
        lambda n: Viscous(rng.uniform(0, 2, n)) + Coulomb(rng.uniform(0, 2, n), rng.uniform(0, 2, n)),
        lambda n: Stribeck(np.full(n, 0.1), np.full(n, 0.1) + rng.uniform(0, 1, n), rng.uniform(0.1, 1, n)),
        no_friction,
    ]
    steps = [
        lambda robot: robot.with_payload(mass, robot.frame_names[-1], com=rng.normal(size=3), inertia=root @ root.T),
        lambda robot: robot.with_frame(name, parent=robot.frame_names[-1], pose=pose),
        lambda robot: robot.with_frame(name[::-1], parent=robot.frame_names[-1], pose=pose[:3, 3]),
        lambda robot: robot.with_armature(rng.uniform(0, 1, robot.n)),
        lambda robot: robot.with_friction(laws[mass > 2.5](robot.n)),
        lambda robot: robot.with_friction(laws[2](robot.n)),
        lambda robot: robot.reduced({robot.joint_names[-1]: angle}) if robot.n > 1 else robot,
    ]
    return [steps[i] for i in draw(st.lists(st.integers(0, len(steps) - 1), max_size=5, unique=True))]


@pytest.mark.parametrize("name", ["cicese_2dof", "ur5", "panda"])
@given(changes(), st.integers(0, 2**32 - 1))
@few
def test_a_robot_is_the_same_again_whatever_was_done_to_it(name, steps, seed):
    robot = load(name)
    for step in steps:
        robot = step(robot)
    rebuilt = again(robot)
    assert_same(robot, rebuilt, np.random.default_rng(seed))
    assert recipe_of(rebuilt) == recipe_of(robot)


def test_a_copy_of_the_robot_knows_as_well(arm):
    robot = arm.with_payload(1.0, "tool").with_frame("tip", "tool", [0, 0, 0.1]).with_threads(2)
    assert recipe_of(pickle.loads(pickle.dumps(robot))) == recipe_of(robot)


@given(st.lists(floats(0.1, 9.0), min_size=8, max_size=8))
@few
def test_limits_and_encoders_that_were_changed_are_kept(values):
    arm = load("cicese_2dof")
    limits = Limits(np.array([-np.inf, -values[0]]), np.array([np.inf, values[1]]), *np.reshape(values[2:6], (2, 2)))
    for counts in (None, np.array(values[6:])):
        robot = replace(arm, actuation=Actuation(limits, arm.friction, counts))
        assert_same(robot, again(robot), np.random.default_rng(0))


# --- where its meshes are -----------------------------------------------------------------------------------


def test_a_known_robot_is_found_by_its_name_on_another_machine():
    robot = load("ur5")
    recipe = recipe_of(robot) | {"base_dir": "/nowhere/at/all", "package_dirs": ["/nowhere"]}
    rebuilt = robot_of(recipe)
    assert rebuilt.source.base_dir == robot.source.base_dir
    assert set(robot.source.package_dirs) <= set(rebuilt.source.package_dirs)
    assert Path("/nowhere") in rebuilt.source.package_dirs


def test_the_text_is_the_recorded_one_though_the_name_has_another_now(arm):
    text = arm.source.text.replace('name="tool"', 'name="old_tool"').replace('link="tool"', 'link="old_tool"')
    assert "old_tool" in robot_of(recipe_of(arm) | {"urdf": text}).frame_names


def test_a_robot_of_a_file_keeps_its_folders(arm, tmp_path):
    (tmp_path / "arm.urdf").write_text(arm.source.text, encoding="utf-8")
    robot = load_robot(tmp_path / "arm.urdf", package_dirs=[tmp_path / "meshes"])
    assert again(robot).source == robot.source == UrdfSource(arm.source.text, tmp_path, (tmp_path / "meshes",))


@pytest.mark.parametrize("name", [None, "no_such_robot", "../../etc/passwd", "<robot/>"])
def test_folders_and_names_that_do_not_exist_any_more_do_no_harm(arm, name):
    mesh = '<visual><geometry><mesh filename="package://gone/arm.stl"/></geometry></visual></link>'
    text = arm.source.text.replace("</link>", mesh, 1)
    recipe = recipe_of(arm) | {"urdf": text, "name": name, "base_dir": "/nowhere", "package_dirs": ["/gone"]}
    rebuilt = robot_of(recipe)
    assert_same(arm, rebuilt, np.random.default_rng(1))
    assert rebuilt.source.base_dir == Path("/nowhere")


# --- friction -----------------------------------------------------------------------------------------------


class Own(FrictionLaw):
    n = 2

    def describe(self):
        return {"law": "Own"}


def test_a_law_of_the_user_is_left_out_with_a_warning(arm):
    recipe = recipe_of(arm.with_friction(Own()))
    with pytest.warns(UserWarning, match="without its friction: friction law 'Own', expected one of Viscous"):
        rebuilt = robot_of(recipe)
    assert not rebuilt.friction.torque(np.ones(2)).any()


@given(st.lists(floats(0.0, 9.0), min_size=8, max_size=8), floats(-3, 3))
def test_every_law_is_what_it_describes(values, speed):
    a, b, c, d = np.reshape(values, (4, 2))
    for law in (
        Viscous(a),
        Coulomb(a, b),
        Coulomb(a),
        Stribeck(a, a + b, c + 0.1),
        Viscous(a) + Coulomb(b, c) + Viscous(d),
    ):
        same = rebuild_law(json.loads(json.dumps(law.describe())))
        assert np.array_equal(same.torque(np.array([speed, 0.5])), law.torque(np.array([speed, 0.5])))
        assert same.describe() == law.describe()


# --- what is no recipe --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"urdf": "no xml"}, UrdfError, "the recorded URDF cannot be used"),
        ({"steps": [["__delattr__", {}]]}, InputError, "step '__delattr__' of the robot, expected one of reduced"),
        ({"steps": [["with_payload", {"weight": 1}]]}, InputError, "no recipe of a robot"),
        ({"steps": 3}, InputError, "no recipe of a robot"),
        ({"limits": {}}, InputError, "no recipe of a robot"),
        ({"encoder_counts": [1.0]}, InputError, r"\(1,\) values are recorded of the joints, expected \(2,\)"),
        ({"friction": {"law": "Viscous", "coefficients": [1.0]}}, InputError, "is for 1 joints, the robot has 2"),
    ],
)
def test_what_is_no_recipe_says_so(arm, change, error, message):
    with pytest.raises(error, match=message):
        robot_of(recipe_of(arm) | change)
