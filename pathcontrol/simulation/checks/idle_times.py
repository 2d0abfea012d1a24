"""Warnings of disturbances that cannot act in the time of a run."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import warn
from pathcontrol.simulation.arm.disturbance import Disturbance, TimedDisturbance, list_terms
from pathcontrol.simulation.arm.dropout import Dropout
from pathcontrol.simulation.arm.torque_limit_drop import TorqueLimitDrop
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.simulation.run_arguments import Loop

_ROUNDING = 1e-9  # of a step, in the times of its middle


def warn_of_idle_times(disturbance: Disturbance | None, loop: Loop, duration: float, first: int = 0) -> None:
    """Warn of disturbances of a while that is not within the run [s], or falls between two middles of steps.

    Of a larger batch only the part with the ``first`` rollout 0 is looked at.
    """
    for term in () if first else list_terms(disturbance):
        if isinstance(term, TimedDisturbance) and (sentence := _describe_idle(term, loop, float(np.max(duration)))):
            warn(sentence)


def _describe_idle(term: TimedDisturbance, loop: Loop, duration: float) -> str:
    """Return the sentence about the first rollout in which a disturbance cannot act, or an empty text."""
    starts, lengths = (np.ravel(part) for part in np.broadcast_arrays(term.start, term.duration))
    step = _step_of(term, loop)
    idle = ~_can_act(starts, lengths, step, duration)
    if not idle.any():
        return ""
    row = int(idle.argmax())
    start, end = float(starts[row]), float(starts[row] + lengths[row])
    whose = f" of rollout {row}" if len(starts) > 1 else ""
    until = f"for {lengths[row]:g} s" if np.isfinite(end) else "on"
    said = f"{type(term).__name__}{whose}, from {start:g} s {until}, does nothing: "
    if start >= duration or end <= 0:
        where = "begins after the end of the run" if start >= duration else "is over before the run begins"
        return f"{said}it {where}, expected a time from 0 to {duration:g} s; try another start, or a longer run"
    return (
        f"{said}it acts in steps whose middle it covers, and covers none within {duration:g} s; expected a duration of "
        f"a step, {step:g} s, or more; try a longer one, or a shorter period of the loop"
    )


def _can_act(start: Array, length: Array, step: float, duration: float) -> Array:
    """Return whether a while covers the middle of a step (or, if that is 0, any time) of a run, (N,)."""
    if not step:
        return np.asarray((start < duration) & (start + length > 0))
    middle = (np.maximum(np.ceil(start / step - 0.5 - _ROUNDING), 0) + 0.5) * step
    return np.asarray((middle < start + length + _ROUNDING * step) & (middle < duration))


def _step_of(term: TimedDisturbance, loop: Loop) -> float:
    """Return the step [s] in whose middles a disturbance is asked: of the loop or of the plant; 0 if it is at all."""
    if not isinstance(loop, SampledLoop):
        return 0.0
    by_period = isinstance(term, TorqueLimitDrop | Dropout) or term.arm_change_times.size > 0
    return loop.period if by_period else loop.period / loop.substeps
