"""A path of the joints that leads a tool along a curve in space."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, freeze
from pathcontrol._expect import expect
from pathcontrol.arguments import Form, Length, Points, Unit
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.solve import check_posture, solve
from pathcontrol.cartesian.orientation import FixedOrientation, FreeOrientation, Orientation
from pathcontrol.cartesian.tool import Tool
from pathcontrol.errors import InputError
from pathcontrol.robot.extent import question_length, question_speed
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.spline import SplinePath
from pathcontrol.toolpaths.tool_curve import ToolCurve

_SAME = 1e-6  # rad
_COARSEST = 0.1  # share of the reach, as a tolerance
_LOOKED_AT = 33  # points of a curve
_FINEST = 1e-9  # m and rad; smaller tolerances are lost in rounding


class CartesianPath(SplinePath):
    """A path of the joints that leads a tool along a curve p(s), at a constant feed ‖p'‖ϑ [m/s].

    s is the parameter of the curve. q_d(s) is a spline of degree 5 with as many knots as it takes to keep the tool
    within ``tolerance`` of p(s), at the same s, and within 0.1 % of its velocity; both are verified on a dense grid in
    between. Postures are found by continuation from a start posture and Newton's method.

    Where there is a choice of postures, as for an arm of seven joints or a tool that may turn about its axis, the
    joints move as little as they can, bent away from their limits and gently towards the start posture; what that
    leaves over after a lap is taken back evenly along it, so that closed curves give closed paths. Whole turns are not
    closed: a tool along the tangent of a circle turns the last joint by 2π a lap. Collisions are not looked at.

    The curve has to be twice continuously differentiable, and so has a given orientation. Differential inverse
    kinematics by quadratic programs, as in Pink, is not used: it takes one step after another and is as exact as the
    steps are short, while a spline of few knots needs exact postures at any s.

    Args:
        robot: the arm.
        frame: name of the frame that follows the curve.
        curve: the curve in the base frame [m], or points (m, 3) for :meth:`ToolCurve.spline`.
        orientation: None for a position only, ``"keep"`` for the orientation of ``start``, or a
            :class:`FixedOrientation`, :class:`TangentOrientation` or :class:`NormalOrientation`.
        speed: feed of the tool [m/s].
        start: posture (n,) at the beginning, moved onto the curve if it is not there; None to have one searched from
            which the whole curve is followed: with all joints above the base plane if there is one, away from
            singularities and limits, and of those the one with the highest elbow.
        tolerance: largest distance between the tool and p(s) [m].
        angle_tolerance: largest angle between the tool and its orientation at s [rad].
        tool: pose of the tool in ``frame``, (4, 4), or its tip [m], (3,); None for the frame itself.
        closed: False to take one lap of a closed curve as an open path; by default the path is closed if the curve is.

    Attributes:
        report: what was measured, a :class:`CartesianReport`.
        start_posture: q_d(s0) [rad], (n,).
        posture: which posture was chosen, in words.

    Raises:
        InputError: an argument has the wrong shape or value.
        TaskError: the curve is out of reach, leads through a singularity or past a joint limit, or does not close; the
            message says at which s and point, and what to change.
    """

    frame: str

    def __init__(
        self,
        robot: RobotModel,
        frame: str,
        curve: ToolCurve | Points,
        orientation: Orientation | Literal["keep"] | None = None,
        *,
        speed: Annotated[float, Form.POSITIVE, Unit("m/s")] = 0.1,
        start: Annotated[ArrayLike, Form.NUMBERS, Unit("rad", "m")] | None = None,
        tolerance: Length = 1e-5,
        angle_tolerance: Annotated[float, Form.POSITIVE, Unit("rad")] = 1e-4,
        tool: Annotated[ArrayLike, Form.ARRAY, Unit("m")] | None = None,
        closed: bool | None = None,
    ) -> None:
        expect("robot", robot, RobotModel)
        self.frame = frame
        self.curve = curve if isinstance(curve, ToolCurve) else ToolCurve.spline(as_array("curve", curve))
        self.tolerance = as_scalar("tolerance", tolerance, least=_FINEST)
        self.angle_tolerance = as_scalar("angle_tolerance", angle_tolerance, least=_FINEST)
        speed, closed = as_scalar("speed", speed, positive=True), _is_closed(self.curve, closed)
        carried, first = Tool(robot, frame, tool), None if start is None else check_posture(robot, start)
        self._question(speed, carried)
        self.orientation = _orientation(orientation, carried, first)
        _check_closing(self.curve, self.orientation, closed)
        tolerances = (self.tolerance, self.angle_tolerance)
        constraint = ToolConstraint.of(carried, self.curve, self.orientation, tolerances)
        spline, self.report = solve(constraint, first, closed)
        super().__init__(spline, speed, closed)
        self.tool_pose, self.rotations = carried.pose, self.orientation.rows
        self.posture = self.report.posture
        self.start_posture = freeze(self.q_d(np.array(self.s0)))

    @property
    def polyline(self) -> Array | None:
        return self.curve.vertices

    def theta(self, s: Array) -> Array:
        return self._feed(s)[0]

    def dtheta(self, s: Array) -> Array:
        return self._feed(s)[1]

    def at(self, s: Array) -> PathPoint:
        return PathPoint(self.q_d(s), self.dq_d(s), self.ddq_d(s), *self._feed(s))

    def describe(self) -> dict[str, Any]:
        kind, length = type(self.orientation).__name__, self.curve.length
        found = {name: getattr(self.report, name) for name in ("position_deviation", "angle_deviation", "knots")}
        return super().describe() | {"orientation": kind, "curve_length": length} | found

    def _question(self, speed: float, tool: Tool) -> None:
        """Warn of a feed, a tolerance or a curve that is far beyond the arm."""
        robot, frame = tool.robot, tool.frame
        question_speed("the speed of the tool", speed, robot, frame)
        question_length("tolerance", self.tolerance, robot, frame, share=_COARSEST)
        points = self.curve.position(np.linspace(self.curve.s0, self.curve.s_end, _LOOKED_AT))
        question_length("the largest distance of the curve", float(np.linalg.norm(points, axis=-1).max()), robot, frame)

    def _feed(self, s: Array) -> tuple[Array, Array]:
        """Return ϑ = v/‖p'‖ and ϑ' = −v p'ᵀp''/‖p'‖³."""
        _, dp, ddp = self.curve.at(s)
        length = np.linalg.norm(dp, axis=-1)
        return self.speed / length, -self.speed * (dp * ddp).sum(-1) / length**3


def _is_closed(curve: ToolCurve, closed: bool | None) -> bool:
    if closed and not curve.closed:
        raise InputError(
            "closed = True, but the curve is open; close the curve, or leave closed out",
            argument="closed",
            value=closed,
        )
    return curve.closed if closed is None else closed


def _check_closing(curve: ToolCurve, orientation: Orientation, closed: bool) -> None:
    """Check that the orientation at the end of a lap is the one at its beginning."""
    first, last = np.array([curve.s0]), np.array([curve.s_end])
    angle = float(np.linalg.norm(orientation.error(curve, last, orientation.frames(curve, first))[0]))
    if closed and angle > _SAME:
        raise InputError(
            f"the curve is closed, but the orientation at its end is {angle:.3g} rad from the one at its beginning; "
            "closed=False makes one lap an open path",
            argument="closed",
            value=angle,
            limit=_SAME,
        )


def _orientation(orientation: Orientation | str | None, tool: Tool, start: Array | None) -> Orientation:
    if orientation is None:
        return FreeOrientation()
    if isinstance(orientation, Orientation):
        return orientation
    if orientation != "keep":
        raise InputError(
            f"orientation = {orientation!r}, expected None, 'keep', or an Orientation: FixedOrientation, "
            "TangentOrientation or NormalOrientation",
            argument="orientation",
            value=orientation,
        )
    if start is None:
        raise InputError(
            "orientation = 'keep' keeps that of the start posture; give start, or a FixedOrientation",
            argument="orientation",
            value=orientation,
        )
    return FixedOrientation(tool.kinematics(start[None]).rotation[0])
