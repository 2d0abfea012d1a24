"""Several laps of a closed path as an open path."""

from __future__ import annotations

from pathcontrol.errors import InputError
from pathcontrol.tasks.task import PathSection, PathTask

MOST_LAPS = 10_000  # each is a piece of the path in which the nearest point is looked for


class Laps(PathSection):
    """A number of laps of a closed path from its s0 on, as an open path with the same parameter.

    Args:
        path: a closed path.
        laps: how often it is gone round, a whole number from 1.

    Raises:
        InputError: the path is not closed, or there are too many laps.
    """

    def __init__(self, path: PathTask, laps: int) -> None:
        if path.period is None:
            raise InputError(
                f"laps = {laps}, but {type(path).__name__} is no closed path; expected one with a period",
                argument="laps",
                value=laps,
            )
        if not 1 <= laps <= MOST_LAPS:
            raise InputError(
                f"laps = {laps}, expected a whole number from 1 to {MOST_LAPS}",
                argument="laps",
                value=laps,
                limit=(1, MOST_LAPS),
            )
        self.laps = laps
        super().__init__(path, path.s0, path.s0 + laps * path.period)
