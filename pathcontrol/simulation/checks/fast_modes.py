"""The fastest modes of the arm and of its disturbance that the explicit part of a step of the plant must resolve.

Viscous friction is exact in a step of any length (:class:`Damping`). Gravity, Coriolis forces and the slope of dry
friction are taken by the midpoint rule, and a disturbance is held over a step.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array, average_neighbours
from pathcontrol.robot.friction import FrictionLaw, levels_of, levels_vary, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import (
    Disturbance,
    FrameForce,
    Harmonic,
    Push,
    jump_times,
    list_terms,
)
from pathcontrol.simulation.arm.dropout import Dropout
from pathcontrol.simulation.arm.friction_change import FrictionChange
from pathcontrol.simulation.arm.jam import JammedJoint
from pathcontrol.simulation.arm.pick_up import PickUp
from pathcontrol.simulation.arm.torque_limit_drop import TorqueLimitDrop
from pathcontrol.simulation.arm.wall import Wall

_NUDGE = 1e-5  # rad and rad/s, the step of finite differences
_TRIED_SPEED, _TRIED_ANGLE = 0.1, 1e-3  # rad/s and rad, the differences at which a disturbance is evaluated
_TIMES = 65
_SPEEDS = np.geomspace(1e-4, 10.0, 41)  # rad/s, between which the slope of friction is taken


#: disturbances whose torque depends on time alone; a class of the user's own that extends one of them is none of these
_OF_TIME = (Push, Harmonic, TorqueLimitDrop, Dropout, FrictionChange, JammedJoint, PickUp, Wall)


class DampedArm(NamedTuple):
    """An arm with M̂ = M + hB/2, a lower bound of the inertia in a step of h.

    Attributes:
        arm: the arm.
        added: the diagonal of hB/2 [kg m²], (n,).
    """

    arm: RobotModel
    added: Array

    def mass_matrix(self, q: Array) -> Array:
        """Return M̂ [kg m²] at q (k, n), (k, n, n)."""
        return self.arm.mass_matrix(q) + np.diag(self.added)


def add_damping(robot: RobotModel, step: float) -> DampedArm:
    """Return the arm with the inertia that it has at least in a ``step`` of h [s]."""
    return DampedArm(robot, np.broadcast_to(0.5 * step * np.atleast_2d(viscous_of(robot.friction))[0], robot.n))


def rate_of_arm(damped: DampedArm, q: Array, qd: Array) -> float:
    """Return the fastest mode [1/s] of an arm with M̂ under gravity and Coriolis forces, at the states (k, n).

    It is the largest |λ| of δq̈ = −M̂⁻¹ ∂(Cq̇ + g)/∂(q, q̇) (δq, δq̇), by central differences.
    """
    n = damped.arm.n
    nudges = _NUDGE * np.concatenate([np.eye(2 * n), -np.eye(2 * n)])
    effects = damped.arm.nonlinear_effects(q[:, None] + nudges[:, :n], qd[:, None] + nudges[:, n:])
    rise = np.swapaxes(effects[:, : 2 * n] - effects[:, 2 * n :], -1, -2) / (2 * _NUDGE)
    slope = -np.linalg.solve(damped.mass_matrix(q), rise)
    upper = np.broadcast_to(np.eye(n, 2 * n, n), slope.shape)
    return float(np.abs(np.linalg.eigvals(np.concatenate([upper, slope], axis=-2))).max())


def rate_of_friction(damped: DampedArm, q: Array) -> tuple[float, int]:
    """Return the fastest acceleration −F'(q̇)/M̂ [1/s] of a joint by falling dry friction (Stribeck), and the joint."""
    friction = damped.arm.friction
    if not levels_vary(friction):
        return 0.0, 0
    mobility = np.diagonal(np.linalg.inv(damped.mass_matrix(q)), axis1=-2, axis2=-1).max(0)
    rates = steepest_fall(friction) * mobility
    joint = int(rates.argmax())
    return float(rates[joint]), joint


def steepest_fall(friction: FrictionLaw) -> Array:
    """Return −F'(q̇) [N m s/rad] at the steepest fall of dry friction with speed, (n,), or (N, n) for N rollouts."""
    falls = []
    for side, sign in enumerate((1.0, -1.0)):
        level = np.array([levels_of(friction, np.full((1, friction.n), sign * v))[side] for v in _SPEEDS])
        steps = np.diff(_SPEEDS).reshape(-1, *[1] * (level.ndim - 1))
        falls.append((-np.diff(level, axis=0) / steps).max(0))
    found = np.maximum(0.0, np.maximum(*falls))
    return found[0] if len(found) == 1 else found


def rates_of_disturbance(
    disturbance: Disturbance, damped: DampedArm, q: Array, qd: Array, duration: float
) -> tuple[float, float]:
    """Return the fastest damping and the fastest oscillation [1/s] that a disturbance gives the arm.

    They are the largest |λ| of M̂⁻¹ ∂d/∂q̇, and the square root of that of M̂⁻¹ ∂d/∂q. The torques d are evaluated at
    some times, at velocities and positions beside those of the start, (N, n). Terms of the library that depend on time
    alone have no slopes, and are not asked.
    """
    terms = [term for term in list_terms(disturbance) if type(term) not in _OF_TIME]
    if not terms:
        return 0.0, 0.0
    felt = reduce(add, terms)
    inverse = np.linalg.inv(damped.mass_matrix(q))
    known: set[bytes] = set()
    damping = stiffness = 0.0
    states = [(q + side * _TRIED_ANGLE, qd + side * _TRIED_SPEED) for side in (0.0, 1.0, -1.0)]
    tried = np.empty((3, *q.shape))
    for t in _sample_times(felt, duration):
        for torque, state in zip(tried, states, strict=True):
            torque[...] = felt.torque(t, *state)
        if (one := tried.tobytes()) in known:  # most change at their jumps only, and their slopes with them
            continue
        known.add(one)
        slopes = _slopes(felt, t, q, qd, tried)
        if slopes is None:
            continue
        by_speed, by_angle = slopes
        damping = max(damping, _spectral_radius(inverse @ by_speed))
        stiffness = max(stiffness, _spectral_radius(inverse @ by_angle))
    return damping, float(np.sqrt(stiffness))


def _sample_times(disturbance: Disturbance, duration: float) -> Iterator[float]:
    """Yield times [s] at which a disturbance is evaluated: between its jumps, and evenly spread.

    Forces on frames are the same from one jump to the next.
    """
    jumps = jump_times(disturbance)
    ends = np.concatenate([[0.0], np.unique(jumps[(jumps > 0) & (jumps < duration)]), [duration]])
    between = average_neighbours(ends)
    if len(between) > _TIMES or any(type(term) is not FrameForce for term in list_terms(disturbance)):
        between = np.union1d(np.linspace(0.0, duration, _TIMES), between[:_TIMES])
    yield from between.tolist()


def _torque(disturbance: Disturbance, t: float, q: Array, qd: Array) -> Array:
    """Return the torque at t [s], (N, n)."""
    return np.broadcast_to(np.asarray(disturbance.torque(t, q, qd), dtype=np.float64), q.shape)


def _slopes(disturbance: Disturbance, t: float, q: Array, qd: Array, tried: Array) -> tuple[Array, Array] | None:
    """Return ∂d/∂q̇ and ∂d/∂q at t [s], (N, n, n); ``None`` where they vanish or cannot be measured, as for noise.

    ``tried`` are the torques of the states (N, n) and of two beside them, (3, N, n).
    """
    here, *moved = tried
    if all(np.array_equal(here, there) for there in moved):
        return None
    if not np.array_equal(here, _torque(disturbance, t, q, qd)):
        return None
    by_speed, by_angle = np.zeros((2, len(q), q.shape[1], q.shape[1]))
    for j, one in enumerate(np.eye(q.shape[1])):
        for slopes, dq, dv in ((by_speed, 0.0, _TRIED_SPEED * one), (by_angle, _TRIED_ANGLE * one, 0.0)):
            change = _torque(disturbance, t, q + dq, qd + dv) - _torque(disturbance, t, q - dq, qd - dv)
            slopes[:, :, j] = change / (2 * max(np.max(dq), np.max(dv)))
    return by_speed, by_angle


def _spectral_radius(matrices: Array) -> float:
    """Return the largest |λ| of finite matrices (…, n, n)."""
    finite = matrices[np.isfinite(matrices).all((-2, -1))]
    return float(np.abs(np.linalg.eigvals(finite)).max(initial=0.0)) if finite.any() else 0.0
