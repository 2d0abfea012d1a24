"""Control laws whose gains mean the same, for one arm and one task."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from types import MappingProxyType
from typing import Any

import numpy as np

from pathcontrol._expect import did_you_mean
from pathcontrol.comparison.family import FAMILY
from pathcontrol.comparison.shared_gains import Gains, mean_inertia, mean_plan_gain, sample_task, split_damping
from pathcontrol.control.adaptive_slotine_li import AdaptiveSlotineLi
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.gains import diagonal_gain
from pathcontrol.control.maneuver_regulation import ManeuverRegulation
from pathcontrol.control.motion_control import ComputedTorque, PDPlus, SlotineLi
from pathcontrol.control.passive_velocity_field import PassiveVelocityField
from pathcontrol.control.projection import Projection
from pathcontrol.control.state_to_reference import StateToReferenceProjection
from pathcontrol.control.transverse_linearization import TransverseLinearization
from pathcontrol.control.wrappers.event_plan import EventPlan
from pathcontrol.control.wrappers.paced import Paced
from pathcontrol.control.wrappers.wrapper import unwrap, wrappers_of
from pathcontrol.errors import InputError, UnknownNameError
from pathcontrol.registry import LAWS
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask

_SAME = 1e-9  # share of the size of a path up to which two are the same

Maker = Callable[[RobotModel, PathTask], Controller]
Law = str | Controller | Maker
Laws = Law | Iterable[Law] | Mapping[str, Law]
Options = Mapping[str, Any]
_NONE: Mapping[str, Law] = MappingProxyType({})


def _computed_torque(robot: RobotModel, task: PathTask, gains: Gains, options: Options) -> Controller:
    """Return computed torque."""
    return ComputedTorque(robot, task, gains.K_p, gains.K_v, **options)


def _pd_plus(robot: RobotModel, task: PathTask, gains: Gains, options: Options) -> Controller:
    """Return PD+ with gains times the diagonal of M at the mean posture."""
    mass = mean_inertia(robot, task)
    return PDPlus(robot, task, mass * np.asarray(gains.K_p), mass * np.asarray(gains.K_v), **options)


def _slotine_li(robot: RobotModel, task: PathTask, gains: Gains, options: Options) -> Controller:
    """Return Slotine and Li's law with the poles of the others at the mean posture, where it can have them."""
    Lambda, damping = split_damping(*(np.broadcast_to(gain, robot.n) for gain in gains[:2]))
    return SlotineLi(robot, task, Lambda, mean_inertia(robot, task) * damping, **options)


def _extended_motion_plan(robot: RobotModel, task: PathTask, gains: Gains, options: Options) -> Controller:
    """Return the extended motion plan."""
    k = mean_plan_gain(task) if gains.k is None else gains.k
    return ExtendedMotionPlan(robot, task, gains.K_p, gains.K_v, k, **options)


def _projection(robot: RobotModel, task: PathTask, gains: Gains, options: Options) -> Controller:
    """Return projection, whose position gain is one number: the mean of all joints."""
    return Projection(robot, task, float(np.asarray(gains.K_p).mean()), gains.K_v, **options)


_MAKERS = {
    "computed_torque": _computed_torque,
    "pd_plus": _pd_plus,
    "slotine_li": _slotine_li,
    "extended_motion_plan": _extended_motion_plan,
    "projection": _projection,
}
#: the laws that are compared where none are named
KNOWN_LAWS = tuple(_MAKERS)
#: the path laws with a plan that knows the torque limits
PACED_LAWS = ("paced_extended_motion_plan", "paced_projection")
#: the name of all of these and of :data:`FAMILY` together
ALL_LAWS = "all"
#: laws around these, compared where they are named, by the law inside and the wrapper
_WRAPPED: dict[str, tuple[str, type[EventPlan | Paced]]] = {
    "event_plan": ("extended_motion_plan", EventPlan),
    PACED_LAWS[0]: ("extended_motion_plan", Paced),
    PACED_LAWS[1]: ("projection", Paced),
}


def recover_gains(law: Controller) -> Gains:
    """Return the gains of one of the known laws as those that all share.

    Raises:
        InputError: it is another law, or its gains differ between rollouts.
    """
    law = unwrap(law)
    if isinstance(law, ExtendedMotionPlan):
        gains = Gains(law.K_p, law.K_v, float(law.k) if law.k.size == 1 else None)
    elif isinstance(law, ComputedTorque | StateToReferenceProjection | ManeuverRegulation):
        gains = Gains(law.K_p, law.K_v)
    elif isinstance(law, PDPlus):
        mass = mean_inertia(law.robot, law.task)
        gains = Gains(law.K_p / mass, law.K_v / mass)
    elif isinstance(law, SlotineLi | AdaptiveSlotineLi):
        damping = law.K_d / mean_inertia(law.robot, law.task)
        gains = Gains(law.Lambda * damping, law.Lambda + damping)
    elif isinstance(law, TransverseLinearization):
        gains = Gains(law.k_p, law.k_v)
    elif isinstance(law, PassiveVelocityField):
        gains = Gains(law.Lambda * law.K_v, law.Lambda + law.K_v)
    else:
        name = type(law).__name__
        raise InputError(
            f"the gains of {name} mean nothing to other laws; expected one of {', '.join(KNOWN_LAWS)}",
            value=name,
            choices=tuple(KNOWN_LAWS),
        )
    if max(np.ndim(gains.K_p), np.ndim(gains.K_v)) > 1:
        raise InputError(
            f"the gains of {type(law).__name__} differ between rollouts, expected one for all",
            argument="laws",
            value=law,
        )
    return gains


def make_laws(
    laws: Laws | None,
    robot: RobotModel,
    task: PathTask,
    gains: Gains,
    more: Mapping[str, Law] = _NONE,
    pattern: Controller | None = None,
) -> dict[str, Controller]:
    """Return control laws by name for one arm and one task, from names, laws, or functions of arm and task.

    On a closed path the known laws begin at the point that is nearest to the arm, on an open one at its begin. ``more``
    are laws that have names too, here only. The known laws compensate what the ``pattern`` compensates of friction,
    with its observer, and begin on an open path where it does; the one of its own kind is that law, and the wrappers
    of its kinds are its own.

    Raises:
        UnknownNameError: there is no law of that name.
        InputError: a law is for another arm or another task, or two have the same name.
    """
    for name in ("K_p", "K_v"):
        diagonal_gain(name, getattr(gains, name), robot.n, robot.joint_names)
    made: dict[str, Controller] = {}
    if laws is None:
        laws = list(dict.fromkeys([*KNOWN_LAWS, *more]))
    for name, law in _list_laws(laws, more):
        one = _make_law(law, robot, task, gains, more, pattern)
        key = name or (law if isinstance(law, str) else type(one).__name__)
        if key in made:
            advice = "name it once" if isinstance(law, str) else "give them names: {'first': …, 'second': …}"
            raise InputError(f"two laws are called {key!r}; {advice}", argument="laws", value=key)
        made[key] = one
    if not made:
        known = ", ".join([*_MAKERS, *FAMILY, *_WRAPPED])
        raise InputError(f"there is no law to compare; expected some of {known}, or laws of your own", argument="laws")
    return made


def _list_laws(laws: Laws, more: Mapping[str, Law]) -> list[tuple[str, Law]]:
    """Return laws with their names, empty where none is given; in place of ``"all"`` all of them, with ``more``."""
    if isinstance(laws, Mapping):
        return [(str(name), law) for name, law in laws.items()]
    if isinstance(laws, str | Controller) or callable(laws):
        laws = [laws]
    try:
        given = list(laws)
    except TypeError as error:
        raise InputError(
            f"laws = {laws!r:.80}, expected names, control laws, or a table of them by name",
            argument="laws",
            value=laws,
        ) from error
    names = [law for law in given if isinstance(law, str)]
    rest = [name for name in dict.fromkeys([*KNOWN_LAWS, *FAMILY, *more]) if name not in names]
    listed = [rest if isinstance(law, str) and law == ALL_LAWS else [law] for law in given]
    return [("", law) for several in listed for law in several]


def _make_law(
    law: Law, robot: RobotModel, task: PathTask, gains: Gains, more: Mapping[str, Law], pattern: Controller | None
) -> Controller:
    """Return one law."""
    if isinstance(law, str) and law in more:
        law = more[law]
    if isinstance(law, str):
        makers = _MAKERS | FAMILY
        if law not in makers | _WRAPPED:
            known = list(dict.fromkeys([*makers, *_WRAPPED, *more, ALL_LAWS]))
            choices = ", ".join(known)
            raise UnknownNameError(
                f"there is no law {law!r}, expected one of {choices}{did_you_mean(law, known)}",
                argument="laws",
                value=law,
                choices=tuple(known),
            )
        name, wrapper = _WRAPPED.get(law, (law, None))
        inside, options = _make_like(pattern, name), _options_of(pattern, task)
        made = makers[name](robot, task, gains, options) if inside is None else inside
        return made if wrapper is None else _wrap_like(pattern, wrapper, made)
    made = _call(law, robot, task) if callable(law) else law
    check_controller("laws", made)
    if made.robot.joint_names != robot.joint_names:
        raise InputError(
            f"{type(made).__name__} is for the joints {made.robot.joint_names}, not {robot.joint_names}",
            argument="laws",
            value=list(made.robot.joint_names),
        )
    if not _is_same(made.task, task):
        raise InputError(
            f"{type(made).__name__} is for another task than the scenario; make it with scenario.task",
            argument="laws",
            value=made,
        )
    return made


def _options_of(pattern: Controller | None, task: PathTask) -> dict[str, Any]:
    """Return the arguments that all laws have from the ``pattern``; on a closed path all begin where they are."""
    start = "nearest" if task.closed else "s0"
    if pattern is None:
        return {"start": start}
    inside = unwrap(pattern)
    start = "nearest" if task.closed else inside.start_at
    return {"friction": inside.friction, "observer_hz": inside.observer_hz, "start": start}


def _make_like(pattern: Controller | None, name: str) -> Controller | None:
    """Return the law inside the ``pattern`` with the start of all, where it is of the kind of a ``name``, else none."""
    if pattern is None or type(unwrap(pattern)) is not LAWS.find(name):
        return None
    wrappers = wrappers_of(pattern)
    law = copy(wrappers[-1].wrapped if wrappers else pattern)  # as it was given, without what a wrapper made of it
    law.start_at = _options_of(pattern, law.task)["start"]
    return law


def _wrap_like(pattern: Controller | None, wrapper: type[EventPlan | Paced], law: Controller) -> Controller:
    """Return a wrapper around a law, with the settings of the one of its kind around the ``pattern``."""
    found = [] if pattern is None else [one for one in wrappers_of(pattern) if type(one) is wrapper]
    return found[0].around(law) if found else wrapper(law)


def _call(make: Maker, robot: RobotModel, task: PathTask) -> Controller:
    """Return the law that a function makes; tell a class that needs more than arm and task."""
    try:
        return make(robot, task)
    except TypeError as error:
        if not isinstance(make, type):
            raise
        raise InputError(
            f"{make.__name__}(robot, task) makes no law: {error}; give a law, or a function of robot and task",
            argument="laws",
            value=make.__name__,
        ) from error


def _is_same(one: PathTask, other: PathTask) -> bool:
    """Return whether two tasks lead along the same path at the same speed."""
    if one is other:
        return True
    if one.closed != other.closed or one.s0 != other.s0 or not np.array_equal(one.s_end, other.s_end):
        return False
    s = sample_task(other)
    pairs = [(one.q_d(s), other.q_d(s)), (one.theta(s), other.theta(s))]
    return all(np.allclose(a, b, rtol=0, atol=_SAME * np.abs(b).max()) for a, b in pairs)
