"""Passive velocity field control: the arm exchanges energy with a flywheel, and no more than that with its motors."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import ControlOutput
from pathcontrol.control.gains import each_rollout, positive_rollout_gain, rollout_gain
from pathcontrol.control.nearest_point import NearestPoint
from pathcontrol.control.reference_law import Located
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.batch.task_batch import map_tasks
from pathcontrol.tasks.task import PathTask

_SAMPLES = 65  # of the path, for its largest speed and inertia
_MOST = 0.9  # share of the energy that the field may ask of the arm


def _as_rows(numbers: Array) -> Array:
    """Return one number of each rollout, (N,), as rows (N, 1); one number stays one."""
    return numbers[..., None] if numbers.ndim else numbers


class _Field(NamedTuple):
    """The field V with its covariant derivative, for the arm (*batch, n) and the flywheel (*batch,)."""

    momentum: Array  # P = MV
    derivative: Array  # w = M dV/dt + CV
    momentum_f: Array
    derivative_f: Array


class PassiveVelocityField(NearestPoint):
    """Passive velocity field control, with a field that is made of the path.

    (P. Y. Li and R. Horowitz, IEEE Trans. Robotics and Automation 15(4), 1999; IEEE Trans. Automatic Control 46(9),
    2001, in two parts.) The field has the velocity of the profile on the path, and leads to it from beside, no faster
    than v:

        V(q) = r(σ̄) + Λe_p/√(1 + (Λ‖e_p‖/v)²),    r = q_d'ϑ,    e_p = q_d(σ̄) − q ⊥ r

    A flywheel that only the controller has is added to the arm: q̄̇ = (q̇, f), M̄ = diag(M, 1), and the field gets the
    component with which its energy is the same everywhere, ½V̄ᵀM̄V̄ = Ē. With p̄ = M̄q̄̇, P̄ = M̄V̄ and the covariant
    derivative w̄ = M̄ dV̄/dt + C̄V̄,

        τ̄ = (w̄P̄ᵀ − P̄w̄ᵀ)q̄̇/(2Ē) + γ(P̄p̄ᵀ − p̄P̄ᵀ)q̄̇,    γ = K_v/(2Ē)
        τ = g(q) + f̂(q̇) + its part for the arm,    df/dt = its part for the flywheel

    Both matrices are skew, so that τ̄ has no power, and whatever pushes the arm by τ_e meets a passive system:
    k̄ = ½q̄̇ᵀM̄q̄̇ has the rate q̇ᵀτ_e, and is constant without. The motion tends to a multiple of the field: x = V̄ᵀM̄q̄̇ has
    the rate γ(4Ēk̄ − x²), hence x = 2√(Ēk̄) tanh(2γ√(Ēk̄)t + c), and ‖q̄̇ − βV̄‖ in the metric M̄ decays with the rate
    2γ√(Ēk̄), which is K_v where k̄ = Ē. The factor is β = √(k̄/Ē). The flywheel begins with what the arm lacks of Ē, so
    that β = 1.

    This holds in continuous time, with all friction compensated and no torque at its limit. Friction that is left takes
    energy until the arm rests; ``recharge`` ρ gives it back by ρ(Ē − k̄)P̄/(2Ē) in τ̄, whose power is ρ(Ē − k̄)β along the
    field. It is not passive, but no more than 2ρĒ/√27 flows in: where k̄ > Ē the term has the factor x/(2√(Ēk̄)), and
    takes energy whichever way the arm moves. f has the unit √J: inertia of the flywheel would change
    nothing. Where V needs more than 0.9Ē it is made shorter. At the end of an open path V is that of the timed plan.

    Each gain is one number for all joints, and of several rollouts a column (N, 1).

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        Lambda: Λ, the rate at which the field leads to the path [1/s].
        K_v: rate at which the velocity comes to the field [1/s].
        energy: Ē [J]; by default twice that of the arm at v√2, where the path has the largest inertia.
        approach: v [rad/s]; by default the largest speed ‖r‖ of the task.
        recharge: ρ [1/s], 0 or more.
        options: ``branch``, ``capture``, ``friction`` and ``start`` as of :class:`Projection`.
    """

    gains = ("Lambda", "K_v", "recharge", "energy", "approach")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        Lambda: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        K_v: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        energy: Annotated[ArrayLike, Form.GAIN, Unit("J")] | None = None,
        approach: Annotated[ArrayLike, Form.GAIN, Unit("rad/s")] | None = None,
        recharge: Annotated[ArrayLike, Form.GAIN_OR_ZERO, Unit("1/s")] = 0.0,
        **options: Any,
    ) -> None:
        super().__init__(robot, task, **options)
        self.Lambda, self.K_v = positive_rollout_gain("Lambda", Lambda), positive_rollout_gain("K_v", K_v)
        self.recharge = rollout_gain("recharge", recharge)
        if (self.recharge < 0).any():
            raise InputError(
                f"recharge = {self.recharge.tolist()}, expected 0 or more: a negative one wastes energy",
                argument="recharge",
                value=recharge,
                limit=0.0,
            )
        fastest, inertia = np.moveaxis(np.asarray(map_tasks(task, self._survey)), -1, 0)
        self.approach = positive_rollout_gain("approach", _as_rows(fastest) if approach is None else approach)
        enough = 2 * inertia * each_rollout(self.approach) ** 2
        self.energy = positive_rollout_gain("energy", _as_rows(enough) if energy is None else energy)
        need = np.broadcast_to(0.5 * inertia * fastest**2 / _MOST, np.shape(enough))
        if (need > each_rollout(self.energy)).any():
            raise InputError(
                f"energy = {self.energy.tolist()} J, but the arm may need {need.max():.3g} J at the speed of the task",
                argument="energy",
                value=self.energy,
                limit=need.max(),
            )

    def _survey(self, task: PathTask) -> Array:
        """Return the largest speed ‖r‖ [rad/s] of one task, and the largest eigenvalue of M on its path, (2,)."""
        point = task.at(np.linspace(*task.sampled_interval, _SAMPLES))
        inertia = np.linalg.eigvalsh(self.robot.mass_matrix(point.q_d)).max()
        return np.array([np.linalg.norm(point.velocity, axis=-1).max(), inertia])

    def start(self, q: ArrayLike, qd: ArrayLike) -> Array:
        z = super().start(q, qd)
        left = np.maximum(each_rollout(self.energy) - self.robot.kinetic_energy(q, qd), 0.0)
        batch = np.broadcast_shapes(z.shape[:-1], left.shape)  # one start may serve rollouts of several energies
        z, left = np.broadcast_to(z, (*batch, z.shape[-1])), np.broadcast_to(left, batch)
        return np.concatenate([z, np.sqrt(2 * left)[..., None]], axis=-1)

    def augmented_energy(self, q: Array, qd: Array, z: Array) -> Array:
        """Return k̄ = ½q̇ᵀM(q)q̇ + ½f² [J], (*batch,), of arm and flywheel, for the state z of the law."""
        return self.robot.kinetic_energy(q, qd) + 0.5 * np.asarray(z)[..., -1] ** 2

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        here, f = self.locate(q, qd, z[..., 0]), z[..., -1]
        sdot = np.where(here.timed, here.point.theta, here.found.rate(qd, np.zeros_like(qd)))
        field, own = self._field(q, qd, here, sdot), self.robot.momentum(q, qd)
        along = (field.momentum * qd).sum(-1) + field.momentum_f * f  # P̄ᵀq̄̇
        turned = (field.derivative * qd).sum(-1) + field.derivative_f * f  # w̄ᵀq̄̇
        twice = (own * qd).sum(-1) + f**2  # 2k̄
        energy = each_rollout(self.energy)
        gain, lacking = each_rollout(self.K_v) / (2 * energy), self._lacking(energy, 0.5 * twice, along)
        by_w = along / (2 * energy)
        by_P = (each_rollout(self.recharge) * lacking - turned) / (2 * energy) + gain * twice
        by_p = -gain * along
        tau = by_w[..., None] * field.derivative + by_P[..., None] * field.momentum + by_p[..., None] * own
        f_rate = by_w * field.derivative_f + by_P * field.momentum_f + by_p * f
        out = self.conclude(t, q, qd, z, here, tau + self.robot.gravity(q), sdot)
        return out._replace(zdot=np.concatenate([out.zdot, f_rate[..., None]], axis=-1))

    @staticmethod
    def _lacking(energy: Array, own: Array, along: Array) -> Array:
        """Return Ē − k̄ [J], times x/(2√(Ēk̄)) where k̄ > Ē: then the recharge takes energy, also against the field."""
        surplus = own > energy
        cosine = along / np.where(surplus, 2 * np.sqrt(energy * own), 1.0)
        return np.asarray((energy - own) * np.where(surplus, cosine, 1.0))

    def advance(self, z: Array, out: ControlOutput, period: float) -> Array:
        f = z[..., -1:] + period * out.zdot[..., -1:]
        return np.concatenate([super().advance(z, out, period), f], axis=-1)

    def velocity(self, here: Located, qd: Array, sdot: Array) -> tuple[Array, Array]:
        """Return V [rad/s] and dV/dt along the motion [rad/s²], (*batch, n), before V is made shorter."""
        point, e_p, e_rate = here.point, here.e_p, here.point.dq_d * sdot[..., None] - qd
        squared = (self.Lambda / self.approach) ** 2
        share = 1 / np.sqrt(1 + squared * (e_p**2).sum(-1, keepdims=True))
        share_rate = -(share**3) * squared * (e_p * e_rate).sum(-1, keepdims=True)
        V = point.velocity + self.Lambda * share * e_p
        return V, point.velocity_slope * sdot[..., None] + self.Lambda * (share * e_rate + share_rate * e_p)

    def _field(self, q: Array, qd: Array, here: Located, sdot: Array) -> _Field:
        """Return the augmented field at the arm; its energy is Ē, so that V̄ᵀw̄ = 0."""
        V, V_rate = self.velocity(here, qd, sdot)
        P = self.robot.momentum(q, V)
        w = self.robot.inverse_dynamics(q, qd, V_rate, velocity=V) - self.robot.gravity(q)
        whole, energy, power = each_rollout(self.energy), 0.5 * (V * P).sum(-1), (V * w).sum(-1)
        long = energy > _MOST * whole
        share = np.where(long, np.sqrt(_MOST * whole / np.where(long, energy, 1.0)), 1.0)
        share_rate = np.where(long, -share * power / (2 * np.where(long, energy, 1.0)), 0.0)
        w = share[..., None] * w + share_rate[..., None] * P
        P_f = np.sqrt(2 * (whole - share**2 * energy))
        return _Field(share[..., None] * P, w, P_f, np.where(long, 0.0, -power / P_f))
