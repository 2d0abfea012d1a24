"""Transverse feedback linearisation: beside the path the arm obeys a linear equation, along it another."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import ControlOutput
from pathcontrol.control.gains import each_rollout, positive_rollout_gain
from pathcontrol.control.nearest_point import NearestPoint
from pathcontrol.control.reference_law import Located, differentiate_along
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask


class TransverseLinearization(NearestPoint):
    """Transverse feedback linearisation of the path, in the coordinates of its nearest point.

    (C. Nielsen and M. Maggiore, SIAM J. Control and Optimization 47(5), 2008; for paths of arms R. J. Gill, D. Kulić
    and C. Nielsen, IEEE Trans. Robotics 31(6), 2015.) With the tangent t = q_d'/‖q_d'‖ at σ̄ and N = I − ttᵀ, an arm
    near its path is at q = q_d(σ̄) + ξ, ξ = −e_p ⊥ t. In a frame that moves along the path without turning about it, the
    components of ξ have the velocity Nq̇ and the acceleration Nq̈ − Nt'σ̄̇ tᵀq̇. The law makes

        ξ̈ + k_v ξ̇ + k_p ξ = 0                          beside the path,
        d(σ̄̇ − ϑ)/dt = −k_s (σ̄̇ − ϑ(σ̄))                along it,

    by the acceleration a = Na + tt ᵀa with

        Na = Nt'σ̄̇ tᵀq̇ − k_v Nq̇ + k_p Ne_p
        q_d'ᵀa = Dσ̄̈ + (3q_d'ᵀq_d'' + e_pᵀq_d''')σ̄̇² − 2σ̄̇ q_d''ᵀq̇,    D = ‖q_d'‖² + e_pᵀq_d'',    Dσ̄̇ = q_d'ᵀq̇
        σ̄̈ = ϑ'σ̄̇ − k_s (σ̄̇ − ϑ),    τ = M(q)a + C(q,q̇)q̇ + g(q) + f̂(q̇).

    Both equations are exact and apart from each other, where the nearest point is regular, in continuous time, with all
    friction compensated and no torque at its limit. So the path is invariant: an arm on it that moves along it stays on
    it, at any speed and in both directions, and what happens along the path takes nobody off it. Any other law of σ̄̈
    would do. For two joints ξ is the signed distance to the path.

    q_d''' is taken by differences of q_d''. At the end of an open path the plan is timed, and tracked with k_p and k_v.

    Each gain is one number for all joints, and of several rollouts a column (N, 1).

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        k_p: stiffness beside the path [1/s²].
        k_v: damping beside the path [1/s].
        k_s: rate at which the speed comes to the profile [1/s].
        options: ``branch``, ``capture``, ``friction`` and ``start`` as of :class:`Projection`.
    """

    gains = ("k_p", "k_v", "k_s")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        k_p: Annotated[ArrayLike, Form.GAIN, Unit("1/s^2")],
        k_v: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        k_s: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        **options: Any,
    ) -> None:
        super().__init__(robot, task, **options)
        self.k_p, self.k_v = positive_rollout_gain("k_p", k_p), positive_rollout_gain("k_v", k_v)
        self.k_s = positive_rollout_gain("k_s", k_s)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        here = self.locate(q, qd, z[..., 0])
        along = here.found.rate(qd, np.zeros_like(qd))
        sdot = np.where(here.timed, here.point.theta, along)
        qdd = self._linearize(here, qd, along)
        if here.timed.any():
            qdd = np.where(here.timed[..., None], self._track(here), qdd)
        return self.conclude(t, q, qd, z, here, self.robot.inverse_dynamics(q, qd, qdd), sdot)

    def speed_gradient(self, q: Array, qd: Array, s: Array, velocity: Array) -> tuple[Array, Array]:
        point = self.point(s)
        stretch = 1 + np.vecdot(point.q_d - q, point.ddq_d) / np.vecdot(point.dq_d, point.dq_d)
        stretch = np.where(self.is_timed(s), 1.0, stretch)  # D/‖q_d'‖²
        return velocity * stretch[..., None], np.zeros(s.shape)

    def _linearize(self, here: Located, qd: Array, sdot: Array) -> Array:
        """Return the acceleration a [rad/s²], (*batch, n), for the rate σ̄̇ [1/s], (*batch,)."""
        point, e_p = here.point, here.e_p
        squared, bend = np.vecdot(point.dq_d, point.dq_d), np.vecdot(point.dq_d, point.ddq_d)
        tangent = point.dq_d / np.sqrt(squared)[..., None]
        # t'σ̄̇ tᵀq̇, but for its part along t
        turn = point.ddq_d * (sdot * np.vecdot(tangent, qd) / np.sqrt(squared))[..., None]
        free = turn - self.k_v * qd + self.k_p * e_p
        beside = free - tangent * np.vecdot(tangent, free)[..., None]
        sddot = point.dtheta * sdot - each_rollout(self.k_s) * (sdot - point.theta)
        third = np.vecdot(e_p, differentiate_along(self.task.ddq_d, self.task, here.s))
        stretched = (squared + np.vecdot(e_p, point.ddq_d)) * sddot
        ahead = stretched + (3 * bend + third) * sdot**2 - 2 * sdot * np.vecdot(point.ddq_d, qd)
        return beside + point.dq_d * (ahead / squared)[..., None]

    def _track(self, here: Located) -> Array:
        """Return the acceleration [rad/s²], (*batch, n), that tracks a timed plan."""
        planned = here.point.velocity_slope * here.point.theta[..., None]
        return planned + self.k_v * here.e_v + self.k_p * here.e_p
