"""The settings of a run, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pathcontrol.simulation.config import laws, table
from pathcontrol.view.animation.rollout import Recording

_NAMES = {
    "friction": "friction compensation",
    "start": "s starts at",
    "encoders": "encoders",
    "velocity": "measured velocity",
    "filter_hz": "velocity filter [Hz]",
    "torque_limits": "torque limits [N m]",
    "period": "control period [s]",
    "output_period": "time between samples [s]",
    "delay": "delay [s]",
}
_ELSEWHERE = {"controller", "robot", "task", "sequence"}


def settings(recording: Recording) -> dict[str, str]:
    """Return robot, controller, gains, plant, loop, duration and versions of a run, by their names."""
    config = recording.run.config
    chosen = {name: value for name, value in laws(config)[0].items() if name not in _ELSEWHERE}
    versions = ", ".join(f"{name} {number}" for name, number in table(config, "versions").items())
    found: dict[str, Any] = {
        "robot": recording.robot.name,
        "controller": table(config, "controller").get("controller"),
        "task": None if recording.task is None else table({"of": recording.task.describe()}, "of").get("task"),
        **{_NAMES.get(name, name): value for name, value in chosen.items()},
        "friction of the plant": _friction(table(config, "plant")),
        **{_NAMES.get(name, name): value for name, value in table(config, "loop").items()},
        "duration": f"{recording.duration:g} s, {len(recording.time)} samples",
        "rollout": f"{_rollout(recording)} of {recording.rollouts}" if recording.rollouts > 1 else None,
        "versions": versions or None,
    }
    return {name: _words(value) for name, value in found.items() if value is not None}


def _rollout(recording: Recording) -> int:
    """Return the number of the rollout."""
    return int(recording.run.array("rollout")[0])


def _friction(plant: Mapping[str, Any]) -> str | None:
    """Return the names of the laws that the friction of the plant consists of."""
    law = table(plant, "friction")
    terms = law["terms"] if isinstance(law.get("terms"), list) else [law]
    names = [str(term.get("law", "")) for term in terms if isinstance(term, Mapping)]
    return " + ".join(name for name in names if name) or None


def _words(value: Any) -> str:
    """Return a value in words."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    return str(value)
