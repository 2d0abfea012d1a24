"""Disturbances as the compiled engine takes them."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import addressof

import numpy as np

from pathcontrol.engine import structs
from pathcontrol.engine.arm_constants import arm_struct
from pathcontrol.engine.structs import MOST_WALLS, Arm, Memory, Setup
from pathcontrol.errors import EngineError
from pathcontrol.robot.constants import frame_carrier
from pathcontrol.simulation.arm.disturbance import (
    Disturbance,
    FrameForce,
    Harmonic,
    Push,
    TimedDisturbance,
    list_terms,
)
from pathcontrol.simulation.arm.dropout import Dropout
from pathcontrol.simulation.arm.friction_change import FrictionChange
from pathcontrol.simulation.arm.jam import JammedJoint
from pathcontrol.simulation.arm.pick_up import PickUp
from pathcontrol.simulation.arm.torque_limit_drop import TorqueLimitDrop
from pathcontrol.simulation.arm.wall import Wall

_DISTURBANCES = (Push, Harmonic, FrameForce, JammedJoint, TorqueLimitDrop, Wall)  # in the order of the engine's numbers
_BETWEEN = (FrictionChange, PickUp, Dropout)  # what is set for each block of ticks


def add_disturbances(setup: Setup, disturbance: Disturbance | None, memory: Memory) -> None:
    """Set pushes, sinusoids, forces on frames, joints that jam and motors that are weak.

    Raises:
        EngineError: one of them is the user's own.
    """
    terms = [term for term in list_terms(disturbance) if type(term) not in _BETWEEN]
    add_structs(setup, [disturbance_struct(term, setup.joints, memory) for term in terms], memory)


def add_structs(setup: Setup, terms: Sequence[structs.Disturbance], memory: Memory) -> None:
    """Set disturbances as structs.

    Raises:
        EngineError: there are too many walls.
    """
    kinds = [_DISTURBANCES[one.kind] for one in terms]
    setup.disturbances, setup.jams, setup.drops = len(terms), JammedJoint in kinds, TorqueLimitDrop in kinds
    setup.walls = kinds.count(Wall)
    _check_number(setup.walls)
    if terms:
        setup.disturbance = addressof(memory.keep((structs.Disturbance * len(terms))(*terms)))


def check_walls(walls: Sequence[Wall]) -> None:
    """Check that walls, which are a part of the compiled plant, are the library's own and not too many.

    Raises:
        EngineError: they are not.
    """
    _check_number(len(walls))
    for wall in walls:
        _check_known(wall)


def _check_number(count: int) -> None:
    """Raise if there are more walls than the engine takes."""
    if count > MOST_WALLS:
        raise EngineError(
            f"there are {count} walls, the engine takes {MOST_WALLS} at most", value=count, limit=MOST_WALLS
        )


def _check_known(term: Disturbance) -> None:
    """Raise if a disturbance is not one that the engine knows."""
    if type(term) not in _DISTURBANCES:
        raise EngineError(f"the disturbance {type(term).__name__} is not one of the library", value=type(term).__name__)


def disturbance_struct(term: Disturbance, n: int, memory: Memory) -> structs.Disturbance:
    """Return a disturbance as struct of the engine."""
    _check_known(term)
    struct = structs.Disturbance(kind=_DISTURBANCES.index(type(term)))
    if isinstance(term, TimedDisturbance):
        struct.start, struct.duration = memory.numbers(term.start), memory.numbers(term.duration)
    if isinstance(term, Harmonic):
        struct.magnitude = memory.rows(term.amplitude, n)
        struct.frequency, struct.phase = memory.numbers(term.frequency), memory.numbers(term.phase)
    elif isinstance(term, Push):
        struct.magnitude = memory.rows(term.magnitude, n)
    elif isinstance(term, TorqueLimitDrop):
        struct.magnitude = memory.rows(term.factor, n)
    elif isinstance(term, JammedJoint):
        struct.magnitude = memory.rows(term.joints == np.arange(n), n)
    elif isinstance(term, FrameForce):
        struct.magnitude = memory.rows(term.force, 3)
        _set_frame(struct, term, memory)
    elif isinstance(term, Wall):
        stiffness, damping = term.springs
        struct.magnitude = memory.rows(term.point, 3)
        struct.axes = memory.rows(term.axes.reshape(*term.axes.shape[:-2], 9), 9)
        struct.stiffness, struct.damping = memory.numbers(stiffness), memory.numbers(damping)
        struct.roughness = memory.numbers(term.friction)
        _set_frame(struct, term, memory)
    return struct


def _set_frame(struct: structs.Disturbance, term: FrameForce | Wall, memory: Memory) -> None:
    """Set the place where a force acts, and the arm whose kinematics it acts through."""
    struct.body, offset = frame_carrier(term.robot, term.frame)
    struct.offset[:] = offset.tolist()
    struct.arm = addressof(memory.keep((Arm * 1)(arm_struct(term.robot))))
