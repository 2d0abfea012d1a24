"""An arm in MuJoCo's language, from the constants of its rigid bodies."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.constants import ArmConstants, arm_constants
from pathcontrol.robot.friction import levels_of, viscous_of
from pathcontrol.robot.model import RobotModel

#: MuJoCo's dry friction is a soft constraint; these make it as stiff as a short step allows
_RIGID = 'solreffriction="0.0002 1" solimpfriction="0.9999 0.9999 0.001"'
_OPTIONS = 'integrator="implicitfast" iterations="100" tolerance="1e-10"'


def write_mjcf(robot: RobotModel, step: float) -> str:
    """Return the MJCF of an arm with viscous and dry friction, for a time step [s].

    Dry friction is the mean of both directions; :func:`friction_bias` is the rest.
    """
    constants, viscous, dry = arm_constants(robot), viscous_of(robot.friction), _mean_levels(robot)
    children: dict[int, list[int]] = {}
    for i, parent in enumerate(constants.parent.tolist()):
        children.setdefault(parent, []).append(i)

    def body(i: int) -> str:
        slides = "slide" if constants.slides[i] else "hinge"
        loss = f'frictionloss="{dry[i]!r}" {_RIGID}' if dry[i] > 0 else ""
        joint = (
            f'<joint type="{slides}" axis="0 0 1" damping="{float(viscous[i])!r}" '
            f'armature="{float(constants.armature[i])!r}" {loss}/>'
        )
        inside = "".join(body(child) for child in children.get(i, []))
        return f"<body {_place(constants, i)}>{joint}{_inertial(constants, i)}{inside}</body>"

    arm = "".join(body(i) for i in children.get(-1, []))
    return (
        '<mujoco><compiler angle="radian" boundmass="1e-9" boundinertia="1e-12" balanceinertia="true"/>'
        f'<option timestep="{step!r}" gravity="{_join(constants.gravity)}" {_OPTIONS}/>'
        f"<worldbody>{arm}</worldbody></mujoco>"
    )


def friction_bias(robot: RobotModel) -> Array:
    """Return half of what dry friction is more forward than backward [N m], (n,): a constant torque against motion."""
    forward, backward = levels_of(robot.friction, np.zeros(robot.n))
    return np.broadcast_to((np.asarray(forward) - np.asarray(backward)) / 2, (robot.n,)).astype(np.float64)


def _mean_levels(robot: RobotModel) -> list[float]:
    """Return the mean of the dry friction in both directions [N m] of each joint."""
    forward, backward = levels_of(robot.friction, np.zeros(robot.n))
    mean = np.broadcast_to((np.asarray(forward) + np.asarray(backward)) / 2, (robot.n,))
    return [float(value) for value in mean]


def _place(constants: ArmConstants, i: int) -> str:
    """Return position and axes of a body in its parent."""
    x, y = constants.rotation[i][:, 0], constants.rotation[i][:, 1]
    return f'pos="{_join(constants.origin[i])}" xyaxes="{_join(np.concatenate([x, y]))}"'


def _inertial(constants: ArmConstants, i: int) -> str:
    """Return the mass of a body, its centre, and its inertia about that."""
    mass = max(float(constants.mass[i]), 1e-9)
    centre = constants.moment[i] / mass
    xx, xy, xz, yy, yz, zz = constants.inertia[i]
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    own = about_origin - mass * ((centre @ centre) * np.eye(3) - np.outer(centre, centre))
    moments = own[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return f'<inertial pos="{_join(centre)}" mass="{mass!r}" fullinertia="{_join(moments)}"/>'


def _join(values: Array) -> str:
    """Return numbers as a text from which they are read exactly."""
    return " ".join(repr(float(value)) for value in values)
