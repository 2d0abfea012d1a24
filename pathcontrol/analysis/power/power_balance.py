"""The balance of V̇ along a run: what the theorem of its law predicts, what is measured, and where they part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, as_scalar, average_neighbours
from pathcontrol._expect import expect
from pathcontrol._json import to_json
from pathcontrol.analysis.fitting_law import refuse_other_path
from pathcontrol.analysis.power.closed_loop_theorems import Energy, LoopState, Theorem, theorem_of
from pathcontrol.analysis.power.law_of_run import LawRecord, find_law, has_demand, record_of
from pathcontrol.analysis.power.loop_states import states_of
from pathcontrol.analysis.power.torque_account import TorqueAccount, is_sampled
from pathcontrol.control.base import Controller
from pathcontrol.control.reference_law import ReferenceLaw
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run

#: the causes by which measured and predicted rates part
SHARES = ("friction", "saturation", "sampling", "model", "disturbance")
_NEEDED = ("q", "qd", "tau")


@dataclass(frozen=True, eq=False)
class PowerBalance:
    """V along a run of N rollouts and k samples, and its mean rates from each sample to the next.

    measured = predicted + friction + saturation + sampling + model + disturbance + residual, to rounding.

    Attributes:
        time: times of the samples [s], (k,).
        V: the Lyapunov function of the law, (N, k).
        middle: times between the samples [s], (k − 1,), to which all rates belong.
        predicted: V̇ of the theorem, (N, k − 1).
        measured: the change of V over the time between, (N, k − 1).
        friction: rate from friction that is not compensated, or compensated where there is none, (N, k − 1).
        saturation: rate from torque that is asked for and does not act, (N, k − 1).
        sampling: rate from the hold, the delay, sensors, and steps of the path parameter, (N, k − 1).
        model: rate from an arm that is not the law's model: a payload, other masses, (N, k − 1).
        disturbance: rate from torque that nothing else explains, (N, k − 1).
        residual: the rest, which is of second order in the period, (N, k − 1).
        unit: unit of V.
    """

    time: Array
    V: Array
    middle: Array
    predicted: Array
    measured: Array
    friction: Array
    saturation: Array
    sampling: Array
    model: Array
    disturbance: Array
    residual: Array
    unit: str

    @property
    def rate_unit(self) -> str:
        """The unit of all rates."""
        return " or ".join(map(_unit_of_rate, self.unit.split(" or ")))

    @property
    def shares(self) -> dict[str, Array]:
        """The rates by their causes, (N, k − 1) each, whose sum is measured minus predicted, but for the residual."""
        return {name: getattr(self, name) for name in SHARES}

    def means(self, begin: float = 0.0, end: float = np.inf) -> dict[str, Array]:
        """Return the mean of each rate from ``begin`` to ``end`` [s], (N,), and that of ``V``, by name.

        Of a rollout that diverged they end there.

        Raises:
            InputError: no sample is in this time, or one of them is no time.
        """
        begin, end = as_scalar("begin", begin), end if end == np.inf else as_scalar("end", end)
        among, widths = (self.middle >= begin) & (self.middle <= end), np.diff(self.time)
        if not among.any():
            raise InputError(
                f"begin = {begin:g} s and end = {end:g} s leave no sample of a run from {self.time[0]:g} to "
                f"{self.time[-1]:g} s",
                argument="begin",
                value=begin,
                limit=(float(self.time[0]), float(self.time[-1])),
            )
        level = 0.5 * (self.V[:, 1:] + self.V[:, :-1])
        rates = {"V": level, "predicted": self.predicted, "measured": self.measured, **self.shares}
        rates["residual"] = self.residual
        return {name: _mean(rate[:, among], widths[among]) for name, rate in rates.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return the means over all the time and over its second half, for each rollout, as JSON takes them."""
        half = 0.5 * (self.time[0] + self.time[-1])
        parts = {"whole": self.means(), "second_half": self.means(begin=half)}
        ends = {"V_begin": self.V[:, 0], "V_end": self.V[:, -1]}
        return {"unit": self.unit, "rate_unit": self.rate_unit} | to_json(ends | parts)


@np.errstate(over="ignore", invalid="ignore")  # numbers from a file may be huge
def power_balance(run: Run, controller: Controller | None = None, *, plant: RobotModel | None = None) -> PowerBalance:
    """Return V of a run, its predicted and its measured rate, and the share of each cause by which they part.

    The theorem of a law says V̇ = −… for exact compensation in continuous time. With the torque τ* that the law asks
    for in the true state, of which τ_r moves the arm and f̂ is for friction, the demand τ_d that it asked for when it
    last did, the torque τ that acts, and an arm with M, C, g and friction f on which d acts besides,

        V̇ − V̇* = yᵀ[(f − f̂) + (τ* − τ_d) + (τ_d − τ) + (Mq̈* + Cq̇ + g − τ_r) − d] + ∂V/∂σ (σ̇ − σ̇*),

    where y = −M⁻¹∂V/∂q̇, and q̈*, σ̇* are what the theorem has in this state. The brackets are the shares of
    ``friction``, ``sampling``, ``saturation``, ``model`` and ``disturbance``; the last term belongs to ``sampling``.

    Rates are means from sample to sample, by the trapezoidal rule where the state is smooth. d is what the
    motion says that the rest does not explain: in a log, and in a simulation with a disturbance. In any other
    simulation that is numerical error and stays in the residual, as the error of the trapezoidal rule does; both are of
    second order in the period. Where a joint rests or turns round, dry friction is what explains the motion best.

    Of a log that does not say what the law asked for, the law is replayed on the motion; torque counts as saturated
    where the torque in the log is at a limit of the arm and the law asks for more.

    Args:
        run: a run of a law with a theorem, in any loop, or a log with q, q̇ and τ.
        controller: the law; by default that of the run, by its configuration.
        plant: the arm that moved; by default the run's own. A loaded run of several arms knows the first one only.

    Raises:
        InputError: the law is not known or has no theorem here, the run has no torques or less than two samples,
            follows a sequence of paths or another path than the law, or does not know its arm.
    """
    expect("run", run, Run)
    law, theorem = _find_checked_law(run, controller)
    record = record_of(run, law)
    q, qd = (run.array(name).swapaxes(0, 1) for name in ("q", "qd"))
    known = np.isfinite(np.concatenate([q, qd, record.s[..., None]], axis=-1)).all(-1)
    q, qd = np.where(known[..., None], q, 0.0), np.where(known[..., None], qd, 0.0)
    record = LawRecord(np.where(known, record.s, law.task.s0), *record[1:])
    states, s, w = states_of(law, record, q, qd)
    compensated = _compensated(run, law, theorem, record, states, w)
    account = TorqueAccount.of(run, law, record, states, compensated, plant)
    own_plan = is_sampled(run) and not isinstance(unwrap(law), ReferenceLaw)
    balance = _balance(run, theorem, states, (s, w), account, own_plan)
    missing = ~known.T
    lost = missing[:, 1:] | missing[:, :-1]
    for name in ("predicted", "measured", *SHARES, "residual"):
        getattr(balance, name)[lost] = np.nan
    balance.V[missing] = np.nan
    return balance


def _unit_of_rate(unit: str) -> str:
    """Return the unit of the rate of a quantity in a ``unit``."""
    if unit == "J":
        return "W"
    if unit.endswith(" s"):
        return unit.removesuffix(" s")
    return unit.replace("/s^2", "/s^3") if "/s" in unit else f"{unit}/s"


def _find_checked_law(run: Run, controller: Controller | None) -> tuple[Controller, Theorem]:
    """Return the law of a run with its theorem, after a check that the run has what the balance needs."""
    if missing := [name for name in _NEEDED if name not in run or np.isnan(run.array(name)).all()]:
        raise InputError(
            f"the run has no {', '.join(missing)}; a power balance needs {', '.join(_NEEDED)}",
            value=missing,
            choices=tuple(_NEEDED),
        )
    if len(run.time) < 2:
        raise InputError(
            f"the run has {len(run.time)} sample, expected two at least, between which V changes",
            value=len(run.time),
            limit=2,
        )
    law = find_law(run, controller)
    if has_demand(run):
        refuse_other_path(run, law)
    return law, theorem_of(law)


def _balance(
    run: Run, theorem: Theorem, states: LoopState, plan: tuple[Array, Array], account: TorqueAccount, own_plan: bool
) -> PowerBalance:
    """Return the balance, rollouts first."""
    h = np.diff(run.time)[:, None]
    sdot, wdot = (np.diff(values, axis=0) / h for values in plan)
    energy = theorem.energy(states)
    measured, predicted = np.diff(energy.V, axis=0) / h, average_neighbours(energy.rate)
    supply = account.shares(theorem, states, energy, wdot)
    if own_plan:  # of any other law σ̇ is that of the theorem, but for the error of a difference
        supply["sampling"] = supply["sampling"] + _plan_error(energy, states, sdot)
    residual = measured - predicted - sum(supply.values())
    rows = {name: np.ascontiguousarray(value.T) for name, value in supply.items()}
    middle = average_neighbours(run.time)
    rates = {"predicted": predicted.T.copy(), "measured": measured.T.copy(), "residual": residual.T.copy()}
    unit = " or ".join(dict.fromkeys(theorem.unit.replace("rad", kind) for kind in run.unit("q").split(" or ")))
    return PowerBalance(run.time, energy.V.T.copy(), middle, **rates, **rows, unit=unit)


def _compensated(run: Run, law: Controller, theorem: Theorem, record: LawRecord, states: LoopState, w: Array) -> Array:
    """Return the friction that the law compensates in the true state [N m], (k, N, n).

    Of a law that compensates what it observes, it is what it asked for beside the torque for its motion.
    """
    if law.friction != "observed":
        return law.friction_torque(states.qd, states.qd + states.e_v) + np.zeros_like(states.qd)
    names = ("q_measured", "qd_measured") if "qd_measured" in run else ("q", "qd")
    seen = (run.array(name).swapaxes(0, 1) for name in names)
    q, qd = (np.where(np.isfinite(part), part, 0.0) for part in seen)
    wdot = np.zeros(w.shape)
    wdot[:-1] = np.diff(w, axis=0) / np.diff(run.time)[:, None]
    return np.asarray(record.demand - theorem.demand(states_of(law, record, q, qd)[0], wdot)[0])


def _plan_error(energy: Energy, states: LoopState, sdot: Array) -> Array:
    """Return the rate from steps of the path parameter that differ from those of the theorem, (k − 1, N)."""
    ends = (slice(None, -1), slice(1, None))
    along = [energy.by_parameter[end] * (sdot - states.sdot[end]) for end in ends]
    return 0.5 * (along[0] + along[1])


def _mean(values: Array, widths: Array) -> Array:
    """Return the means of values (N, k) over times of some widths (k,), (N,); of those that are numbers."""
    known = np.isfinite(values)
    weights = np.where(known, widths, 0.0)
    total = np.where(known, values * widths, 0.0).sum(1)
    return np.divide(total, weights.sum(1), out=np.full(len(values), np.nan), where=weights.sum(1) > 0)
