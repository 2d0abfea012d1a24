"""From ``[task]`` of type ``toolpath`` to a :class:`ToolpathTask`."""

from __future__ import annotations

from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.experiments.builders.file_errors import keyed
from pathcontrol.experiments.builders.making import Place
from pathcontrol.experiments.builders.poses import pose_of
from pathcontrol.experiments.schema.toolpath_section import ToolpathSection
from pathcontrol.robot.model import RobotModel
from pathcontrol.toolpaths.read import read_toolpath


def build_toolpath(section: ToolpathSection, robot: RobotModel, place: Place) -> ToolpathTask:
    """Read the file and follow its contours with the arm.

    Raises:
        ExperimentError: the file cannot be used, or a contour cannot be followed.
    """
    workpiece = pose_of("task.workpiece", section.workpiece.arguments(place.to_radians))
    keys = {name.removeprefix("tool_"): name for name in (*section.reader_options, "feed")}
    with keyed("task.file", keys):
        toolpath = read_toolpath(place.folder / section.file, **section.reading)
    arguments = section.arguments(place.to_radians)
    with keyed("task", ToolpathSection.model_fields):
        return ToolpathTask(robot, arguments.pop("frame"), toolpath, workpiece, **arguments)
