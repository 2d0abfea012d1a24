"""A law that goes along its path no faster than its motors can."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from pathcontrol._arrays import as_scalar
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.wrappers.pace_rule import FastestPlan, PaceRule
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.errors import InputError
from pathcontrol.profiles.topp.joint_limits import LimitChoice, joint_values
from pathcontrol.robot.model import RobotModel


class Paced(LawWrapper):
    """A law that goes along its path as fast as it is asked to, and no faster than its torque limits allow.

    At each moment the torque demand is affine in the rate of the factor w of the speed,

        τ = M(q)[wr'σ̇ + ẇr + K_v e_v + K_p e_p] + C(q,q̇)q̇ + g(q) + f̂(q̇),   r = q_d'ϑ,

    feedforward and feedback together, so that the limits are an interval of ẇ. In it w comes to the smaller of the
    speed that is asked for and w_max(σ), that of the time-optimal motion along the path within limits that are less by
    ``torque_margin``: a look ahead to the end of the path, or over its whole lap, which leads into no state from which
    the rest could not be passed (a trap). Along w_max(σ) ẇ comes to the rate of that motion, w_max'σ̇, and where w_max
    falls w brakes in time. Where no ẇ keeps all limits the plan brakes. Where ϑ falls faster than the motors can brake,
    w is more than what is asked for until they have.

    The plan begins as fast as the arm is, with w = 0 at rest. Only the pace of the plan changes, so the theorem of the
    law inside holds while the torques are within their limits (:class:`LawWrapper`). That they always are is not
    proven; the margin is for what the model does not know and what the errors ask for.

    (Scaling the time of a trajectory within the bounds of its rate: Dahl and Nielsen, IEEE Trans. Robotics and
    Automation 6, 1990. Time-optimal motion: :func:`time_optimal`.)

    Args:
        law: any law that is to be paced.
        torque_margin: share of the torque limits that w_max(σ) leaves to feedback, 0 ≤ margin < 1.
        torque_limits: τ_max [N m], (n,); ``True`` for the effort limits of the law's model.

    Raises:
        InputError: the margin is none, or a limit has the wrong shape, is not positive, or there is none.
        TaskError: the path neither ends nor closes, or has a posture that cannot be held within the limits.
    """

    def __init__(
        self,
        law: Controller,
        torque_margin: Annotated[float, Form.NOT_NEGATIVE] = 0.1,
        torque_limits: Annotated[LimitChoice, Form.LIMITS, Unit("N m", "N")] = True,
    ) -> None:
        check_controller("law", law)
        margin = as_scalar("torque_margin", torque_margin)
        if not 0 <= margin < 1:
            raise InputError(
                f"torque_margin = {margin:g}, expected a share of the torque limits, 0 ≤ margin < 1",
                argument="torque_margin",
                value=margin,
                limit=(0.0, 1.0),
            )
        torque = joint_values("torque_limits", torque_limits, law.robot.limits.effort, law.robot)
        if not np.isfinite(torque).any():
            raise InputError(_describe_missing_limits(law.robot, torque_limits), argument="torque_limits")
        limits = torque_limits if isinstance(torque_limits, bool) else torque.tolist()
        settings = {"torque_margin": margin, "torque_limits": limits}
        super().__init__(law, PaceRule(FastestPlan(law.robot, law.task, torque, margin), torque, settings))


def _describe_missing_limits(robot: RobotModel, given: LimitChoice) -> str:
    """Return what an error says where no joint has a torque limit."""
    give = "give torque_limits = [...] in N m, one per joint"
    if given is True:
        return f"{robot.name} has no torque limits; {give}"
    said = given if given is None or isinstance(given, bool) else np.asarray(given).tolist()
    own = f", or leave them out for those of {robot.name}" if np.isfinite(robot.limits.effort).any() else ""
    return f"torque_limits = {said}, but a pace needs limits that it keeps; {give}{own}"
