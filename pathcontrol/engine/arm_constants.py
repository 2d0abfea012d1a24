"""The constants of arms as structs of the engine, compared with Pinocchio once."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import addressof
from weakref import WeakKeyDictionary

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.engine.library import load_library
from pathcontrol.engine.structs import MOST_JOINTS, Arm, Arms, Memory, address_of, fill
from pathcontrol.errors import EngineError
from pathcontrol.robot.constants import ArmConstants, arm_constants
from pathcontrol.robot.model import RobotModel

_STATES = 8  # number of random states at which the engine is compared with Pinocchio
_CLOSE = 1e-11  # relative difference that counts as rounding

_READY: WeakKeyDictionary[RobotModel, Arm] = WeakKeyDictionary()


def arm_struct(robot: RobotModel) -> Arm:
    """Return the constants of an arm for the engine, checked against Pinocchio when they are made.

    Raises:
        EngineError: the arm has too many joints, or engine and Pinocchio disagree about a joint.
    """
    known = _READY.get(robot)
    if known is None:
        if robot.n > MOST_JOINTS:
            raise EngineError(
                f"{robot.name} has {robot.n} joints, the compiled engine takes {MOST_JOINTS} at most",
                value=robot.n,
                limit=MOST_JOINTS,
            )
        known = fill_arm(arm_constants(robot))
        check_against_pinocchio(robot, known)
        _READY[robot] = known
    return known


def fill_arm(constants: ArmConstants) -> Arm:
    """Return constants as the struct of the engine."""
    arm = Arm(joints=len(constants.parent))
    for name in ("parent", "slides", "rotation", "origin", "mass", "moment", "inertia", "armature", "gravity"):
        fill(getattr(arm, name), getattr(constants, name))
    return arm


def check_against_pinocchio(robot: RobotModel, arm: Arm) -> None:
    """Compare τ(q, q̇, q̈), M(q), p and ∂T/∂q of the engine and of Pinocchio at random states.

    Raises:
        EngineError: they differ by more than 1e-11 of the largest value; the message names the joint.
    """
    q, qd, qdd = np.random.default_rng(0).uniform(-2.0, 2.0, (3, _STATES, robot.n))
    tau, M, p = robot.inverse_dynamics(q, qd, qdd), robot.mass_matrix(q), robot.momentum(q, qd)
    slope = robot.momentum_rate(q, qd, np.zeros(robot.n)) + robot.gravity(q)
    found_p, found_slope = momentum(arm, q, qd)
    for name, found, expected, measure in (
        ("torque", inverse_dynamics(arm, q, qd, qdd), tau, tau),
        ("inertia", mass_matrix(arm, q), M, M),
        ("momentum", found_p, p, p),
        ("gradient of the kinetic energy", found_slope, slope, tau),  # of a single joint it is 0
    ):
        apart = np.abs(found - expected).reshape(_STATES, robot.n, -1).max((0, 2))
        worst, scale = int(np.argmax(apart)), float(np.abs(measure).max())
        if not apart[worst] <= _CLOSE * scale:
            raise EngineError(
                f"the compiled engine and Pinocchio differ in the {name} of joint {robot.joint_names[worst]!r} of "
                f"{robot.name} by {apart[worst]:.3g}, of {scale:.3g}; use engine='pinocchio' and report this arm",
                value=apart[worst],
                limit=_CLOSE * scale,
                joint=robot.joint_names[worst],
            )


def inverse_dynamics(arm: Arm, q: Array, qd: Array, qdd: Array) -> Array:
    """Return τ [N m], (N, n), of the engine, for q, q̇ and q̈ (N, n)."""
    tau = np.empty(q.shape)  # in the order of rows, whatever that of q
    arrays = [np.ascontiguousarray(a) for a in (q, qd, qdd)]
    addresses = map(address_of, (*arrays, tau))
    load_library().pathcontrol_inverse_dynamics(addressof(arm), len(q), *addresses)
    return tau


def mass_matrix(arm: Arm, q: Array) -> Array:
    """Return M(q) [kg m²], (N, n, n), of the engine, for q (N, n)."""
    rows, M = np.ascontiguousarray(q), np.empty((*q.shape, q.shape[1]))
    load_library().pathcontrol_mass_matrix(addressof(arm), len(q), address_of(rows), address_of(M))
    return M


def momentum(arm: Arm, q: Array, qd: Array) -> tuple[Array, Array]:
    """Return p = M(q)q̇ [N m s] and C(q,q̇)ᵀq̇ = ∂T/∂q [N m], (N, n) each, of the engine, for q and q̇ (N, n)."""
    rows, p = [np.ascontiguousarray(a) for a in (q, qd)], np.empty((2, *q.shape))
    load_library().pathcontrol_momentum(addressof(arm), len(q), *map(address_of, (*rows, *p)))
    return p[0], p[1]


def make_arms(robots: Sequence[RobotModel], index: Array | None, memory: Memory) -> Arms:
    """Return arms of one structure for the engine, and the arm of each rollout (N,); None: the first for all.

    Raises:
        EngineError: their joints are joined in different ways.
    """
    structs = [arm_struct(robot) for robot in robots]
    trees = {(tuple(one.parent), tuple(one.slides), tuple(one.gravity)) for one in structs}
    if len(trees) > 1:
        raise EngineError("the arms of the rollouts are built in different ways, joint by joint")
    array = memory.keep((Arm * len(structs))(*structs))
    shared = index is None or len(structs) == 1
    return Arms(addressof(array), None if shared else memory.address(index, np.int32))
