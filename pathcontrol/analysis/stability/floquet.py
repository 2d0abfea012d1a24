"""Floquet multipliers of a law on a closed path: how fast what is beside the path comes back to it.

Along a lap of period T small deviations δ from the closed orbit obey a linear equation with periodic coefficients,
δ̇ = A(t)δ, or at ticks δ⁺ = A_k δ. Its matrix over a lap, the monodromy matrix, has the multipliers μ as eigenvalues and
the modes as eigenvectors; λ = ln(μ)/T are exponents [1/s]. One multiplier is 1: a shift along the orbit neither grows
nor decays. The orbit is stable where all others are inside the unit circle (Floquet 1883).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array, check_whole
from pathcontrol._expect import expect
from pathcontrol.analysis.stability.closed_orbits import Lap, LawOfRows, follow_laps, pad_steps
from pathcontrol.analysis.stability.product_eigen import ProductEigen, find_eigen, find_eigen_of_many
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.law_gains import refuse_several_gains
from pathcontrol.errors import InputError
from pathcontrol.robot.friction import levels_of
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

_LARGEST = 700.0  # logarithm of a multiplier


@dataclass(frozen=True, eq=False)
class Floquet:
    """The stability of a closed orbit; the state has D components: q, q̇, that of the law, and that of the loop.

    Attributes:
        period: time of a lap T [s].
        multipliers: eigenvalues of the monodromy matrix, the largest first, complex (D,).
        exponents: λ = ln(μ)/T [1/s], complex (D,); the imaginary part is known up to multiples of 2π/T.
        modes: their eigenvectors at the beginning of the lap, columns, complex (D, D).
        along: index of the multiplier 1 of a shift along the orbit.
    """

    period: float
    multipliers: Array
    exponents: Array
    modes: Array
    along: int

    @property
    def transverse(self) -> Array:
        """The exponents but that along the orbit, slowest first, (D − 1,)."""
        return np.delete(self.exponents, self.along)

    @property
    def stable(self) -> bool:
        """True if all deviations but a shift along the orbit decay.

        It is False for :class:`AdaptiveSlotineLi`: parameters that do not show on the path stay as wrong as they are,
        with multipliers of 1, of which ``along`` is any.
        """
        return bool((self.transverse.real < 0).all())

    @property
    def decay_rate(self) -> float:
        """The rate [1/s] at which the slowest deviation from the orbit decays; negative where it grows."""
        return float(-self.transverse.real.max())


def floquet(law: Controller, loop: SampledLoop | ContinuousTime | None = None, settle: int = 3) -> Floquet:
    """Return the Floquet multipliers of a law on its closed path.

    In continuous time, the default, the orbit is the path at its velocity, which asks for friction that the law
    compensates exactly. In a sampled loop the orbit is that of the loop as it is simulated, with its hold, velocities
    by differences, filter and delay, after some laps to settle. Ticks seldom fit into a lap: the lap ends at the
    nearest one, and exponents are those per time of these ticks.

    Args:
        law: the law, with one closed path and one set of gains; its own model is the arm.
        loop: how the loop is closed; without encoders, noise and limits, which have no derivative.
        settle: laps of a sampled loop before it is linearised.

    Raises:
        InputError: the path is not closed or is no orbit of the law, the plan does not go round it, there is dry
            friction, or the loop has no derivative.
    """
    check_controller("law", law)
    settle, task = check_whole("settle", settle, 1), check_path(law)
    if loop is not None:
        expect("loop", loop, SampledLoop, ContinuousTime)
    [lap] = follow_laps(lambda rows: law, 1, task, loop, settle)
    return _solve(lap, find_eigen(lap.steps))


def slowest_growth(
    laws: LawOfRows, rows: int, task: PathTask, loop: SampledLoop | ContinuousTime | None, settle: int
) -> tuple[Array, Array]:
    """Return the growth rate [1/s] of the slowest transverse mode with each of some ``rows`` of gains, and |μ|.

    Below 0 all deviations decay. Both are (rows,), of :func:`floquet` for each of them, with fewer sweeps.
    """
    laps = follow_laps(laws, rows, task, loop, settle)
    found = [_solve(*each) for each in zip(laps, find_eigen_of_many(pad_steps(laps), leading=True), strict=True)]
    rates, periods = np.array([(-one.decay_rate, one.period) for one in found]).T
    return rates, _exp(rates, periods).real


def check_path(law: Controller) -> PathTask:
    """Return the closed path of a law with one set of gains, whose arm has no dry friction."""
    task, arm = law.task, law.robot
    if isinstance(task, TaskBatch) or task.period is None:
        raise InputError(
            f"{type(task).__name__} is no single closed path, and multipliers are those of its laps", value=task
        )
    refuse_several_gains(law)
    if any(np.any(level) for level in levels_of(arm.friction, np.zeros(arm.n))):
        raise InputError(
            "the arm has dry friction, which has no derivative; give the law the arm with Viscous friction only",
            argument="law",
        )
    return task


def _solve(lap: Lap, found: ProductEigen) -> Floquet:
    """Return the multipliers of a lap from the eigenvalues of its steps."""
    exponents = found.logarithms.real / lap.duration + 1j * (found.logarithms.imag / lap.duration)
    # on a sampled loop, whose ticks do not fit into a lap, 1 to a few digits; another that is as near to 1 is as slow
    along = int(np.abs(exponents).argmin())
    return Floquet(lap.period, _exp(exponents, lap.period), exponents, found.vectors, along)


def _exp(exponents: Array, period: float | Array) -> Array:
    """Return exp(λT), 0 for −∞, and at most 1e304."""
    return np.exp(np.minimum(exponents.real * period, _LARGEST)) * np.exp(1j * exponents.imag * period)
