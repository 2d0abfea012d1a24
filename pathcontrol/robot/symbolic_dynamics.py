"""The inverse dynamics of an arm as an expression of CasADi, for optimisation with exact derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from pathcontrol._arrays import Array
from pathcontrol._extras import load_extra
from pathcontrol.robot.model import RobotModel


def load_casadi() -> Any:
    """Return the module ``casadi``.

    Raises:
        MissingExtraError: it is not installed.
    """
    return load_extra("casadi", "mpc", "predictive control")


def symbolic_inverse_dynamics(robot: RobotModel) -> Any:
    """Return the function (q, q̇, q̈) ↦ τ = M(q)q̈ + C(q,q̇)q̇ + g(q) [N m] of CasADi, columns (n, 1) each.

    It is the recursive Newton–Euler algorithm with the constants of Pinocchio's model, in the coordinates of the joints
    (R. Featherstone, Rigid Body Dynamics Algorithms, Springer, 2008, table 5.1), and agrees with
    :meth:`RobotModel.inverse_dynamics`. Friction is not part of it.

    Raises:
        MissingExtraError: ``casadi`` is not installed.
    """
    ca, model, n = load_casadi(), robot.pinocchio_model, robot.n
    q, qd, qdd = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd"))
    axes, placements = _joint_axes(model), [np.array(place.homogeneous) for place in model.jointPlacements]
    lifted = ca.DM(-np.concatenate([model.gravity.linear, np.zeros(3)]))  # the base accelerates against gravity
    motions, forces, transforms = {0: (ca.DM.zeros(6), lifted)}, {}, {}
    for i in range(1, n + 1):
        k, axis = i - 1, axes[i]
        transforms[i] = _into_child(ca, placements[i], axis, q[k])
        velocity, acceleration = (transforms[i] @ motion for motion in motions[model.parents[i]])
        own = axis * qd[k]
        velocity = velocity + own
        acceleration = acceleration + axis * qdd[k] + _cross(ca, velocity) @ own
        motions[i] = velocity, acceleration
        inertia = np.array(model.inertias[i].matrix())
        forces[i] = inertia @ acceleration - _cross(ca, velocity).T @ (inertia @ velocity)
    tau = [None] * n
    for i in range(n, 0, -1):
        tau[i - 1] = ca.dot(axes[i], forces[i]) + float(model.armature[i - 1]) * qdd[i - 1]
        if parent := model.parents[i]:
            forces[parent] = forces[parent] + transforms[i].T @ forces[i]
    return ca.Function("inverse_dynamics", [q, qd, qdd], [ca.vertcat(*tau)], ["q", "qd", "qdd"], ["tau"])


def _joint_axes(model: Any) -> list[Array]:
    """Return the motion of each joint at unit speed in its own frame, linear then angular, (6,); 0 for the base."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    local = pin.ReferenceFrame.LOCAL
    jacobians = [pin.getJointJacobian(model, data, i, local).reshape(6, -1) for i in range(1, model.njoints)]
    return [np.zeros(6), *(jacobian[:, k] for k, jacobian in enumerate(jacobians))]


def _into_child(ca: Any, placement: Array, axis: Array, q: Any) -> Any:
    """Return the matrix (6, 6) that takes a motion from the parent's frame to that of a joint at ``q``.

    The joint's frame is placed by its ``placement``, then turned about, or moved along, its ``axis``.
    """
    turn, slide = axis[3:], axis[:3]
    K = np.cross(np.eye(3), turn)  # K x = turn × x
    about = np.eye(3) + K * ca.sin(q) + (K @ K) * (1 - ca.cos(q))
    R = placement[:3, :3] @ about
    p = placement[:3, 3] + placement[:3, :3] @ slide * q
    return ca.blockcat([[R.T, -R.T @ ca.skew(p)], [ca.SX(3, 3), R.T]])


def _cross(ca: Any, motion: Any) -> Any:
    """Return the matrix of the cross product with a ``motion``, linear then angular, of motions."""
    linear, angular = ca.skew(motion[:3]), ca.skew(motion[3:])
    return ca.blockcat([[angular, linear], [ca.SX(3, 3), angular]])
