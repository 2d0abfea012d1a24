"""Recognition of tasks that follow a toolpath, without loading the code that makes toolpaths."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pathcontrol.tasks.joined.path_sequence import PathSequence

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask


def as_toolpath(task: object) -> ToolpathTask | None:
    """Return ``task`` if it is a :class:`ToolpathTask`, else None."""
    if not isinstance(task, PathSequence):
        return None
    from pathcontrol.cartesian.toolpath_task import ToolpathTask

    return task if isinstance(task, ToolpathTask) else None
