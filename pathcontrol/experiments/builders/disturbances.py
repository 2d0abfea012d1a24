"""The disturbances of the simulated arm, made of ``[disturbance]``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, parameters_of
from pathcontrol.experiments.builders.file_errors import report_users_code
from pathcontrol.experiments.builders.making import Place, arguments_of, make
from pathcontrol.experiments.schema.derived import OwnSection
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.registry import DISTURBANCES
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Disturbance, check_disturbance

_ARGUMENT = re.compile(r"disturbance(?:\[(\d+)\])?\.(\w+)(?:\[\d+\])*")
_NUMBERS = (Form.NUMBER, Form.NUMBERS, Form.POSITIVE, Form.POSITIVE_OR_INF, Form.GAIN)


def build_disturbance(
    experiments: Sequence[Experiment], plant: RobotModel, q: Array, qd: Array, place: Place
) -> Disturbance | None:
    """Return the sum of all that a file says, which has been tried once.

    Args:
        experiments: one, or one for each rollout, that differ in arguments of which :func:`varies_together` is true.
        plant: the arm that is pushed.
        q: joint positions at the start [rad], (N, n).
        qd: joint velocities at the start [rad/s], (N, n).
        place: where the file is, and its angles.

    Raises:
        ExperimentError: one cannot be made, or gives no torques for the arm.
    """
    made: list[Disturbance] = []
    for i, sections in enumerate(zip(*map(_list_sections, experiments), strict=True)):
        key = f"disturbance[{i}]" if isinstance(experiments[0].disturbance, list) else "disturbance"
        values = [arguments_of(key, section, DISTURBANCES, place) for section in sections]
        differ = {name for one in values for name in one if one[name] != values[0].get(name)}
        rows = {name: _stack(type(sections[0]), name, [one[name] for one in values]) for name in differ}
        one: Disturbance = make(key, sections[0], DISTURBANCES, place, {"robot": plant}, rows)
        with report_users_code(key, f"{type(one).__name__} at the start"):
            check_disturbance(one.find_names(plant), q, qd)
        made.append(one)
    return reduce(add, made) if made else None


def _stack(section: Any, name: str, values: list[Any]) -> Array:
    """Return values with a row for each rollout; a number in the place of one for each joint is a row too."""
    rows = np.array(values)
    per_joint = not issubclass(section, OwnSection) and parameters_of(section.target)[name].form is Form.GAIN
    return rows[:, None] if per_joint and rows.ndim == 1 else rows


def varies_together(key: str, experiment: Experiment) -> bool:
    """Return whether a key sets numbers of a disturbance of the library, which may differ between rollouts."""
    match = _ARGUMENT.fullmatch(key)
    if match is None or isinstance(section := _list_sections(experiment)[int(match[1] or 0)], OwnSection):
        return False
    target = type(section).target
    return DISTURBANCES.has(target.__name__) and parameters_of(target)[match[2]].form in _NUMBERS


def _list_sections(experiment: Experiment) -> list[Any]:
    given = experiment.disturbance
    return given if isinstance(given, list) else [] if given is None else [given]
