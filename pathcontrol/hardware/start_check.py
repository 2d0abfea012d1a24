"""The check of where an arm starts: within its position limits, and within a tube around its path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pathcontrol._arrays import Array, as_array
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.checks.position_range import describe_posture


def find_start_fault(robot: RobotModel, q: Array, lower: Array, upper: Array, away: float, tube: float) -> str:
    """Return the sentence on an arm at q (n,) from which no law is to start, or "".

    Args:
        robot: the arm.
        q: where it is [rad], (n,).
        lower: least q [rad], (n,).
        upper: largest q [rad], (n,).
        away: distance from the path [rad].
        tube: largest distance at which a law starts [rad]; inf for any.
    """
    outside = describe_posture("the arm has", robot, q, lower, upper)
    if not away <= tube:
        unit = name_units(robot.position_units)
        turned = f"; {outside}" if outside else ""
        return (
            f"the arm is {away:.3g} {unit} from the path, the tube is {tube:g} {unit}; bring it there, or widen "
            f"tube{turned}"
        )
    return outside if ((q < lower) | (q > upper)).any() else ""  # some joints may turn as often as they like


def name_units(units: Sequence[str]) -> str:
    """Return the unit of a distance of postures, ``"rad"``, ``"m"``, or ``"rad and m"`` of joints of both kinds."""
    return " and ".join(unit for unit in ("rad", "m") if unit in units)


def read_tube(value: Any) -> float:
    """Return a distance from the path [rad], inf for any.

    Raises:
        InputError: it is not one number greater than 0.
    """
    tube = as_array("tube", value)
    if tube.ndim or not tube > 0:
        raise InputError(
            f"tube = {value!r}, expected a distance greater than 0 [rad], inf for none", argument="tube", value=value
        )
    return float(tube)
