"""A whole toolpath as a task: a path of the joints for every contour, one after another."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_scalar, check_rigid
from pathcontrol._expect import expect
from pathcontrol.arguments import Distance, Feed, Form, Length, Unit
from pathcontrol.cartesian.contour_links import link_contours
from pathcontrol.cartesian.contour_paths import ContourPaths, Held, rotations_of
from pathcontrol.cartesian.orientation import Orientation
from pathcontrol.errors import InputError
from pathcontrol.robot.extent import question_length
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.toolpaths.smoothing.smooth import Corners, smooth
from pathcontrol.toolpaths.tool_curve import ToolCurve


class ToolpathTask(PathSequence):
    """The contours of a toolpath in their order, as paths of the joints with the feeds of the file.

    Contours are placed by the workpiece's frame, linked by rapids where they do not meet, and smoothed within a
    tolerance; the arm comes to rest between contours, each of which it begins and ends exactly where the file does, and
    at corners that are stopped at. Each curve is followed as by a :class:`CartesianPath`, at the feed, or slower where
    the acceleration of the tool asks for it. It begins at once with the speed that the acceleration builds up in 0.1 s,
    so that dry friction cannot hold the arm at the start.

    Args:
        robot: the arm.
        frame: name of the frame that follows the contours; :meth:`RobotModel.with_frame` adds the tip of a tool.
        toolpath: what is to be followed, in the workpiece's frame.
        workpiece: pose of the workpiece in the base frame, (4, 4); by default the base frame itself.
        orientation: ``"free"`` for the position only, ``"down"`` for the tool's z axis against the workpiece's,
            ``"normals"`` for that against the normals of the file, both free to turn about it, ``"tangent"`` for the
            tool's x axis along the curve and z against the workpiece's; or an :class:`Orientation` for all contours.
        feed: speed of cuts for which the file gives none [m/s].
        rapid_speed: speed of rapids [m/s].
        acceleration: largest acceleration of the tool, along its curve and across it [m/s²].
        tolerance: largest distance between contours and smooth curves [m].
        corner: ``"blend"`` corners within the tolerance or ``"stop"`` at them.
        clearance: how far above the workpiece rapids between contours go [m]; 0 for straight across.
        start: posture (n,) to begin near; None to have one searched.

    Attributes:
        drawing: the contours with the rapids between them, in the workpiece's frame.
        contours: for each path the contour of the file that it follows, in the base frame.
        smoothed: for each contour how it was smoothed, a :class:`Smoothed`.
        frame: the frame that follows the contours.
        workpiece: pose of the workpiece in the base frame, (4, 4).
        rotations: how many rotations of the tool are prescribed: 3, 2 where it may turn about its z axis, or 0.
        posture: which posture was chosen, in words.

    Raises:
        InputError: an argument has the wrong shape or value, or a cut has no feed.
        TaskError: a contour cannot be followed; the message says which, where and why.
    """

    kept_as = "RecordedToolpath"
    frame: str

    def __init__(
        self,
        robot: RobotModel,
        frame: str,
        toolpath: Toolpath,
        workpiece: ArrayLike | None = None,
        *,
        orientation: Held | Orientation = "free",
        feed: Feed | None = None,
        rapid_speed: Feed = 0.1,
        acceleration: Annotated[float, Form.POSITIVE, Unit("m/s^2")] = 0.5,
        tolerance: Length = 1e-4,
        corner: Corners = "blend",
        clearance: Distance = 0.01,
        start: Annotated[ArrayLike, Form.NUMBERS, Unit("rad", "m")] | None = None,
    ) -> None:
        expect("robot", robot, RobotModel)
        expect("toolpath", toolpath, Toolpath)
        pose = check_rigid("workpiece", np.eye(4) if workpiece is None else workpiece)
        _check_feeds(toolpath, feed)
        self.frame, self.workpiece, self.feed = frame, pose, feed
        self.rotations = rotations_of(orientation)
        self.rapid_speed = as_scalar("rapid_speed", rapid_speed, positive=True)
        self.acceleration = as_scalar("acceleration", acceleration, positive=True)
        self.tolerance, self.corner = as_scalar("tolerance", tolerance, positive=True), corner
        height = as_scalar("clearance", clearance, least=0.0)
        question_length("clearance", height, robot, frame, share=1.0)
        question_length("tolerance", self.tolerance, robot, frame, share=0.1)
        whole = link_contours(toolpath.placed(pose).contours, height, pose[:3, 2], self.tolerance, corner)
        self.smoothed = tuple(smoothed for _, smoothed in whole)
        back = np.linalg.inv(pose)
        self.drawing = Toolpath(tuple(contour.placed(back) for contour, _ in whole), toolpath.source, toolpath.unit)
        maker = ContourPaths(robot, frame, orientation, pose[:3, 2], feed, self.rapid_speed, self.acceleration)
        found = maker.start_on(_tour(toolpath, pose)) if start is None else None
        first = start if found is None else found.start_posture
        paths, contours, postures = zip(*maker.along(whole, first), strict=True)
        self.posture = postures[0] if found is None else found.posture
        self.contours: tuple[Contour, ...] = contours
        super().__init__(paths)

    @property
    def deviation(self) -> float:
        """Largest distance between the contours and the smooth curves that stand for them [m]."""
        return max(smoothed.deviation for smoothed in self.smoothed)

    def describe(self) -> dict[str, Any]:
        names = ("frame", "feed", "rapid_speed", "acceleration", "tolerance", "corner", "deviation", "posture")
        counts = {"contours": len(self.drawing), "paths": len(self.paths)}
        return {"task": "ToolpathTask"} | {name: getattr(self, name) for name in names} | counts


def _tour(toolpath: Toolpath, pose: Array) -> ToolCurve:
    """Return a curve round the box that holds the contours, at half its height, in the base frame."""
    lower, upper = toolpath.bounds
    size = np.maximum(upper - lower, 1e-3 * np.linalg.norm(upper - lower))
    round_trip = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]])
    box = Contour((Polyline(0.5 * (lower + upper) + 0.5 * size * round_trip),), closed=True)
    return smooth(box.placed(pose), 0.1 * float(size[:2].min())).curves[0]


def _check_feeds(toolpath: Toolpath, feed: float | None) -> None:
    """Check that every contour has a feed."""
    if feed is not None:
        as_scalar("feed", feed, positive=True)
        return
    for i, contour in enumerate(toolpath):
        if not contour.rapid and contour.feed is None:
            name = f" ({contour.name})" if contour.name else ""
            raise InputError(
                f"contour {i}{name} has no feed in {toolpath.source or 'the toolpath'}; give feed in m/s",
                argument="feed",
            )
