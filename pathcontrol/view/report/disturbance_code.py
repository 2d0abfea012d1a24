"""The Python code of a run's disturbance, from its description."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pathcontrol.arguments import Form, Parameter, parameters_of
from pathcontrol.registry import DISTURBANCES
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.summaries import is_whole
from pathcontrol.view.report.code import Code, call, class_code

#: axes of a value for a single rollout
_AXES = {Form.NUMBERS: 1, Form.GAIN: 1, Form.NUMBER: 0, Form.POSITIVE: 0, Form.POSITIVE_OR_INF: 0}
_DEEPEST = 20  # sums in one another


def disturbance_code(described: Any, run: Run, depth: int = 0) -> Code | None:
    """Return the code of a disturbance or a sum; ``None`` if its description is not complete.

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
        codes = [code for term in terms if (code := disturbance_code(term, run, depth + 1))]
        added = " + ".join(code.text for code in codes)
        imports = tuple(dict.fromkeys(line for code in codes for line in code.imports))
        return Code(f"({added})" if depth else added, imports) if len(codes) == len(terms) else None
    return _term(kind, described, run)


def _term(kind: Any, described: Mapping[str, Any], run: Run) -> Code | None:
    """Return the code of one disturbance, whose arguments have the right axes."""
    found = class_code(DISTURBANCES, kind, described)
    if found is None:
        return None
    known = parameters_of(DISTURBANCES.find(kind)).items()
    parameters = {name: one for name, one in known if one.default is not None or described.get(name) is not None}
    arm = _arm(described.get("robot"), run) if parameters.pop("robot", None) else ""
    if arm is None or not all(_is_argument(one, described.get(name), run) for name, one in parameters.items()):
        return None
    return Code(call(found[0], [arm] if arm else [], {name: described[name] for name in parameters}), found[1:])


def _is_argument(parameter: Parameter, value: Any, run: Run) -> bool:
    """Return whether a value has the axes that a parameter states, or any where it states none."""
    if parameter.form is Form.JOINT:  # one, or one for each rollout
        names = value if isinstance(value, list) else [value]
        return all(isinstance(one, str | int) for one in names) and (names is not value or len(value) == run.rollouts)
    if parameter.form is None:
        return str not in parameter.types or isinstance(value, str)
    if parameter.form is Form.GAIN and not isinstance(value, list):  # one number for all joints
        return isinstance(value, int | float)
    return _fits(value, _AXES[parameter.form], run.rollouts)


def _arm(name: Any, run: Run) -> str | None:
    """Return the arm whose kinematics a force has, by its name."""
    known = {run.model.name: "saved.model", run.robot.name: "saved.robot"}
    return known.get(name) if isinstance(name, str) else None


def _fits(value: Any, axes: int, rollouts: int) -> bool:
    """Return whether a value has the number of axes, or one more for the rollouts."""
    if not isinstance(value, list):
        return axes == 0 and isinstance(value, int | float)
    if axes == 0 or (value and isinstance(value[0], list)):
        return len(value) in (1, rollouts) and all(_fits(row, axes, 1) and _axes(row) == axes for row in value)
    return all(_axes(number) == 0 and isinstance(number, int | float) for number in value)


def _axes(value: Any) -> int:
    """Return the depth of nested lists, by the first of each."""
    return 1 + _axes(value[0]) if isinstance(value, list) and value else int(isinstance(value, list))
