"""Random trees of joints as URDF, to compare engines on."""

from __future__ import annotations

import numpy as np

from pathcontrol import RobotModel, load_robot

_LINK = """<link name="l{i}"><inertial><origin xyz="{com}" rpy="{rpy}"/><mass value="{mass}"/>
<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
_JOINT = """<joint name="j{i}" type="{kind}"><parent link="l{parent}"/><child link="l{i}"/>
<origin xyz="{xyz}" rpy="{rpy}"/>
<axis xyz="{axis}"/><limit lower="-9" upper="9" velocity="9" effort="99"/></joint>"""


def random_arm(
    seed: int, joints: int, *, branched: bool = True, kinds: tuple[str, ...] = ("revolute", "prismatic")
) -> RobotModel:
    """A tree of ``joints`` joints with random axes, placements and inertias."""
    rng = np.random.default_rng(seed)

    def words(values: np.ndarray) -> str:
        return " ".join(map(repr, np.asarray(values, dtype=float).tolist()))

    parts = ['<link name="l0"/>']
    for i in range(1, joints + 1):
        principal = rng.uniform(0.01, 0.02, 3)  # any three in this range satisfy the triangle inequality
        axis = np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0]) if rng.random() < 0.4 else rng.normal(size=3)
        xx, yy, zz = map(repr, principal.tolist())
        values = {
            "com": words(rng.normal(0, 0.1, 3)),
            "rpy": words(rng.normal(0, 1, 3)),
            "mass": repr(rng.uniform(0.2, 3)),
        }
        parts.append(_LINK.format(i=i, xx=xx, yy=yy, zz=zz, **values))
        place = {"xyz": words(rng.normal(0, 0.3, 3)), "rpy": words(rng.normal(0, 1, 3)), "axis": words(axis)}
        parent = int(rng.integers(max(0, i - 3), i)) if branched else i - 1
        parts.append(_JOINT.format(i=i, kind=str(rng.choice(kinds)), parent=parent, **place))
    return load_robot(f'<robot name="tree{seed}">{"".join(parts)}</robot>')
