"""Slips of those who load arms and runs are said in words: masses in lists, locks in degrees, files of another kind."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc

BODY = (
    '<inertial><origin xyz="0 0 0.2"/><mass value="{mass}"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
)
ARM = """<robot name="arm"><link name="base"/>
<link name="upper">{body}</link><joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="3"/></joint>
<link name="fore">{body}</link><joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0 0 0.5"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="3"/></joint>
<link name="finger">{body}</link><joint name="slide" type="prismatic"><parent link="fore"/><child link="finger"/>
<axis xyz="0 0 1"/><limit lower="0" upper="0.1" effort="9" velocity="3"/></joint></robot>"""


def arm(mass=1.0, izz=0.001) -> str:
    return ARM.format(body=BODY.format(mass=mass, izz=izz))


def test_masses_are_taken_by_name_or_in_the_order_of_the_joints():
    robot, q = pc.load_robot(arm()), [0.3, -0.5, 0.02]
    by_name = robot.with_masses(kg={"slide": 0.5, "shoulder": 3.0, "elbow": 2.0})
    in_order = robot.with_masses(kg=[3.0, 2.0, 0.5])
    assert np.array_equal(in_order.mass_matrix(q), by_name.mass_matrix(q))
    assert np.array_equal(robot.with_masses([3.0, 2.0, 0.5]).mass_matrix(q), in_order.mass_matrix(q))  # of 1 kg each


@pytest.mark.parametrize("masses", [[1.0, 2.0], 2.0, [1.0, 2.0, -1.0], "heavy", [[1.0, 2.0, 3.0]]])
def test_masses_of_another_form_are_refused(masses):
    with pytest.raises(pc.InputError, match="kg"):
        pc.load_robot(arm()).with_masses(kg=masses)


@pytest.mark.parametrize("moment", [-1e-12, -1e-9, -1e-7, -1e-5])
def test_tiny_negative_moments_are_warned_of_and_no_more(moment):
    (finding, *_) = [f for f in pc.check_urdf(arm(izz=moment)).findings if f.code == "inertia-negative"]
    assert finding.level == "warning"
    with pytest.warns(pc.PathControlWarning, match="none below zero"):
        pc.load_robot(arm(izz=moment))
    assert not [f for f in pc.check_urdf(arm(izz=0.0)).findings if f.code == "inertia-negative"]


@pytest.mark.parametrize(
    ("lock", "told"),
    [
        ({"elbow": 90.0}, "elbow = 90 rad is outside its limits of -2 to 2 rad; did you mean degrees"),
        ({"elbow": 2.5}, "elbow = 2.5 rad is outside its limits of -2 to 2 rad; did you mean degrees"),
        ({"slide": 40.0}, "slide = 40 m is outside its limits of 0 to 0.1 m; did you mean millimetres"),
        ({"slide": -0.01}, "slide = -0.01 m is outside its limits of 0 to 0.1 m$"),
    ],
)
def test_joints_locked_beyond_their_limits_are_told(lock, told):
    with pytest.warns(pc.PathControlWarning, match=told):
        assert pc.load_robot(arm(), lock=lock).n == 2


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("lock", [{"elbow": 2.0}, {"slide": 0.1}, {"elbow": -1, "slide": 0}])
def test_joints_locked_within_their_limits_are_not(lock):
    assert pc.load_robot(arm(), lock=lock).n == 3 - len(lock)


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("line.csv", "read_toolpath"), ("part.dxf", "read_toolpath"), ("arm.urdf", "load_robot"), ("run.nc", "")],
)
def test_a_file_of_another_kind_is_no_run(tmp_path, name, remedy):
    (tmp_path / name).write_text("0,0,0\n1,0,0\n")
    with pytest.raises(pc.InputError, match=f"is not a run saved by Run.save: it is no HDF5 file.*{remedy}"):
        pc.Run.load(tmp_path / name)
