"""``[task]``: a section for each path of the library, for one of the user, and for a toolpath."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import PlainValidator, create_model

from pathcontrol.experiments.schema.arm_sections import Pose
from pathcontrol.experiments.schema.derived import Chosen, OwnSection, fields_of, make_chooser
from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.validators import Text
from pathcontrol.registry import PROFILES, TASKS, load


class TaskSection(Section):
    """The section of every task but a toolpath: it may have another velocity profile than its own."""

    not_arguments: ClassVar[tuple[str, ...]] = ("type", "profile")
    profile: Annotated[Any, PlainValidator(make_chooser(PROFILES))] = None


class PathSection(TaskSection, Chosen):
    """A task of the library, or one that the user has defined."""


class OwnTask(TaskSection, OwnSection):
    """A :class:`pathcontrol.PathTask` subclass in a Python file."""


class ToolpathSection(Section):
    """``toolpath``: see :func:`pathcontrol.read_toolpath` and :class:`pathcontrol.ToolpathTask`.

    ``file`` is relative to the experiment file, ``workpiece`` the pose of its frame in the base frame; the options of
    all readers are keys of the same name, but for their ``start``, which is ``tool_start``. Lengths are in metres and
    metres per second, ``start`` is in ``angle_unit``.
    """

    reader_options: ClassVar[tuple[str, ...]] = ()
    not_arguments: ClassVar[tuple[str, ...]] = ("type", "file", "workpiece")
    type: Literal["toolpath"] = "toolpath"
    file: Text
    workpiece: Pose = Pose()

    @property
    def reading(self) -> dict[str, Any]:
        """The arguments of the reader of the file."""
        given = {name.removeprefix("tool_"): getattr(self, name) for name in (*self.reader_options, "feed")}
        return {name: value for name, value in given.items() if value is not None}


@cache
def toolpath_section() -> type[ToolpathSection]:
    """Return the section with the options of all readers and the arguments of :class:`ToolpathTask`."""
    options = {
        name: field
        for reader in load("toolpaths.read:readers")()
        for name, field in fields_of(reader, ("path", "feed")).items()
    }
    options["tool_start"] = options.pop("start")
    own = fields_of(load("cartesian.toolpath_task:ToolpathTask"), ("robot", "toolpath", "workpiece"))
    made = create_model("toolpath", __base__=ToolpathSection, **options, **own)
    made.reader_options = tuple(options)
    made.not_arguments = (*ToolpathSection.not_arguments, *options)
    return made


Task = Annotated[Any, PlainValidator(make_chooser(TASKS, PathSection, OwnTask, {"toolpath": toolpath_section}))]
