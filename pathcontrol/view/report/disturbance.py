"""The disturbance of a run as Python that makes it again from its description."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pathcontrol.simulation.run import Run
from pathcontrol.simulation.summaries import is_whole
from pathcontrol.view.report.code import call

#: the arguments of the disturbances of this package, and how many axes each has for a single rollout
_ARGUMENTS: dict[str, dict[str, int | None]] = {
    "Push": {"magnitude": 1, "start": 0, "duration": 0},
    "Harmonic": {"amplitude": 1, "frequency": 0, "phase": 0},
    "FrameForce": {"frame": None, "force": 1, "start": 0, "duration": 0},
}
_DEEPEST = 20  # sums in one another


def disturbance_code(described: Any, run: Run, depth: int = 0) -> str | None:
    """Return the expression for a disturbance of this package, or a sum of them; ``None`` for any other one.

    Sums are put into brackets as they were made, since floating-point numbers do not add up in any order.

    Args:
        described: what :meth:`Disturbance.describe` gave.
        run: whose it is; in a script it is called ``saved``.
        depth: in how many sums it stands.
    """
    if not isinstance(described, Mapping) or not is_whole(described) or depth > _DEEPEST:
        return None
    kind, terms = described.get("disturbance"), described.get("terms")
    if kind == "sum" and isinstance(terms, list) and len(terms) > 1:
        codes = [disturbance_code(term, run, depth + 1) for term in terms]
        if None in codes:
            return None
        added = " + ".join(str(code) for code in codes)
        return f"({added})" if depth else added
    return _term(str(kind), described, run)


def _term(kind: str, described: Mapping[str, Any], run: Run) -> str | None:
    """One disturbance, whose arguments have the axes that they should have."""
    axes = _ARGUMENTS.get(kind, {})
    arm = _arm(described.get("robot"), run) if kind == "FrameForce" else None
    if not axes or not all(_fits(described.get(name), most, run.rollouts) for name, most in axes.items()):
        return None
    if kind == "FrameForce" and arm is None:
        return None
    return call(f"pc.{kind}", [] if arm is None else [arm], {name: described[name] for name in axes})


def _arm(name: Any, run: Run) -> str | None:
    """The arm whose kinematics a force has, by its name."""
    known = {run.model.name: "saved.model", run.robot.name: "saved.robot"}
    return known.get(name) if isinstance(name, str) else None


def _fits(value: Any, axes: int | None, rollouts: int) -> bool:
    """Whether a value has so many axes, or one more for the rollouts; without axes it is a text."""
    if axes is None:
        return isinstance(value, str)
    if not isinstance(value, list):
        return axes == 0 and isinstance(value, int | float)
    if axes == 0 or (value and isinstance(value[0], list)):
        return len(value) in (1, rollouts) and all(_fits(row, axes, 1) and _axes(row) == axes for row in value)
    return all(_axes(number) == 0 and isinstance(number, int | float) for number in value)


def _axes(value: Any) -> int:
    """How many lists stand in one another, by the first of each."""
    return 1 + _axes(value[0]) if isinstance(value, list) and value else int(isinstance(value, list))
