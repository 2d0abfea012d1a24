"""The longest period for the gains of a law whose torque is held over a period."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.control.adaptive_slotine_li import AdaptiveSlotineLi
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.maneuver_regulation import ManeuverRegulation
from pathcontrol.control.motion_control import ComputedTorque, PDPlus, SlotineLi
from pathcontrol.control.passive_velocity_field import PassiveVelocityField
from pathcontrol.control.state_to_reference import StateToReferenceProjection
from pathcontrol.control.transverse_linearization import TransverseLinearization
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.robot.friction import viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.damping import Damping

_HALVINGS = 30
_SHORTEST = 1e-6  # share of the period at which the search ends

#: laws whose acceleration has the feedback K_p e_p + K_v e_v
_ACCELERATING = (ComputedTorque, ExtendedMotionPlan, StateToReferenceProjection, ManeuverRegulation)


class Feedback(NamedTuple):
    """A linearised law near its path in a rollout, at k postures: τ = G_p e_p + G_v e_v, (k, n, n) each."""

    G_p: Array
    G_v: Array
    rollout: int


def linearize_law(controller: Controller, q: Array, rollouts: Sequence[int] = ()) -> list[Feedback]:
    """Return the feedback of a law of the library at q (k, n), for the extreme gains of a batch and some ``rollouts``.

    For a law of the user's own none is returned. A wrapped law has the feedback of the one inside.
    """
    controller = unwrap(controller)
    M = controller.robot.mass_matrix(q)
    if isinstance(controller, SlotineLi | AdaptiveSlotineLi):
        pairs = _select_extremes(controller.Lambda, controller.K_d, controller.robot.n, rollouts)
        return [
            Feedback(_repeat_diagonal(K_d * Lambda, M), _repeat_diagonal(K_d, M) + M * Lambda, row)
            for Lambda, K_d, row in pairs
        ]
    if isinstance(controller, PDPlus):
        pairs = _select_extremes(controller.K_p, controller.K_v, controller.robot.n, rollouts)
        return [Feedback(_repeat_diagonal(K_p, M), _repeat_diagonal(K_v, M), row) for K_p, K_v, row in pairs]
    if isinstance(controller, TransverseLinearization | PassiveVelocityField):
        pairs = _select_extremes(*_columns_beside(controller), controller.robot.n, rollouts)
        return [Feedback(M * k_p, M * k_v, row) for k_p, k_v, row in pairs]
    if isinstance(controller, _ACCELERATING):
        pairs = _select_extremes(controller.K_p, controller.K_v, controller.robot.n, rollouts)
        return [Feedback(M * K_p, M * K_v, row) for K_p, K_v, row in pairs]
    return []


def longest_period(feedback: Feedback, robot: RobotModel, uncompensated: Array, q: Array, period: float) -> float:
    """Return the longest period [s] for a stable loop, or infinity if ``period`` is short enough.

    With M̃ and X of :class:`Damping` for a step of h, an arm near its path obeys

        v⁺ = v − h M̃⁻¹(G_p e + (G_v + B − B̂)v),    e⁺ = e + h(v + v⁺)/2 + XB(v⁺ − v).

    For computed torque without friction that is, joint by joint, the characteristic polynomial
    z² − (2 − K_v h − K_p h²/2) z + 1 − K_v h + K_p h²/2, stable (Jury) where K_v h < 2 and K_p h < 2 K_v.

    Args:
        feedback: the law, at q.
        robot: the simulated arm.
        uncompensated: b − b̂ [N m s/rad], the viscous friction that the law leaves, (n,).
        q: postures [rad], (k, n).
        period: h [s].
    """
    M = robot.mass_matrix(q)
    damping = np.broadcast_to(np.atleast_2d(viscous_of(robot.friction))[0], (len(q), robot.n))
    G_v = feedback.G_v + _repeat_diagonal(uncompensated, M)

    def stable(h: float) -> bool:
        inertia, travel = Damping(damping, h).condense(M, np.ones(q.shape, dtype=bool))
        change = -h * np.linalg.solve(inertia, np.concatenate([feedback.G_p, G_v], axis=-1))
        one, none = np.eye(robot.n), np.zeros((robot.n, robot.n))
        position = (0.5 * h * one + h * travel) @ change + np.concatenate([one, h * one], axis=-1)
        velocity = change + np.concatenate([none, one], axis=-1)
        return bool(np.abs(np.linalg.eigvals(np.concatenate([position, velocity], axis=-2))).max() < 1)

    if stable(period):
        return np.inf
    low, high = _SHORTEST * period, period
    for _ in range(_HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _columns_beside(law: TransverseLinearization | PassiveVelocityField) -> tuple[Array, Array]:
    """Return stiffness [1/s²] and damping [1/s] beside the path of a law with one gain for all joints."""
    if isinstance(law, TransverseLinearization):
        return law.k_p, law.k_v
    return law.Lambda * law.K_v, law.Lambda + law.K_v


def _select_extremes(
    position: ArrayLike, velocity: ArrayLike, n: int, rollouts: Sequence[int]
) -> list[tuple[Array, Array, int]]:
    """Return pairs of gains, (n,) each, with their rollout: those with the largest gain or ratio, and some more."""
    p, v = np.broadcast_arrays(np.atleast_2d(position), np.atleast_2d(velocity), np.empty((1, n)))[:2]
    if len(p) == 1:
        return [(p[0], v[0], row) for row in rollouts or (0,)]
    rows = np.unique([*(row for values in (p, v, p / v) for row in np.argmax(values, axis=0)), *rollouts])
    return [(p[row], v[row], int(row)) for row in rows]


def _repeat_diagonal(diagonal: Array, M: Array) -> Array:
    """Repeat a diagonal matrix for each of the matrices M."""
    return np.broadcast_to(np.diag(diagonal), M.shape)
