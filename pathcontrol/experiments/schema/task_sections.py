"""``[task]``: a section for each path of the library, for one of the user, and for a toolpath."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import PlainValidator

from pathcontrol.experiments.schema.derived import Chosen, OwnSection, chooser
from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.toolpath_section import ToolpathSection
from pathcontrol.registry import PROFILES, TASKS


class TaskSection(Section):
    """What every task but a toolpath takes: another velocity profile than its own."""

    not_arguments: ClassVar[tuple[str, ...]] = ("type", "profile")
    profile: Annotated[Any, PlainValidator(chooser(PROFILES))] = None


class PathSection(TaskSection, Chosen):
    """A task of the library, or one that the user has defined."""


class OwnTask(TaskSection, OwnSection):
    """A :class:`pathcontrol.PathTask` subclass in a Python file."""


Task = Annotated[Any, PlainValidator(chooser(TASKS, PathSection, OwnTask, {"toolpath": ToolpathSection}))]
