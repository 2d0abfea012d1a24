"""A path made from another one."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol.tasks.base import PathTask
from pathcontrol.tasks.batch.task_batch import refuse_batch


class DerivedPath(PathTask):
    """A path made from ``path``, which it names in the record of a run."""

    def __init__(self, path: PathTask) -> None:
        refuse_batch(f"the path of a {type(self).__name__}", path)
        self.path = path
        self.keep_tool(path)

    def _keep_domain(self) -> None:
        """The domain is that of the path underneath."""
        self.s0 = self.path.s0
        if self.path.period is not None:
            self.period = self.path.period
        elif np.isfinite(self.path.s_end):
            self.s_end = self.path.s_end

    def __repr__(self) -> str:
        own = super().__repr__().partition("(")[2]
        return f"{type(self).__name__}({self.path!r}{', ' if own != ')' else ''}{own}"

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"path": self.path.describe()}
