"""The walls that stood before an arm during a run, as plates of the scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.config import first_rollout, table
from pathcontrol.simulation.summaries import is_whole
from pathcontrol.view.animation.rollout import Recording

THICKNESS = 0.02  # of the edge of a plate
_DEEPEST = 20  # sums in one another


@dataclass(frozen=True, eq=False)
class Plate:
    """A square plate whose front is part of the surface of a wall.

    Attributes:
        pose: the middle of its front in the base frame [m], with x along the normal of the wall, (4, 4).
        edge: its edge [m].
        begin: when the wall comes, since the begin of the film [s].
        end: when it goes [s]; inf if it stays.
    """

    pose: Array
    edge: float
    begin: float
    end: float

    @property
    def corners(self) -> Array:
        """The corners of its front [m], (4, 3)."""
        sides = 0.5 * self.edge * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
        return sides @ self.pose[:3, 1:3].T + self.pose[:3, 3]

    def looks_like(self, other: Plate) -> bool:
        """Return whether both are the same plate at the same time."""
        return (self.edge, self.begin, self.end) == (other.edge, other.begin, other.end) and np.array_equal(
            self.pose, other.pose
        )


def find_plates(recording: Recording, body: Array) -> list[Plate]:
    """Return the walls of a rollout that are within the size of the arm, each as large as that size.

    A wall farther away would not be in the picture.

    Args:
        recording: the rollout; its configuration tells of its walls.
        body: where the arm gets to in the base frame [m], (k, 3).
    """
    row = int(recording.run.array("rollout")[0] - first_rollout(recording.run.config))
    walls = _find_walls(table(recording.run.config, "disturbance"))
    plates = [_place(wall, row, body, float(recording.run.time[0])) for wall in walls]
    return [plate for plate in plates if plate is not None and plate.end > 0.0 and plate.begin < recording.duration]


def _place(wall: Wall, row: int, body: Array, started: float) -> Plate | None:
    """Return the plate of a wall before an arm, or None where it is out of reach."""
    axes, point = _of_rollout(wall.axes, row, 2), _of_rollout(wall.point, row, 1)
    lower, upper = body.min(axis=0), body.max(axis=0)
    edge, middle = float((upper - lower).max()), (lower + upper) / 2
    gap = float((middle - point) @ axes[0])
    if not abs(gap) <= edge:
        return None
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes.T, middle - gap * axes[0]
    begin = float(_of_rollout(wall.start, row, 0)) - started
    return Plate(pose, edge, begin, begin + float(_of_rollout(wall.duration, row, 0)))


def _find_walls(described: Mapping[str, Any], depth: int = 0) -> Iterator[Wall]:
    """Yield the walls of a described disturbance, those of sums too; what makes no wall is passed over."""
    terms = described.get("terms")
    if isinstance(terms, Sequence) and depth < _DEEPEST:
        for term in terms:
            if isinstance(term, Mapping):
                yield from _find_walls(term, depth + 1)
    if described.get("disturbance") != "Wall" or not is_whole(described):
        return
    try:
        yield Wall(**{name: value for name, value in described.items() if name != "disturbance"})
    except (InputError, TypeError):
        return


def _of_rollout(values: Array, row: int, axes: int) -> Array:
    """Return what a rollout has of values that have ``axes`` axes, or one more for the rollouts."""
    return values[row % len(values)] if values.ndim > axes else values
