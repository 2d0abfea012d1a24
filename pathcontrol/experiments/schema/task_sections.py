"""``[task]``: a section for each path of the library, for one of the user, and for a toolpath."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import PlainValidator

from pathcontrol.arguments import Unit
from pathcontrol.experiments.schema.derived import Chosen, OwnSection, chooser
from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.validators import Columns, NotNegative, Number, Numbers, Positive, Text
from pathcontrol.registry import PROFILES, TASKS


class TaskSection(Section):
    """What every task but a toolpath takes: another velocity profile than its own."""

    not_arguments: ClassVar[tuple[str, ...]] = ("type", "profile")
    profile: Annotated[Any, PlainValidator(chooser(PROFILES))] = None


class PathSection(TaskSection, Chosen):
    """A task of the library, or one that the user has defined."""


class OwnTask(TaskSection, OwnSection):
    """A :class:`pathcontrol.PathTask` subclass in a Python file."""


class Workpiece(Section):
    """Where the workpiece's frame is in the base frame.

    Attributes:
        position: its origin [m], three numbers.
        rpy: roll, pitch and yaw, in ``angle_unit``: turned about the base frame's x, then y, then z, as in a URDF.
    """

    position: Annotated[Numbers | None, Unit("m")] = None
    rpy: Annotated[Numbers | None, Unit("rad")] = None


class ToolpathSection(Section):
    """``toolpath``: see :func:`pathcontrol.read_toolpath` and :class:`pathcontrol.ToolpathTask`.

    ``file`` is relative to the experiment file; the options of its reader are keys of the same name, but for its
    ``start``, which is ``tool_start``. Lengths are in metres and metres per second, ``start`` is in ``angle_unit``.
    """

    reader_options: ClassVar[tuple[str, ...]] = (
        *("unit", "layers", "skip", "gap", "ppi", "tool_start", "arc_tolerance", "columns", "decimal", "z", "unknown"),
    )
    not_arguments: ClassVar[tuple[str, ...]] = ("type", "file", "workpiece", *reader_options)
    type: Literal["toolpath"] = "toolpath"
    file: Text
    frame: Text
    workpiece: Workpiece = Workpiece()
    unit: Text | None = None
    layers: list[Text] | None = None
    skip: list[Text] | None = None
    gap: Annotated[NotNegative | None, Unit("m")] = None
    ppi: Positive | None = None
    tool_start: Annotated[Numbers | None, Unit("m")] = None
    arc_tolerance: Annotated[Positive | None, Unit("m")] = None
    columns: Columns | None = None
    decimal: Literal[".", ","] | None = None
    z: Annotated[Number | None, Unit("m")] = None
    unknown: Literal["refuse", "warn"] | None = None
    orientation: Literal["free", "down", "normals", "tangent"] | None = None
    feed: Annotated[Positive | None, Unit("m/s")] = None
    rapid_speed: Annotated[Positive | None, Unit("m/s")] = None
    acceleration: Annotated[Positive | None, Unit("m/s^2")] = None
    tolerance: Annotated[Positive | None, Unit("m")] = None
    corner: Literal["blend", "stop"] | None = None
    clearance: Annotated[NotNegative | None, Unit("m")] = None
    start: Annotated[Numbers | None, Unit("rad", "m")] = None

    @property
    def reading(self) -> dict[str, Any]:
        """What the reader of the file is told."""
        given = {name: getattr(self, name) for name in (*self.reader_options, "feed")}
        given["start"] = given.pop("tool_start")
        return {name: value for name, value in given.items() if value is not None}


Task = Annotated[Any, PlainValidator(chooser(TASKS, PathSection, OwnTask, {"toolpath": ToolpathSection}))]
