"""Conversion of smoothed contours to paths of the joints, one after another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol._expect import expect_choice
from pathcontrol.cartesian.cartesian_path import CartesianPath
from pathcontrol.cartesian.orientation import NormalOrientation, Orientation, TangentOrientation, TurningOrientation
from pathcontrol.errors import InputError, TaskError
from pathcontrol.profiles.limited.limited import limited
from pathcontrol.profiles.limited.motion_limit import MotionLimit
from pathcontrol.profiles.motion import ToolMotion
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.smoothing.smooth import Smoothed
from pathcontrol.toolpaths.tool_curve import ToolCurve

_START_TIME = 0.1  # s

Held = Literal["free", "down", "normals", "tangent"]

_ROTATIONS: dict[Held, int] = {"free": 0, "down": 2, "normals": 2, "tangent": 3}


def rotations_of(held: Held | Orientation) -> int:
    """Return the number of rotations that are prescribed: 3, 2 for a tool free to turn about its z axis, or 0."""
    return held.rows if isinstance(held, Orientation) else _ROTATIONS.get(held, 0)


@dataclass(frozen=True, eq=False)
class ContourPaths:
    """A builder of the paths of all contours, with what they have in common.

    Attributes:
        robot: the arm.
        frame: the frame that follows the contours.
        held: how the tool is turned; see :class:`ToolpathTask`.
        up: the workpiece's z axis in the base frame, (3,).
        feed: speed of cuts for which the file gives none [m/s], or None.
        rapid_speed: speed of rapids [m/s].
        acceleration: largest acceleration of the tool, along its curve and across it [m/s²].
    """

    robot: RobotModel
    frame: str
    held: Held | Orientation
    up: Array
    feed: float | None
    rapid_speed: float
    acceleration: float

    def __post_init__(self) -> None:
        if not isinstance(self.held, Orientation):
            expect_choice("orientation", self.held, get_args(Held), ", or an Orientation")

    def along(
        self, whole: Sequence[tuple[Contour, Smoothed]], start: ArrayLike | None
    ) -> Iterator[tuple[PathTask, Contour, str]]:
        """Yield the path of each curve with its contour and its posture, each begun at the end of the one before.

        Raises:
            InputError: the orientation does not suit the contours.
            TaskError: a contour cannot be followed.
        """
        self._check_held(whole)
        for i, (contour, smooth) in enumerate(whole):
            for j, curve in enumerate(smooth.curves):
                try:
                    path, posture = self._path(contour, curve, self._orientation(whole, i, j), start)
                except (TaskError, InputError) as error:
                    name = f" ({contour.name})" if contour.name else ""
                    raise TaskError(f"contour {i} of {len(whole)}{name}: {error}", **error.details_with()) from error
                yield path, contour, posture
                start = path.q_d(np.array(path.s_end))

    def start_on(self, tour: ToolCurve) -> CartesianPath | None:
        """Return the path along a curve from a searched posture, or None if part of it is out of reach."""
        orientation = self.held if isinstance(self.held, Orientation) else None
        if orientation is None and self.held != "free":
            orientation = NormalOrientation(self.up)
        try:
            return CartesianPath(self.robot, self.frame, tour, orientation, speed=self.rapid_speed)
        except (TaskError, InputError):
            return None  # the contours themselves may still be in reach

    def _path(
        self, contour: Contour, curve: ToolCurve, orientation: Orientation | None, start: ArrayLike | None
    ) -> tuple[PathTask, str]:
        """Return the path of one curve, at its feed within the acceleration of the tool, and its posture."""
        speed = self.rapid_speed if contour.rapid else contour.feed or self.feed
        assert speed is not None
        path = CartesianPath(self.robot, self.frame, curve, orientation, speed=speed, start=start, closed=False)
        limit = MotionLimit(
            ToolMotion(self.robot, self.frame), speed, tangential=self.acceleration, normal=self.acceleration
        )
        # fast enough at once to overcome friction: a plan that waits for the arm would wait for ever at a slow start
        begin = min(speed, _START_TIME * self.acceleration)
        return path.with_profile(limited(path, limit, start_rate=begin)), path.posture

    def _check_held(self, whole: Sequence[tuple[Contour, Smoothed]]) -> None:
        if self.held == "normals" and all(contour.normals is None for contour, _ in whole):
            raise InputError(
                "orientation = 'normals', but no contour has any; give i j k in a CSV, or take 'down'",
                argument="orientation",
                value=self.held,
            )
        stops = sum(len(smooth.curves) - 1 for contour, smooth in whole if not contour.rapid)
        if self.held == "tangent" and stops:
            raise InputError(
                f"orientation = 'tangent', but the contours have {stops} stops at corners, where the tool would have "
                "to turn on the spot; blend the corners, or hold the tool 'down'",
                argument="orientation",
                value=self.held,
            )

    def _orientation(self, whole: Sequence[tuple[Contour, Smoothed]], i: int, j: int) -> Orientation | None:
        """Return the orientation of the tool along curve j of contour i."""
        if isinstance(self.held, Orientation):
            return self.held
        if self.held == "free":
            return None
        if self.held == "down":
            return NormalOrientation(self.up)
        contour, smooth = whole[i]
        if self.held == "tangent":
            if not contour.rapid:
                return TangentOrientation(-self.up)
            return TurningOrientation(*(self._frames(whole, i, j)))
        given, curve = smooth.normals[j], smooth.curves[j]
        if given is not None:
            return NormalOrientation(given[1], at=given[0])
        before, after = self._normal(whole[:i][::-1], -1), self._normal(whole[i + 1 :], 0)
        if np.allclose(before, after):
            return NormalOrientation(before)
        return NormalOrientation(np.array([before, after]), at=np.array([curve.s0, curve.s_end]))

    def _frames(self, whole: Sequence[tuple[Contour, Smoothed]], i: int, j: int) -> tuple[Array, Array]:
        """Return the frames along the tangent that rapids turn between, on the last of their curves."""
        before = next((smooth.curves[-1] for contour, smooth in whole[:i][::-1] if not contour.rapid), None)
        after = next((smooth.curves[0] for contour, smooth in whole[i + 1 :] if not contour.rapid), None)
        tangent = TangentOrientation(-self.up)
        first = None if before is None else tangent.frames(before, np.array([before.s_end]))[0]
        last = None if after is None else tangent.frames(after, np.array([after.s0]))[0]
        first, last = (last if first is None else first), (first if last is None else last)
        if first is None or last is None:
            raise InputError(
                "orientation = 'tangent', but there are only rapids; take 'down'",
                argument="orientation",
                value="tangent",
            )
        turns_here = j == len(whole[i][1].curves) - 1 and (i + 1 == len(whole) or not whole[i + 1][0].rapid)
        return (first, last) if turns_here else (first, first)

    def _normal(self, neighbours: Sequence[tuple[Contour, Smoothed]], end: int) -> Array:
        """Return the first normal that neighbouring contours give, at their last (-1) or first (0) point."""
        for _, smooth in neighbours:
            given = smooth.normals[end]
            if given is not None:
                return given[1][end]
        return self.up
