"""The task of a toolpath without the arm it was made for, as saved runs keep it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pathcontrol._arrays import Array, check_rigid
from pathcontrol.arguments import parameters_of
from pathcontrol.cartesian.contour_links import smooth_open
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.recipes import contour_of, contour_recipe
from pathcontrol.toolpaths.smoothing.smooth import Corners, Smoothed


class RecordedToolpath(ToolpathTask):
    """A :class:`ToolpathTask` rebuilt from its paths and contours; no posture is searched.

    Args:
        paths: the paths, each from where the one before it ends.
        placed: the contours of the drawing in the base frame, rapids included.
        followed: for each path the index of the contour that it follows, (len(paths),).
        frame: the frame that follows the contours.
        workpiece: pose of the workpiece in the base frame, (4, 4).
        feed: speed of cuts for which the file gave none [m/s], or None.
        rapid_speed: speed of rapids [m/s].
        acceleration: largest acceleration of the tool [m/s²].
        tolerance: largest distance between contours and smooth curves that was allowed [m].
        corner: ``"blend"`` or ``"stop"``.
        deviation: the largest distance that there is [m].
        source: the file that the contours come from.
        unit: that file's unit of length.
        rotations: how many rotations of the tool are prescribed; older files do not say.
        posture: which posture was chosen, in words.
    """

    #: how items of arguments are written to a saved run and read from it
    codecs: ClassVar = {"placed": (contour_recipe, contour_of)}

    def __init__(
        self,
        paths: Sequence[PathTask],
        placed: Sequence[Contour],
        followed: Sequence[int],
        *,
        frame: str,
        workpiece: Array,
        feed: float | None,
        rapid_speed: float,
        acceleration: float,
        tolerance: float,
        corner: Corners,
        deviation: float,
        source: str,
        unit: str,
        rotations: int = 0,
        posture: str = "",
    ) -> None:
        PathSequence.__init__(self, paths)
        self.frame, self.workpiece, self.feed = frame, check_rigid("workpiece", workpiece), feed
        self.rotations = rotations
        self.rapid_speed, self.acceleration = rapid_speed, acceleration
        self.tolerance, self.corner = tolerance, corner
        self.posture = posture
        self._placed, self._deviation = tuple(placed), deviation
        back = np.linalg.inv(self.workpiece)
        self.drawing = Toolpath(tuple(contour.placed(back) for contour in placed), source, unit)
        self.contours = tuple(placed[i] for i in followed)

    @classmethod
    def arguments_of(cls, task: ToolpathTask) -> dict[str, Any]:
        """Return the arguments that rebuild a task."""
        placed = list(dict.fromkeys(task.contours))
        rank = {contour: i for i, contour in enumerate(placed)}
        made = {"paths": task.paths, "placed": placed, "followed": [rank[contour] for contour in task.contours]}
        drawing = {"source": task.drawing.source, "unit": task.drawing.unit}
        others = [name for name in parameters_of(cls) if name not in made | drawing]
        return made | drawing | {name: getattr(task, name) for name in others}

    @property
    def deviation(self) -> float:
        return self._deviation

    @cached_property
    def smoothed(self) -> tuple[Smoothed, ...]:  # type: ignore[override]
        """The smooth curves of each contour."""
        return tuple(smooth_open(contour, self.tolerance, self.corner) for contour in self._placed)
