"""From an experiment file to a scenario, in which its law is replaced by each of a comparison."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pathcontrol.comparison.laws import recover_gains
from pathcontrol.comparison.scenarios import Scenario
from pathcontrol.errors import ExperimentError, InputError
from pathcontrol.experiments.builders.setup import Setup
from pathcontrol.experiments.runner import load_setup
from pathcontrol.simulation.arm.disturbance import Disturbance, TimedDisturbance, list_terms
from pathcontrol.tasks.joined.path_sequence import PathSequence


def load_scenario(path: str | Path) -> Scenario:
    """Return the scenario that an experiment file describes; all laws share the gains of its ``[controller]``.

    What happens in it are its disturbances; the event lasts from the first begin to the last end of those that have
    them. It is compared with the same without them. ``laps`` and ``until`` are not used: all laws have as long.

    Raises:
        ExperimentError: the file is invalid, follows a sequence of paths, or its law is one of your own.
    """
    setup, path = load_setup(path), Path(path)
    if isinstance(setup.task, PathSequence):
        raise ExperimentError(f"{str(path)!r} follows a sequence of paths; laws are compared on a single path")
    try:
        gains = recover_gains(setup.controller)
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
            event=find_event(setup.disturbance, float(setup.duration)),
            gains=gains,
            engine=setup.engine,
        )
    except InputError as error:
        raise ExperimentError(f"{str(path)!r} is no scenario for a comparison: {error}") from error
    calm = replace(scenario, disturbance=None)
    return scenario if setup.disturbance is None else replace(scenario, undisturbed=calm)


def find_event(disturbance: Disturbance | None, duration: float) -> tuple[float, float] | None:
    """Return from when to when the timed ones of some disturbances act [s], ``None`` without one.

    An event lasts until the end of the run, ``duration`` [s], where one of them does, or another one has no time.
    """
    terms = list_terms(disturbance)
    timed = [term for term in terms if isinstance(term, TimedDisturbance)]
    if not timed:
        return None
    begin = max(0.0, min(float(np.min(term.start)) for term in timed))
    end = max(float(np.max(term.start + term.duration)) for term in timed)
    return (begin, duration if len(timed) < len(terms) else min(end, duration))


def _describe(setup: Setup) -> str:
    """Return what happens in an experiment in one sentence."""
    kinds = [type(term).__name__ for term in list_terms(setup.disturbance)]
    return f"The experiment of the file{f', with {chr(32).join(kinds)}' if kinds else ', undisturbed'}."
