"""A check of the kind of an argument, whose error says what was given, what was expected and what to call."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import Any

from pathcontrol.errors import InputError, PathControlError, UnknownNameError

_LONGEST = 80

#: how one gets an instance, by the name of its class: the kinds of things that calls of this package pass around
_SOURCES = {
    "RobotModel": "load_robot(NAME or FILE) gives one",
    "PathTask": "Circle(radius, speed) and the other tasks, or a subclass of your own, are some",
    "VelocityProfile": "ConstantSpeed(speed), ConstantRate(rate) and the other profiles are some",
    "Controller": "Projection(robot, task, k_p, K_v) and the other control laws are some",
    "ControlLoop": "ControlLoop(law, period) makes one",
    "Envelope": "Envelope(torque=…, velocity=…) makes one",
    "Run": "simulate(controller, q, duration=…) gives one, and Run.load(FILE)",
    "Figure": "path_figure(run), error_figure(run) and the other figures are some",
    "Animation": "record(run) gives one",
    "Toolpath": "read_toolpath(FILE) gives one",
    "ToolpathTask": "ToolpathTask(robot, frame, toolpath) makes one",
    "Contour": "those of a toolpath are some: toolpath.contours",
    "MotionLimit": "MotionLimit(ToolMotion(robot, frame), speed) makes one",
    "Space": "Space.grid(…) and Space.random(…) make one",
    "SweepResult": "sweep(…) gives one, and SweepResult(FOLDER)",
    "Comparison": "compare(laws, scenario) gives one",
    "Scenario": "make_scenario(NAME) gives one, and load_scenario(FILE)",
    "StabilityMap": "stability_map(law, gains) gives one",
}
#: what to write instead, by what was given and what was expected
_INSTEAD = {
    ("text", "RobotModel"): "load_robot({value!r}) gives one",
    ("text", "Run"): "Run.load({value!r}) gives one",
    ("text", "Toolpath"): "read_toolpath({value!r}) gives one",
    ("text", "Scenario"): "load_scenario({value!r}) makes one of an experiment file",
    ("text", "SweepResult"): "SweepResult({value!r}) gives one",
    ("Controller", "RobotModel"): "a control law has one: controller.robot",
    ("Controller", "PathTask"): "a control law has one: controller.task",
    ("Run", "RobotModel"): "a run has one: run.robot",
    ("Run", "PathTask"): "a run has one: run.task",
    ("Run", "Animation"): "record(run) gives one",
    ("SweepResult", "Run"): "sweep.histories() gives those that a sweep has kept",
    (
        "Comparison",
        "Run",
    ): "it has one for each law: compared.runs; scenario_figure(compared) shows them",
    ("Toolpath", "PathTask"): "ToolpathTask(robot, frame, toolpath) makes one",
    ("Animation", "Figure"): "an animation is written by its own save(FILE)",
}


def expect(name: str, value: Any, *kinds: type, error: type[PathControlError] = InputError, also: str = "") -> None:
    """Check that the argument ``name`` is of one of the ``kinds``, the usual one first; ``also`` says what else may be.

    Raises:
        PathControlError: it is not; of the class ``error``.
    """
    if isinstance(value, kinds):
        return
    given, wanted = _family(value), kinds[0].__name__
    advice = _INSTEAD.get((given, wanted), _SOURCES.get(wanted, "")).format(value=_text(value))
    if isinstance(value, type):
        advice = f"make an instance: {value.__name__}(…)" if issubclass(value, kinds) else advice
    if given in _SOURCES and given != wanted:
        advice += "; are arguments swapped?" if advice else "are arguments swapped?"
    raise error(
        f"{name} {describe(value)}, expected {_article(wanted)} {wanted}{also}" + (f": {advice}" if advice else ""),
        argument=name,
        value=value,
    )


def expect_choice(name: str, value: Any, choices: Sequence[str], also: str = "") -> None:
    """Check that the argument ``name`` is one of the ``choices``; ``also`` says what else may be.

    Raises:
        UnknownNameError: it is not.
    """
    if value not in choices:
        raise UnknownNameError(
            f"{name} = {value!r}, expected one of {', '.join(map(repr, choices))}{also}",
            argument=name,
            value=value,
            choices=tuple(choices),
        )


def describe(value: Any) -> str:
    """Return how an error describes a value after its name: ``= 'x'``, ``is a Circle, which is a PathTask``."""
    if isinstance(value, type):
        return f"is the class {value.__name__}"
    family, name = _family(value), type(value).__name__
    if family not in _SOURCES:
        return f"= {reprlib.repr(_text(value))[:_LONGEST]}"
    return f"is {_article(name)} {name}" + ("" if family == name else f", which is {_article(family)} {family}")


def did_you_mean(word: Any, choices: Iterable[str]) -> str:
    """Return ``; did you mean …?`` with the choice closest to ``word``, or an empty text."""
    nearest = nearest_choice(word, choices)
    return f"; did you mean {nearest!r}?" if nearest else ""


def nearest_choice(word: Any, choices: Iterable[str]) -> str:
    """Return the choice closest to ``word``, or an empty text where none is near."""
    import difflib  # only where something is wrong

    by_lower = {choice.lower(): choice for choice in choices}
    found = difflib.get_close_matches(str(word)[:80].lower(), by_lower, n=1, cutoff=0.6)
    return by_lower[found[0]] if found else ""


def _article(word: str) -> str:
    """Return ``a`` or ``an``."""
    return "an" if word[0] in "AEIO" else "a"


def _family(value: Any) -> str:
    """Return the key of a value in the tables above, or an empty text."""
    if isinstance(value, str | PathLike):
        return "text"
    return next((kind.__name__ for kind in type(value).__mro__ if kind.__name__ in _SOURCES), "")


def _text(value: Any) -> Any:
    """Return a path as text, and any other value as it is."""
    return str(value) if isinstance(value, PathLike) else value
