"""Numbers of any size make an arm that computes finite values, or are refused by name."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.errors import InputError, UrdfError

ARM = pc.load_robot("cicese_2dof")
TIP = ARM.frame_names[-1]
BOX = (
    '<robot name="r"><link name="a"/><link name="b"><visual><geometry><box size="0.1 0.1 0.6"/></geometry></visual>'
    '</link><joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>'
)

#: what may be given a number of any size, and what the refusal calls it
CHANGES = {
    "kg of joint_2": lambda x: ARM.with_masses(kg={"joint_2": x}),
    "kg of joint_1": lambda x: ARM.with_masses(kg=[x, x]),
    "scale of joint_2": lambda x: ARM.with_masses(scale={"joint_2": x}),
    "mass": lambda x: ARM.with_payload(x, TIP),
    "com": lambda x: ARM.with_payload(1.0, TIP, com=[x, 0.0, 0.0]),
    "inertia": lambda x: ARM.with_payload(1.0, TIP, inertia=[[x, 0.0, 0.0], [0.0, x, 0.0], [0.0, 0.0, x]]),
    "armature": lambda x: ARM.with_armature([0.0, x]),
    "pose": lambda x: ARM.with_frame("far", TIP, [x, 0.0, 0.0]),
    "viscous": lambda x: ARM.with_friction(pc.Viscous([x, x]) + pc.Viscous([x, x])),
    "Coulomb": lambda x: ARM.with_friction(pc.Coulomb([x, x], [0.0, x])),
    "Stribeck": lambda x: ARM.with_friction(pc.Stribeck([1.0, 1.0], [2.0, 2.0], [x, x])),
    "Stribeck coulomb": lambda x: ARM.with_friction(pc.Stribeck([x, x], [x, x], [0.1, 0.1])),
    "estimated_inertia": lambda x: pc.load_robot(BOX, estimated_inertia=x),
}
SIZES = st.floats(-323.5, 308.0).map(lambda power: 10.0**power) | st.sampled_from([5e-324, 1e-310, 1.7e308])


def values(robot: pc.RobotModel) -> list[np.ndarray]:
    """What the arm computes at a posture in motion."""
    q = np.linspace(0.3, 0.7, robot.n)
    tip = robot.frame_names[-1]
    return [
        robot.mass_matrix(q),
        robot.inverse_dynamics(q, q, q),
        robot.forward_dynamics(q, q, q),
        robot.coriolis(q, q, q),
        robot.friction.torque(q),
        robot.frame_pose(q, tip),
    ]


@pytest.mark.parametrize("what", CHANGES)
@given(size=SIZES)
def test_a_number_of_any_size_is_computed_with_or_refused(what, size):
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        robot, refusal = made_or_refused(what, size)
        if robot is not None:
            assert all(np.isfinite(value).all() for value in values(robot))
    assert robot is not None or ("expected" in refusal and what.split(" ")[0] in refusal) or "singular" in refusal


def made_or_refused(what: str, size: float) -> tuple[pc.RobotModel | None, str]:
    """The arm, or why there is none; a box at a density may also weigh nothing or too much for a URDF."""
    try:
        return CHANGES[what](size), ""
    except InputError as error:
        return None, str(error)
    except UrdfError as error:
        return None, str(error) if what == "estimated_inertia" else ""


@pytest.mark.parametrize("what", CHANGES)
@pytest.mark.parametrize("size", [1e308, np.inf, np.nan, pytest.param(10**400, id="400 digits")])
def test_what_no_arm_has_is_refused(what, size):
    with pytest.raises(InputError, match=what.split(" ")[0]):
        CHANGES[what](size)


@pytest.mark.parametrize("size", [1e-3, 1.0, 500.0, 1e5])
@pytest.mark.parametrize("what", [what for what in CHANGES if what != "estimated_inertia"])
def test_what_some_arm_has_is_taken(what, size):
    CHANGES[what](size)


@pytest.mark.parametrize("size", [1e-9, 1e8])
def test_masses_scale_dynamics_alike_far_from_one(size):
    heavy, q = ARM.with_masses(scale=[size, size]), np.array([0.3, 0.7])
    np.testing.assert_allclose(heavy.mass_matrix(q), size * ARM.mass_matrix(q), rtol=1e-12)
    np.testing.assert_allclose(heavy.gravity(q), size * ARM.gravity(q), rtol=1e-12)


def test_changes_that_add_up_are_refused_where_they_leave_the_range():
    with pytest.raises(InputError, match=r"scale of joint_2 = 1e-08: mass = .*e-1[23]"):
        ARM.with_masses(scale={"joint_2": 1e-5}).with_masses(scale={"joint_2": 1e-8})
    with pytest.raises(InputError, match=r"mass = 1e\+20, com = .* lost in rounding"):
        ARM.with_payload(1e20, TIP)
