"""``[task]``: a section for each curve of the library, and one for a class in a Python file."""

from __future__ import annotations

import re
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PlainValidator

from pathcontrol.experiments.profile_sections import Profile
from pathcontrol.experiments.section import Section, Units, chooser
from pathcontrol.experiments.toolpath_section import ToolpathSection
from pathcontrol.experiments.values import Flag, Numbers, Positive, Positives, Wholes, expected

_OWN = re.compile(r"(?P<file>.+\.py):(?P<name>[^\W\d]\w*)")


class TaskSection(Section):
    """What every task takes: another velocity profile than its own."""

    not_arguments: ClassVar[tuple[str, ...]] = ("type", "profile")
    profile: Profile | None = None


class EllipseTask(TaskSection):
    """``ellipse``: see :class:`pathcontrol.Ellipse`."""

    units: ClassVar[Units] = {"semi_axes": "rad", "speed": "rad/s", "center": "rad"}
    angles = ("semi_axes", "speed", "center")
    type: Literal["ellipse"] = "ellipse"
    semi_axes: Positives
    speed: Positive
    center: Numbers | None = None
    joints: Wholes | None = None
    clockwise: Flag | None = None


class CircleTask(TaskSection):
    """``circle``: see :class:`pathcontrol.Circle`."""

    units: ClassVar[Units] = {"radius": "rad", "speed": "rad/s", "center": "rad"}
    angles = ("radius", "speed", "center")
    type: Literal["circle"] = "circle"
    radius: Positive
    speed: Positive
    center: Numbers | None = None
    joints: Wholes | None = None
    clockwise: Flag | None = None


class LissajousTask(TaskSection):
    """``lissajous``: see :class:`pathcontrol.Lissajous`."""

    units: ClassVar[Units] = {"amplitudes": "rad", "speed": "rad/s", "phases": "rad", "center": "rad"}
    angles = ("amplitudes", "speed", "phases", "center")
    type: Literal["lissajous"] = "lissajous"
    amplitudes: Numbers
    frequencies: Wholes
    speed: Positive
    phases: Numbers | None = None
    center: Numbers | None = None


class LineTask(TaskSection):
    """``line``: see :class:`pathcontrol.Line`."""

    units: ClassVar[Units] = {"start": "rad", "end": "rad", "speed": "rad/s"}
    angles = ("start", "end", "speed")
    type: Literal["line"] = "line"
    start: Numbers
    end: Numbers
    speed: Positive


def _own_type(value: Any) -> str:
    if not _OWN.fullmatch(value):
        raise expected("'FILE.py:ClassName'")
    return value


class OwnTask(TaskSection):
    """A :class:`pathcontrol.PathTask` subclass in a Python file: ``type = "FILE.py:ClassName"``.

    ``parameters`` are the keyword arguments of the class, as they are: no ``angle_unit`` applies to them.
    """

    type: Annotated[str, PlainValidator(_own_type)]
    parameters: dict[str, Any] = Field(default_factory=dict)

    @property
    def place(self) -> tuple[str, str]:
        """The file and the name of the class in it."""
        match = _OWN.fullmatch(self.type)
        assert match is not None
        return match["file"], match["name"]


CURVES: dict[str, type[Section]] = {
    "circle": CircleTask,
    "ellipse": EllipseTask,
    "lissajous": LissajousTask,
    "line": LineTask,
    "toolpath": ToolpathSection,
}
_choose_curve = chooser("type", CURVES, also=" or 'FILE.py:ClassName'")


def _choose_task(value: Any) -> Any:
    if isinstance(value, OwnTask):
        return value
    own = isinstance(value, dict) and isinstance(value.get("type"), str) and ".py" in value["type"]
    return OwnTask.model_validate(value) if own else _choose_curve(value)


Task = Annotated[
    CircleTask | EllipseTask | LissajousTask | LineTask | ToolpathSection | OwnTask, PlainValidator(_choose_task)
]
