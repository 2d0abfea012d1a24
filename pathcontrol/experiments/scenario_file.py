"""The scenario of an experiment file, in which each law of a comparison takes the place of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pathcontrol.comparison.family import FAMILY
from pathcontrol.comparison.laws import recover_gains
from pathcontrol.comparison.scenarios import Scenario
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.speed_override import SpeedOverride
from pathcontrol.control.wrappers.wrapper import LawWrapper, unwrap, wrappers_of
from pathcontrol.errors import ExperimentError, InputError, warn
from pathcontrol.experiments.builders.setup import Setup
from pathcontrol.experiments.load import read_toml
from pathcontrol.experiments.runner import load_setup
from pathcontrol.registry import LAWS
from pathcontrol.simulation.arm.disturbance import list_terms
from pathcontrol.tasks.joined.path_sequence import PathSequence


def load_scenario(path: str | Path) -> Scenario:
    """Return the scenario that an experiment file describes; all laws share the gains of its ``[controller]``.

    All have its ``friction`` and ``observer_hz``, and on an open path its ``start``; on a closed one they begin at the
    point nearest to the arm, and a warning says so where the file has another start, or an arm that moves at first.
    The file's law itself is among them as it is, with all its other arguments.

    What happens in it are its disturbances and its speed override, which all laws have; the event lasts from the first
    begin to the last end of those that have them. It is compared with the same without them. ``laps`` and ``until`` are
    not used: all laws have as long. Another wrapper of the file's law, such as :class:`Paced`, is a part of that law:
    the others are compared without it, which a warning says; named with it, they have it with its settings.

    Raises:
        ExperimentError: the file is invalid, follows a sequence of paths, its law is one of your own, or overridden
            twice.
    """
    setup, path = load_setup(path), Path(path)
    if isinstance(setup.task, PathSequence):
        raise ExperimentError(
            f"{str(path)!r} follows a sequence of paths; laws are compared on a single path", file=str(path)
        )
    try:
        gains, operator = recover_gains(setup.controller), _find_override(setup.controller)
        scenario = Scenario(
            name=path.stem,
            sentence=_describe(setup),
            robot=setup.controller.robot,
            task=setup.task,
            q=setup.q,
            duration=float(setup.duration),
            loop=setup.loop,
            plant=setup.plant,
            disturbance=setup.disturbance,
            gains=gains,
            engine=setup.engine,
            laws=_name_law(setup.controller),
            pattern=setup.controller,
            **operator,
        )
    except InputError as error:
        raise ExperimentError(
            f"{str(path)!r} is no scenario for a comparison: {error}", **error.details_with(file=str(path))
        ) from error
    _warn_of_wrappers(setup.controller, path)
    _warn_of_start(setup, path)
    return scenario


def _find_override(law: Controller) -> dict[str, Any]:
    """Return ``override`` and ``acceleration`` of the speed override around a law, nothing where none changes it.

    Raises:
        InputError: there are two of them.
    """
    found = [one.arguments() for one in wrappers_of(law) if isinstance(one, SpeedOverride)]
    if len(found) > 1:
        raise InputError("its law has two speed overrides around each other, expected one; make one input of them")
    if not found:
        return {}
    u = np.asarray(found[0]["override"])
    if not np.any((u[:, 1] if u.ndim == 2 else u) != 1.0):
        return {}
    return found[0] | {"override": u.item() if u.size == 1 else u.tolist()}


def _warn_of_wrappers(law: Controller, path: Path) -> None:
    """Warn of wrappers that the laws of a comparison do not have."""
    left = [type(one).__name__ for one in wrappers_of(law) if type(one) not in (SpeedOverride, LawWrapper)]
    if left:
        warn(
            f"the law of {str(path)!r} is {' of '.join(left)}, which is no part of the scenario: the laws are compared "
            "without it; name those that have it, such as paced_projection, paced_extended_motion_plan or event_plan, "
            "or give compare a law of your own"
        )


def _warn_of_start(setup: Setup, path: Path) -> None:
    """Warn of what a file says of the start that the laws of a comparison do not do."""
    section: Any = read_toml(path).get("controller", {})
    while isinstance(section.get("law"), dict):
        section = section["law"]
    if section.get("start") == "s0" and setup.task.closed:
        warn(
            f"the law of {str(path)!r} has start = 's0', which the laws of a comparison have on an open path only: on "
            "this closed one all begin at the point nearest to the arm, as their starts lie all around it"
        )
    if np.any(setup.qd):
        warn(
            f"{str(path)!r} has start.qd = {setup.qd.tolist()} rad/s, but in a comparison all arms begin at rest; use "
            "simulate for each law to begin in motion"
        )


def _name_law(law: Controller) -> dict[str, str]:
    """Return the name of the law inside, which is compared beside the known ones where it is none of them."""
    return {name: name for name in FAMILY if LAWS.find(name) is type(unwrap(law))}


def _describe(setup: Setup) -> str:
    """Return what happens in an experiment in one sentence."""
    kinds = [type(term).__name__ for term in list_terms(setup.disturbance)]
    kinds += ["SpeedOverride"] if _find_override(setup.controller) else []
    what = f"with {' and '.join(kinds)}" if kinds else "undisturbed"
    friction = setup.controller.friction
    known = "" if friction == "viscous" else f"; all laws have friction = {friction!r}"
    return f"The experiment of the file, {what}{known}."
