"""The knowledge that a law has of the dry friction of its arm, beside what the arm has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.errors import warn
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import FrictionLaw, levels_of
from pathcontrol.simulation.loops import Arm

_SHORT = 0.99  # of the level of the arm, below which a model does not know it
_GIVE = (
    "give the model its friction, by load_robot(…, friction=…) or in [robot] of a file, or the controller "
    'friction="observed"'
)


def dry_level(law: FrictionLaw) -> Array:
    """Return the larger one of the two levels of dry friction at rest [N m], (n,), of several arms the largest."""
    level = np.maximum(*levels_of(law, np.zeros(law.n)))
    return np.asarray(level.reshape(-1, law.n).max(0) if level.ndim else np.full(law.n, level))


def advise_on_dry_friction(modes: Sequence[str], model: FrictionLaw, arm: FrictionLaw) -> str:
    """Return why the dry friction of an ``arm`` holds it, and what helps; "" where its laws compensate it.

    Args:
        modes: what the laws compensate, their ``friction``.
        model: the friction of the law's model.
        arm: that of the arm.
    """
    known, has = dry_level(model), dry_level(arm)
    if not (has > 0).any() or "observed" in modes:
        return ""
    if "full" not in modes and (known > 0).any():
        return 'dry friction that the law does not compensate holds it; give the controller friction="full"'
    if "full" not in modes:
        return f"dry friction that the law does not compensate holds it, nor does its model know any; {_GIVE}"
    if (known >= _SHORT * has).all():
        return ""
    i = int((has - known).argmax())
    return (
        f"dry friction that the law's model does not know holds it: joint {i + 1} has {has[i]:.3g} N m, its model "
        f"{known[i]:.3g} N m; {_GIVE}"
    )


def warn_of_unknown_friction(controllers: Sequence[Controller], robot: Arm, first: int = 0) -> None:
    """Warn of laws that are to compensate all friction by models without dry friction, of an arm that has some."""
    arm = robot.robots[0] if isinstance(robot, RobotBatch) else robot
    if first or not (dry_level(arm.friction) > 0).any():
        return
    if any(law.friction == "full" and not (dry_level(law.robot.friction) > 0).any() for law in controllers):
        warn(
            'friction="full" compensates what the model of the law knows, which has no dry friction while the arm has '
            f"some; {_GIVE}"
        )
