"""The gains of a law by the names of its arguments, and the law with others in their place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._expect import did_you_mean
from pathcontrol.arguments import gains_of, parameters_of
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.wrapper import LawWrapper, unwrap
from pathcontrol.errors import InputError, UnknownNameError

_NUMBERS = ("k", "recharge", "energy", "approach")  # gains that are one number for a rollout, (N,) for several


def gains_of_law(law: Controller) -> dict[str, Any]:
    """Return the gains of a law by the names of its arguments; of a wrapper those of the law inside.

    ``observer_hz`` is one where the law has an observer whose estimate it compensates.
    """
    inner = unwrap(law)
    names = dict.fromkeys([*gains_of(type(inner)), *inner.gains])
    found = {name: getattr(inner, name, None) for name in names}
    return {name: value for name, value in found.items() if value is not None}


def single_gain(law: Controller, name: str) -> float | None:
    """Return the gain of a law as one number, or ``None`` where it differs between joints.

    Raises:
        UnknownNameError: the law has no such gain.
    """
    value = np.unique(_find(law, name))
    return float(value[0]) if len(value) == 1 else None


def largest_entry(law: Controller, name: str) -> float:
    """Return the largest number of a gain of a law."""
    return float(np.max(_find(law, name)))


def refuse_several_gains(law: Controller) -> None:
    """Check that a law has one set of gains.

    Raises:
        InputError: a gain, the observer or a rule of a wrapper has a row for each of several rollouts.
    """
    if isinstance(law, LawWrapper) and (rows := max(rule.count_rows() for rule in law.rules)) > 1:
        raise InputError(f"{type(law).__name__} has settings of {rows} rollouts, expected those of one", value=rows)
    inner = unwrap(law)
    if law.observer is not None and law.observer.gain.ndim > 1:
        rows = len(law.observer.gain)
        raise InputError(
            f"observer_hz has rows for {rows} rollouts, expected one value, or one for each joint",
            argument="observer_hz",
            value=law.observer.gain,
        )
    for name in inner.gains:
        shape = np.shape(getattr(inner, name))
        rows = len(shape) > 1 or name in _NUMBERS or shape[:1] != (law.robot.n,)
        if rows and shape and shape[0] > 1:
            raise InputError(
                f"{name} has the gains of several rollouts, {shape}, expected those of one, ({law.robot.n},)",
                argument=name,
                value=getattr(inner, name),
            )


def count_gain_rows(law: Controller) -> dict[str, int]:
    """Return how many rollouts a gain of a law has a row for, of those gains that have several, by their names."""
    inner = unwrap(law)
    rows: dict[str, int] = {}
    for name in inner.gains:
        gain: Any = getattr(inner, name, None)
        shape = np.shape(gain)
        if (len(shape) == 2 or (len(shape) == 1 and name in _NUMBERS)) and shape[0] > 1:
            rows[name] = shape[0]
    return rows


def unit_of_gain(law: Controller, name: str) -> str:
    """Return the unit of a gain, for joints that turn; empty where the law does not say it."""
    unit = parameters_of(type(unwrap(law)))[name].unit if name in parameters_of(type(unwrap(law))) else None
    return unit.names[0] if unit is not None else ""


def with_gains(law: Controller, gains: Mapping[str, ArrayLike]) -> Controller:
    """Return the law with other ``gains``, made anew by its constructor from what :meth:`Controller.describe` says.

    An argument that is not described is taken from the attribute of the same name. A wrapper is put around the law
    inside with its new gains.

    Args:
        law: the law.
        gains: the gains to change, in any form that the constructor takes, also with rows for several rollouts.

    Raises:
        UnknownNameError: the law has no such gain.
        InputError: a gain has a value that the law refuses, or an argument of the law is kept nowhere.
    """
    for name in gains:
        _find(law, name)
    if isinstance(law, LawWrapper):
        return law.around(with_gains(law.wrapped, gains))
    kept: dict[str, Any] = {**law.describe(), "robot": law.robot, "task": law.task, **gains}
    arguments: dict[str, Any] = {name: kept.get(name, getattr(law, name, None)) for name in parameters_of(type(law))}
    needed = {name for name, one in parameters_of(type(law)).items() if one.required}
    if lost := [name for name in needed if arguments[name] is None]:
        raise InputError(
            f"{type(law).__name__} does not keep its argument {lost[0]!r}, so it cannot be made with other gains; "
            f"store it as self.{lost[0]}",
            argument=lost[0],
        )
    return type(law)(**{name: value for name, value in arguments.items() if name in needed or value is not None})


def _find(law: Controller, name: str) -> Any:
    """Return a gain of a law."""
    known = gains_of_law(law)
    if name not in known:
        of = type(unwrap(law)).__name__
        if not known:
            raise UnknownNameError(f"{of} has no gain {name!r}, as it names none: set {of}.gains", value=name)
        raise UnknownNameError(
            f"{of} has no gain {name!r}, expected one of {', '.join(known)}{did_you_mean(name, known)}",
            argument=name,
            choices=tuple(known),
            value=name,
        )
    return known[name]
