"""What a run was made with, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pathcontrol.simulation.config import laws, table
from pathcontrol.view.animation.rollout import Take

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


def settings(take: Take) -> dict[str, str]:
    """Robot, controller, gains, plant, loop, duration and versions of a run, by their names."""
    config = take.run.config
    chosen = {name: value for name, value in laws(config)[0].items() if name not in _ELSEWHERE}
    versions = ", ".join(f"{name} {number}" for name, number in table(config, "versions").items())
    found: dict[str, Any] = {
        "robot": take.robot.name,
        "controller": table(config, "controller").get("controller"),
        "task": None if take.task is None else table({"of": take.task.describe()}, "of").get("task"),
        **{_NAMES.get(name, name): value for name, value in chosen.items()},
        "friction of the plant": _friction(table(config, "plant")),
        **{_NAMES.get(name, name): value for name, value in table(config, "loop").items()},
        "duration": f"{take.duration:g} s, {len(take.time)} samples",
        "rollout": f"{_rollout(take)} of {take.rollouts}" if take.rollouts > 1 else None,
        "versions": versions or None,
    }
    return {name: _words(value) for name, value in found.items() if value is not None}


def _rollout(take: Take) -> int:
    return int(take.run.array("rollout")[0])


def _friction(plant: Mapping[str, Any]) -> str | None:
    """Names of the laws that the friction law of the plant is made of."""
    law = table(plant, "friction")
    terms = law["terms"] if isinstance(law.get("terms"), list) else [law]
    names = [str(term.get("law", "")) for term in terms if isinstance(term, Mapping)]
    return " + ".join(name for name in names if name) or None


def _words(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    return str(value)
