"""The distance of the arm from its path, which colours the line of the tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.deviation import tool_deviation
from pathcontrol.analysis.readable import in_degrees
from pathcontrol.analysis.run_metrics import contour_error
from pathcontrol.errors import TaskError
from pathcontrol.view.animation.rollout import Recording

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask

MILLIMETRE, MICROMETRE = 1e3, 1e6
_LITTLE_MORE = 1.25


@dataclass(frozen=True, eq=False)
class PathError:
    """An error over time in the unit that a person reads.

    Attributes:
        label: what it is.
        unit: of the values.
        values: (k,), NaN where there is nothing to be measured against.
    """

    label: str
    unit: str
    values: Array

    @property
    def largest(self) -> float:
        """The largest of the known values, 0 without any."""
        return float(self.values[np.isfinite(self.values)].max(initial=0.0))

    @property
    def top(self) -> float:
        """The top of the scale, which a start off the path does not stretch.

        The largest of the second half, or what nine tenths of the time stay below if that is more; the largest of all
        if that is only a little more.
        """
        known = np.isfinite(self.values)
        late = self.values[len(known) // 2 :][known[len(known) // 2 :]]
        usual = np.quantile(self.values[known], 0.9) if known.any() else 0.0
        top = float(max(late.max(initial=0.0), usual))
        return self.largest if self.largest <= _LITTLE_MORE * top else top


def path_error(recording: Recording) -> PathError | None:
    """Return the error to judge a rollout by, or None without a path to measure it against.

    On a toolpath the distance of the tool from the drawing, of cuts only; else the contour error, the distance
    from the path in joint space.
    """
    if recording.task is None:
        return None
    if recording.toolpath is not None:
        return PathError(
            "distance from the drawing", "mm", MILLIMETRE * _measure_deviation(recording, recording.toolpath)
        )
    try:
        error = contour_error(recording.run, recording.task)[0]
    except TaskError:  # an endless path has no nearest point
        return None
    values, unit = in_degrees(error, recording.run.unit("q"))
    return PathError("contour error", unit, values)


def in_fitting_units(errors: Sequence[PathError | None]) -> list[PathError | None]:
    """Return the same errors, those in millimetres all in micrometres if none of them reaches one."""
    lengths = [error for error in errors if error is not None and error.unit == "mm"]
    if not lengths or max(error.top for error in lengths) >= 1.0:
        return list(errors)
    scale = MICROMETRE / MILLIMETRE
    return [replace(e, unit="µm", values=scale * e.values) if e in lengths else e for e in errors]


def _measure_deviation(recording: Recording, task: ToolpathTask) -> Array:
    """Return the distance of the tool from its contour [m], (k,); NaN on rapids."""
    cutting = np.array([not contour.rapid for contour in task.contours])[recording.run.array("path_index")]
    deviation = np.full(len(cutting), np.nan)
    if cutting.any():
        deviation[cutting] = tool_deviation(recording.run, recording.robot, task.frame, task.contours)[0, cutting]
    return deviation
