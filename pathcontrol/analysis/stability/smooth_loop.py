"""A law and a loop without what has no derivative, for their linearisation."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.robot.friction import Viscous, levels_of, viscous_of
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop


class SmoothLoop(NamedTuple):
    """A law and a loop that have derivatives, and the names of what was left out for that."""

    law: Controller
    loop: SampledLoop | ContinuousTime
    left_out: list[str]


def make_smooth(law: Controller, loop: SampledLoop | ContinuousTime) -> SmoothLoop:
    """Return a law on its arm with viscous friction alone, in a loop without encoders, noise and torque limits."""
    left_out = []
    if any(np.any(level) for level in levels_of(law.robot.friction, np.zeros(law.robot.n))):
        law, left_out = _leave_out_dry_friction(law), ["dry friction"]
    if isinstance(loop, SampledLoop):
        given = {"encoders": loop.encoders, "noise": loop.noise, "torque limits": loop.torque_limits}
        left_out += [name for name, value in given.items() if value is not False and value is not None]
        loop = replace(loop, encoders=False, noise=None, torque_limits=False)
    return SmoothLoop(law, loop, left_out)


def _leave_out_dry_friction(law: Controller) -> Controller:
    """Return a law whose arm has viscous friction alone."""
    if isinstance(law, LawWrapper):
        return law.around(_leave_out_dry_friction(law.wrapped))
    smooth = copy(law)
    smooth.robot = law.robot.with_friction(Viscous(np.atleast_2d(viscous_of(law.robot.friction))[0]))
    return smooth
