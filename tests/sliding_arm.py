"""An arm whose joints slide: its inertia is constant, and its tool is where its joints are."""

import numpy as np

import pathcontrol as pc

_LINK = (
    '<link name="l{axis}"><inertial><mass value="{mass}"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="j{axis}" type="prismatic"><parent link="{parent}"/><child link="l{axis}"/><axis xyz="{xyz}"/>'
    '<limit lower="-9" upper="9" velocity="9" effort="999"/></joint>'
)


def sliding_arm():
    """Two slides at right angles in a horizontal plane, of 2 and 3 kg, without friction."""
    links = (("x", 2.0, "b", "1 0 0"), ("y", 3.0, "lx", "0 1 0"))
    text = "".join(_LINK.format(axis=axis, mass=mass, parent=parent, xyz=xyz) for axis, mass, parent, xyz in links)
    return pc.load_robot(f'<robot name="slides"><link name="b"/>{text}</robot>').with_friction(pc.Viscous(np.zeros(2)))
