"""The robots that are known have no errors, and all their meshes."""

from os.path import join
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_urdf_check import (
    BASE,
    LIMIT,
    LOWER,
    MOMENTS,
    SHOULDER,
    UPPER,
    find,
    inertial,
    joint,
    link,
    read_by_pinocchio,
    robot,
)
from test_urdf_fuzz import FUZZ

from pathcontrol.robot.urdf import check_urdf, parse_urdf
from pathcontrol.robot.urdf.model_values import axis_inertia, moving_bodies, read_arm

ROBOTS = {
    "ur3": (),
    "ur5": (),
    "ur10": (),
    "ur5_gripper": (),
    "kinova": (),
    "z1": (),
    "xarm7": (),
    "talos_arm": (),
    "so100": (),
    "so101": (),
    "asr_twodof": (),
    "double_pendulum": (),
    "double_pendulum_continuous": (),
    "double_pendulum_simple": (),
    "finger_edu": (),
    "tiago": (),
    "tiago_dual": (),
    "allegro_left_hand": (),
    "alex_nub_hands": (),
    "bravo7_no_ee": (),
    "bravo7_gripper": ("bravo_finger1_joint", "bravo_finger2_joint"),
    "panda": ("panda_finger_joint2",),
    "baxter": ("l_gripper_r_finger_joint", "r_gripper_r_finger_joint"),
}


def urdf_path(name):
    loaders = pytest.importorskip("example_robot_data.robots_loader")
    loader = loaders.ROBOTS[name]
    parts = (loader.path, loader.urdf_subpath, loader.urdf_filename)
    return Path(loaders.getModelPath(join(*parts)), *parts)


@pytest.mark.parametrize(("name", "locked"), ROBOTS.items())
def test_known_robots_have_no_errors_and_all_their_meshes(name, locked):
    path = urdf_path(name)
    report = check_urdf(path.read_text(encoding="utf-8"), base_dir=path.parent, allow_mimic=locked)
    assert report.errors == ()
    assert find(report, "mesh-missing") == []


def test_the_mimic_finger_of_the_panda_is_refused_by_name():
    (finding,) = check_urdf(urdf_path("panda").read_text(encoding="utf-8")).errors
    assert (finding.code, finding.where) == ("joint-mimic", "joint 'panda_finger_joint2'")
    assert "'panda_finger_joint1'" in finding.message


@pytest.mark.parametrize("name", ["ur5", "kinova", "talos_arm"])
def test_common_arms_have_no_warnings(name):
    path = urdf_path(name)
    warnings = check_urdf(path.read_text(encoding="utf-8"), base_dir=path.parent).warnings
    assert {finding.code for finding in warnings} <= {"effort-below-weight"}  # TALOS states 22.3 N m for its shoulder


@given(st.tuples(*[st.floats(-3, 3)] * 6), st.floats(0, 5), st.sampled_from(["1 0 0", "0 0.6 0.8"]))
@FUZZ
def test_inertia_about_the_axis_is_that_of_pinocchio(pose, mass, axis):
    origin = f'<origin xyz="{pose[0]} {pose[1]} {pose[2]}" rpy="{pose[3]} {pose[4]} {pose[5]}"/>'
    tool = link("tool", inertial(f"{mass}", MOMENTS, origin))
    flange = joint("flange", "lower", "tool", "fixed", origin)
    turning = joint("elbow", "upper", "lower", "revolute", f'<axis xyz="{axis}"/>' + LIMIT)
    text = robot(BASE, UPPER, LOWER, tool, SHOULDER, turning, flange)
    model = read_by_pinocchio(text)
    arm = read_arm(parse_urdf(text))
    expected = pin.crba(model, model.createData(), np.array([0.4, -0.8]))[1, 1]
    assert axis_inertia(arm, moving_bodies(arm)[1]) == pytest.approx(expected, rel=1e-9)
