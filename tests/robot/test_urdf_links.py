"""Links and joints of a URDF have the values that yourdfpy reads, an independent reader."""

from __future__ import annotations

import subprocess
import sys
from io import BytesIO

import numpy as np
import pytest
import yourdfpy
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol import known_robots
from pathcontrol.robot.catalogue import find_urdf
from pathcontrol.robot.urdf import parse_urdf
from pathcontrol.robot.urdf.links import read_joint, read_link

numbers = st.floats(-1e6, 1e6).map(lambda value: f"{value:g}")
triples = st.lists(numbers, min_size=3, max_size=3).map(" ".join)
angles = st.lists(st.floats(-7, 7).map(repr), min_size=3, max_size=3).map("  ".join)
origins = st.one_of(
    st.just(""),
    st.just("<origin/>"),
    st.builds('<origin xyz="{}"/>'.format, triples),
    st.builds('<origin rpy="{}"/>'.format, angles),
    st.builds('<origin rpy="{}" xyz="{}"/>'.format, angles, triples),
)
moments = "".join(f' i{axes}="{{}}"' for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
inertials = st.one_of(
    st.just(""),
    st.builds(f'<inertial>{{}}<mass value="{{}}"/><inertia{moments}/></inertial>'.format, origins, *[numbers] * 7),
)
limits = st.one_of(
    st.just(""),
    st.builds('<limit effort="{}" velocity="{}"/>'.format, numbers, numbers),
    st.builds('<limit effort="{}" velocity="{}" lower="{}"/>'.format, *[numbers] * 3),
    st.builds('<limit effort="{}" velocity="{}" lower="{}" upper="{}"/>'.format, *[numbers] * 4),
)
frictions = st.one_of(
    st.just(""),
    st.builds('<dynamics damping="{}"/>'.format, numbers),
    st.builds('<dynamics friction="{}" damping="{}"/>'.format, numbers, numbers),
)
axes = st.one_of(st.just(""), st.builds('<axis xyz="{}"/>'.format, triples))
joints = st.builds(
    '<joint name="j" type="{}"><parent link="a"/><child link="b"/>{}{}{}{}</joint>'.format,
    st.sampled_from(["revolute", "prismatic", "fixed", "continuous"]),
    origins,
    axes,
    limits,
    frictions,
)


def assert_read_alike(text: str) -> None:
    """Compare our values of all links and joints with those of yourdfpy."""
    root = parse_urdf(text)
    for holder in root.iterfind("link"):
        for drawn in (*holder.findall("visual"), *holder.findall("collision")):
            holder.remove(drawn)
    source = BytesIO(yourdfpy.urdf.etree.tostring(root))
    robot = yourdfpy.URDF.load(source, build_scene_graph=False, load_meshes=False).robot
    for element, link in zip(root.iterfind("link"), robot.links, strict=True):
        found = read_link(element)
        assert (found.name, found.inertial is None) == (link.name, link.inertial is None)
        if found.inertial is not None:
            assert found.inertial.mass == link.inertial.mass
            np.testing.assert_array_equal(found.inertial.inertia, link.inertial.inertia)
            assert_same_pose(found.inertial.origin, link.inertial.origin)
    for element, joint in zip(root.iterfind("joint"), robot.joints, strict=True):
        found = read_joint(element)
        for name in ("name", "type", "parent", "child"):
            assert getattr(found, name) == getattr(joint, name)
        assert_same_pose(found.origin, joint.origin)
        np.testing.assert_array_equal(found.axis, joint.axis)
        assert_same_numbers(found.limit, joint.limit, "effort", "velocity", "lower", "upper")
        assert_same_numbers(found.dynamics, joint.dynamics, "damping", "friction")


def assert_same_pose(found, expected) -> None:
    assert (found is None) == (expected is None)
    if found is not None:
        np.testing.assert_allclose(found, expected, rtol=1e-15, atol=4e-16)


def assert_same_numbers(found, expected, *names: str) -> None:
    assert (found is None) == (expected is None)
    for name in names if found is not None else ():
        value = getattr(expected, name)
        assert getattr(found, name) == (None if value is None else float(value))


@given(inertials, joints)
def test_random_links_and_joints_are_read_alike(inertial, joint):
    assert_read_alike(f'<robot name="r"><link name="a">{inertial}</link><link name="b"/>{joint}</robot>')


@pytest.mark.parametrize("name", known_robots())
def test_robots_are_read_alike(name):
    assert_read_alike(find_urdf(name).text)


def test_an_arm_without_pictures_and_a_law_load_nothing_of_scipy_and_no_library_of_meshes():
    code = (
        "import sys, pathcontrol as pc; arm = pc.load_robot('cicese_2dof'); task = pc.Circle(radius=1.0, speed=2.0)\n"
        "pc.Projection(arm, task, k_p=800.0, K_v=[45.0, 100.0])\n"
        "print({'scipy', 'xarray', 'matplotlib', 'trimesh', 'yourdfpy'} & {*sys.modules})"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"
