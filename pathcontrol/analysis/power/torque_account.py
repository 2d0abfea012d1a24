"""The torques of a run by their causes: asked for, held, limited, lost in friction, and from outside."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array, average_neighbours
from pathcontrol.analysis.disturbance_estimate import split_loop_delay, split_unexplained
from pathcontrol.analysis.limit_shares import stack_torque_limits
from pathcontrol.analysis.power.closed_loop_theorems import Energy, LoopState, Theorem
from pathcontrol.analysis.power.law_of_run import LawRecord, has_demand
from pathcontrol.control.base import Controller
from pathcontrol.errors import InputError
from pathcontrol.robot.batch import select_friction
from pathcontrol.robot.friction import viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.config import table
from pathcontrol.simulation.run import Run

_SIMULATED = ("sampled", "continuous")
_AT_LIMIT = 1 - 1e-9
_ENDS = slice(None, -1), slice(1, None)


class TorqueAccount(NamedTuple):
    """The torques in a run of N rollouts at k samples [N m].

    Attributes:
        arms: the arm that moved, of each rollout.
        law: the law.
        demand: what the law asked for, when it acts, after each sample and before the next one, (k − 1, N, n) each.
        acting: what acted, in the same way; both are held in a sampled loop.
        dry: mean dry friction, (k − 1, N, n).
        outside: mean of what acted besides, (k − 1, N, n).
        compensated: the friction that the law compensates, at the samples, (k, N, n).
    """

    arms: list[RobotModel]
    law: Controller
    demand: tuple[Array, Array]
    acting: tuple[Array, Array]
    dry: Array
    outside: Array
    compensated: Array

    @classmethod
    def of(
        cls,
        run: Run,
        law: Controller,
        record: LawRecord,
        states: LoopState,
        compensated: Array,
        plant: RobotModel | None,
    ) -> TorqueAccount:
        """Return the account of a run of a law, on its own arm or the ``plant``."""
        arms = list(run.robots) if plant is None else [select_friction(plant, i) for i in range(run.rollouts)]
        for arm in {id(arm): arm for arm in arms}.values():
            _check_arm(arm, run)
        acting, dt = acting_torque(run), np.diff(run.time)[:, None]
        mean = 0.5 * (acting[0] + acting[1])
        motion = zip(arms, *(part.swapaxes(0, 1) for part in (states.q, states.qd, mean)), strict=True)
        found = [split_unexplained(arm, dt, *rest) for arm, *rest in motion]
        dry, outside = (np.stack(parts, axis=1) for parts in zip(*found, strict=True))
        outside = outside if _may_be_pushed(run) else np.zeros_like(outside)
        return cls(arms, law, _demand(run, record, acting), acting, dry, outside, compensated)

    def shares(self, theorem: Theorem, states: LoopState, energy: Energy, wdot: Array) -> dict[str, Array]:
        """Return the rate of V that each cause supplies, (k − 1, N), by its name; ``wdot`` (k − 1, N) is ẇ."""
        y = self._apply_each(
            lambda arm, q, g: np.linalg.solve(arm.mass_matrix(q), g[..., None])[..., 0], states.q, energy[2]
        )
        viscous = self._apply_each(lambda arm, qd: viscous_of(arm.friction) * qd, states.qd) - self.compensated
        sampling, model, saturation = np.zeros((3, *wdot.shape))
        for end, demand, acting in zip(_ENDS, self.demand, self.acting, strict=True):
            torque, acceleration = theorem.demand(states.part(end), wdot)
            sampling += 0.5 * np.vecdot(y[end], torque + self.compensated[end] - demand)
            saturation += 0.5 * np.vecdot(y[end], demand - acting)
            if any(arm is not self.law.robot for arm in self.arms):
                needed = self._apply_each(RobotModel.inverse_dynamics, states.q[end], states.qd[end], acceleration)
                model += 0.5 * np.vecdot(y[end], needed - torque)
        middle = average_neighbours(y)
        smooth = np.vecdot(y, viscous)
        return {
            "friction": average_neighbours(smooth) + np.vecdot(middle, self.dry),
            "saturation": saturation,
            "sampling": sampling,
            "model": model,
            "disturbance": -np.vecdot(middle, self.outside),
        }

    def _apply_each(self, function: Callable[..., Array], *values: Array) -> Array:
        """Apply a function of an arm to values (k, N, n) of its rollouts; one call does for rollouts of one arm."""
        if all(arm is self.arms[0] for arm in self.arms):
            return function(self.arms[0], *values)
        parts = [function(arm, *(value[:, i] for value in values)) for i, arm in enumerate(self.arms)]
        return np.stack(parts, axis=1)


def _check_arm(arm: RobotModel, run: Run) -> None:
    """Check that an arm has mass and the joints of a run."""
    if arm.n != len(run.joints):
        raise InputError(
            f"{arm.name} has {arm.n} joints, the run {len(run.joints)}; expected as many",
            argument="plant",
            value=arm.n,
            limit=len(run.joints),
        )
    if not arm.has_mass:
        raise InputError(
            f"{arm.name} has no mass, so torques say nothing of its motion; give plant=…, an arm with masses",
            argument="plant",
            value=arm.name,
        )


def _may_be_pushed(run: Run) -> bool:
    """Return whether torque may act besides that of motors and friction: where the run does not say that none did."""
    return table(run.config, "loop").get("loop") not in _SIMULATED or "disturbance" in run.config


def acting_torque(run: Run) -> tuple[Array, Array]:
    """Return the torque that acts after each sample and before the next one, (k − 1, N, n) each; means where held."""
    tau, late = run.array("tau").swapaxes(0, 1), split_loop_delay(run)[1]
    if not is_sampled(run):
        return tau[:-1], tau[1:]
    held = late * tau[:-1] + (1 - late) * tau[1:] if late else tau[:-1]
    return held, held


def _demand(run: Run, record: LawRecord, acting: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the demand that would act after each sample and before the next one, (k − 1, N, n) each.

    Of a log that has no demands it is what acted, unless that is at a limit and the law asks for more.
    """
    demand, (whole, late) = record.demand, split_loop_delay(run)
    if not has_demand(run):
        tau = acting[0]
        limits = _AT_LIMIT * stack_torque_limits(run).swapaxes(0, 1)[: len(tau)]
        beyond = (np.abs(tau) >= limits) & (demand[:-1] * np.sign(tau) > np.abs(tau))
        held = np.where(beyond, demand[:-1], tau)
        return held, held
    if not is_sampled(run):
        return demand[:-1], demand[1:]
    held = _delay(demand, whole)
    held = (late * _delay(demand, whole + 1) + (1 - late) * held if late else held)[:-1]
    return held, held


def is_sampled(run: Run) -> bool:
    """Return whether torques were held from one sample to the next, as in every loop but that of continuous time."""
    return table(run.config, "loop").get("loop") != "continuous"


def _delay(values: Array, ticks: int) -> Array:
    """Return values (k, …) some ticks later, 0 before the first."""
    return values if not ticks else np.concatenate([np.zeros_like(values[:ticks]), values[:-ticks]])[: len(values)]
