"""Joints that jam: held still for a while, and let go."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Begin, Span, TimedDisturbance, check_rollouts

Joint = Annotated[str | int | Sequence[str | int], Form.JOINT]


class JammedJoint(TimedDisturbance):
    """A joint that is held exactly where it is for a while, by whatever torque that takes, and then let go.

    Where it moves when it jams, it stops at once. The impulse of that acts on the jammed joint alone, so the momenta
    (Mq̇)_i of all other joints stay what they were. In the sampled loop a joint is held in the steps of the plant whose
    middle the time covers; its encoder and its motor go on as ever. Continuous time does not know it.

    Args:
        joint: name or number of the joint, from 0, or one for each rollout, (N,). Joints that jam together are a sum.
        start: when it jams [s], or for each rollout, (N,).
        duration: how long it is held [s], or for each rollout, (N,).

    Raises:
        InputError: ``joint`` is neither, or a time is no number.
    """

    def __init__(self, joint: Joint, start: Begin = 0.0, duration: Span = np.inf) -> None:
        super().__init__(start, duration)
        names = np.asarray(joint, dtype=object)
        each = names.ravel().tolist()
        if names.ndim > 1 or not each or not all(isinstance(one, str) or _is_number(one) for one in each):
            raise InputError(
                f"joint = {joint!r}, expected the name of a joint or its number from 0, or one a rollout",
                argument="joint",
                value=joint,
            )
        self.joint = joint if isinstance(joint, str | int) else names.tolist()
        self._index = names.astype(np.intp) if all(map(_is_number, each)) else None
        check_rollouts(start=self.start.shape, duration=self.duration.shape, joint=names.shape)

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        """Return zeros: what holds the joint is no torque that is known before."""
        rows = np.shape(self.share(t))[:1] or np.shape(self.joint)
        return np.zeros((*rows, q.shape[-1]))

    def held_joints(self, t: float, q: Array) -> NDArray[np.bool_]:
        """Return the joint while it is jammed, (n,), or for each rollout, (N, n)."""
        return (self.joints == np.arange(q.shape[-1])) & (self.share(t) > 0)

    @property
    def joints(self) -> NDArray[np.intp]:
        """The number of the joint, (1,), or of each rollout's, (N, 1).

        Raises:
            InputError: the joint has a name, and no arm has been asked for its number.
        """
        if self._index is None:
            raise InputError(
                f"joint = {self.joint!r} is a name: use JammedJoint(...).find_names(robot), as simulate does",
                argument="joint",
                value=self.joint,
            )
        return self._index[..., None]

    def find_names(self, robot: RobotModel) -> JammedJoint:
        names = np.asarray(self.joint, dtype=object)
        each = [robot.joint_index(one) if isinstance(one, str) else one for one in names.ravel()]
        found = copy(self)
        found._index = np.reshape(each, names.shape).astype(np.intp)
        found._check(robot.n)
        return found

    def _check(self, n: int) -> None:
        """Raise if a joint's number is beyond the arm."""
        if (self.joints >= n).any():
            raise InputError(
                f"joint = {self.joint!r}, but the arm has joints 0 to {n - 1}",
                argument="joint",
                value=self.joint,
                limit=(0, n - 1),
            )


def _is_number(joint: object) -> bool:
    """Return whether it may be the number of a joint."""
    return isinstance(joint, int | np.integer) and not isinstance(joint, bool) and bool(joint >= 0)
