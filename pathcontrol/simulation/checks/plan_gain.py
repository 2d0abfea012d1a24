"""The largest gain k of a plan with feedback that a sampled loop bears, in closed form."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.plan_feedback import PlanFeedback
from pathcontrol.simulation.checks.too_fast import TooFast
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.tasks.task import PathTask

_MARGIN = 0.5  # share of the distance to where the plan is unstable that is usable


def largest_plan_gain(task: PathTask, loop: SampledLoop, s: Array) -> Array:
    """Return the largest usable k [1/(rad² s)] at the parameters s (m,), a number, or at s (m, N) of N tasks, (N,).

    For large k the plan is at each tick where it expects the arm to be nearest, from the position and the velocity that
    it sees. An acceleration a along the path, which it does not see, leaves it hTa behind, where T = h/2 + the lag of
    the measured velocity. That changes σ̇ at the next tick by k‖q_d'‖hTa, and the acceleration r'σ̇ that the law asks
    for by ‖r'‖ times as much, in whatever direction the arm is off its path. Where k hT‖q_d'‖‖r'‖ > 1 each period kicks
    the next one harder, unless torque limits end it. Half of that is usable:

        k = 1 / (2hT max ‖q_d'‖‖r'‖),    with exact velocities 1 / (h² max ‖q_d'‖‖r'‖).

    A delay of the torque changes when the next kick comes, not how hard it is.
    """
    point = task.at(s)
    slope = np.linalg.norm(point.dq_d, axis=-1) * np.linalg.norm(point.velocity_slope, axis=-1)
    lag = 0.5 * loop.period + velocity_lag(loop)
    with np.errstate(divide="ignore"):
        return _MARGIN / (loop.period * lag * slope.max(0))


def velocity_lag(loop: SampledLoop) -> float:
    """Return the time [s] by which the measured velocity of a steady acceleration is late.

    A difference over a period is half of it late, and the low-pass filter h e⁻ʷʰ/(1 − e⁻ʷʰ), ω = 2π ``filter_hz``.
    """
    lag = 0.5 * loop.period if loop.velocity == "difference" else 0.0
    if loop.filter_hz is not None:
        lag += loop.period / float(np.expm1(2 * np.pi * loop.filter_hz * loop.period))
    return lag


def check_plan_gain(law: PlanFeedback, loop: SampledLoop, s: Array) -> Iterator[TooFast]:
    """Yield the warning of a gain k beyond the largest usable one, with that; of the worst rollout of a batch."""
    largest, every = np.broadcast_arrays(np.ravel(largest_plan_gain(law.task, loop, s)), np.ravel(law.k))
    row = int((every / largest).argmax())
    if every[row] < largest[row]:
        return
    where = f" (rollout {row})" if len(every) > 1 else ""
    seen = " with velocities that are late" if velocity_lag(loop) else ""
    yield TooFast(
        "k",
        float(every[row] / largest[row]),
        f"k = {every[row]:g}{where} is beyond the largest usable k = {largest[row]:.3g} of this path and loop, whose "
        f"period is {loop.period:g} s{seen}: where the arm is off its path, the plan is likely to throw it further, "
        "without torque limits for ever; take a lower k, or Projection, which is k → ∞, or shorten the period (more "
        "substeps do not help)",
    )
