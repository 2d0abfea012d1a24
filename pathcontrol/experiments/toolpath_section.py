"""``[task]`` of type ``toolpath``: a drawing or a program, placed by the frame of its workpiece."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pathcontrol.experiments.section import Section, Units
from pathcontrol.experiments.values import Columns, NotNegative, Number, Numbers, Positive, Text


class Workpiece(Section):
    """Where the workpiece's frame is in the base frame.

    Attributes:
        position: its origin [m], three numbers.
        rpy: roll, pitch and yaw, in ``angle_unit``: turned about the base frame's x, then y, then z, as in a URDF.
    """

    units: ClassVar[Units] = {"position": "m", "rpy": "rad"}
    angles = ("rpy",)
    position: Numbers | None = None
    rpy: Numbers | None = None


class ToolpathSection(Section):
    """``toolpath``: see :func:`pathcontrol.read_toolpath` and :class:`pathcontrol.ToolpathTask`.

    ``file`` is relative to the experiment file; the options of its reader are keys of the same name, but for its
    ``start``, which is ``tool_start``. Lengths are in metres and metres per second, ``start`` is in ``angle_unit``.
    """

    units: ClassVar[Units] = {
        "feed": "m/s",
        "rapid_speed": "m/s",
        "acceleration": "m/s^2",
        "tolerance": "m",
        "clearance": "m",
        "gap": "m",
        "arc_tolerance": "m",
        "z": "m",
        "tool_start": "m",
        "start": ("rad", "m"),
    }
    angles = ("start",)
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
    gap: NotNegative | None = None
    ppi: Positive | None = None
    tool_start: Numbers | None = None
    arc_tolerance: Positive | None = None
    columns: Columns | None = None
    decimal: Literal[".", ","] | None = None
    z: Number | None = None
    unknown: Literal["refuse", "warn"] | None = None
    orientation: Literal["free", "down", "normals", "tangent"] | None = None
    feed: Positive | None = None
    rapid_speed: Positive | None = None
    acceleration: Positive | None = None
    tolerance: Positive | None = None
    corner: Literal["blend", "stop"] | None = None
    clearance: NotNegative | None = None
    start: Numbers | None = None

    @property
    def reading(self) -> dict[str, Any]:
        """What the reader of the file is told."""
        given = {name: getattr(self, name) for name in (*self.reader_options, "feed")}
        given["start"] = given.pop("tool_start")
        return {name: value for name, value in given.items() if value is not None}
