"""Checks that the loop of a simulation can do what its disturbances do beside pushing."""

from __future__ import annotations

from typing import Literal, NamedTuple

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.simulation.arm.disturbance import Disturbance, list_terms
from pathcontrol.simulation.arm.dropout import Dropout
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.simulation.run_arguments import Loop


class Misfit(NamedTuple):
    """The part of a disturbance that a loop cannot do, in words, and what the loop lacks for it."""

    problem: str
    lacks: Literal["sampling", "torque_limits"]


_REMEDIES = {"sampling": "give loop=SampledLoop(...)", "torque_limits": "give torque_limits=True"}


def check_loop(disturbance: Disturbance | None, loop: Loop, q: Array) -> None:
    """Check that the loop can do what a disturbance does beside pushing, for postures q (N, n).

    Raises:
        InputError: it cannot.
    """
    if misfit := find_misfit(disturbance, loop, q):
        raise InputError(f"{misfit.problem}; {_REMEDIES[misfit.lacks]}", argument="disturbance", value=disturbance)


def find_misfit(disturbance: Disturbance | None, loop: Loop, q: Array) -> Misfit | None:
    """Return the first thing of a disturbance that the loop cannot do, ``None`` if it can do all."""
    for term in list_terms(disturbance):
        if isinstance(loop, SampledLoop):
            if term.torque_factor(0.0) is not None and loop.torque_limits is False:
                return Misfit("TorqueLimitDrop lowers torque limits, and the loop has none", "torque_limits")
        elif what := _do_at_once(term, q):
            return Misfit(f"{what}, which continuous time cannot do", "sampling")
    return None


def _do_at_once(term: Disturbance, q: Array) -> str:
    """Return in words what a disturbance does that only a sampled loop can do; an empty text if it only pushes."""
    if term.held_joints(0.0, q) is not None:
        return "a joint that jams stops at once"
    if term.torque_factor(0.0) is not None:
        return "torque limits drop at once"
    if isinstance(term, Dropout):
        return "a Dropout loses ticks or measurements"
    if isinstance(term, Wall):
        return "a Wall stops the arm at once"
    return f"{type(term).__name__} changes the arm at once" if term.arm_change_times.size else ""
