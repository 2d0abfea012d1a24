"""The line that the tool draws: a tube that grows with time, coloured by the error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.view.animation.scene.keyframes import Indices, inside, interpolate, key_samples
from pathcontrol.view.animation.scene.tube import SIDES, distinct_rows, tube
from pathcontrol.view.bodies.body_shapes import Mesh

MOST_RINGS = 2500
FRAME = 1 / 60  # s between rings while the tool moves, so that the line grows in steps too small to see
_BEND = 0.25  # allowed distance of the tool from the middle of the tube, as a share of the radius
_SHADE = 1 / 32  # allowed error of the colour, as a share of the scale


@dataclass(frozen=True, eq=False)
class Trace:
    """A tube that grows with time.

    Attributes:
        mesh: the whole tube, ring after ring.
        rings: the samples at which its rings are, increasing, (rings,).
    """

    mesh: Mesh
    rings: Indices

    #: indices of triangles' corners from one ring to the next
    indices = 6 * SIDES

    def on_vertices(self, values: Array) -> Array:
        """Return values at the samples (k, …) for each vertex of the tube."""
        return np.repeat(values[self.rings], SIDES, axis=0)


def trace(time: Array, points: Array, share: Array, radius: float) -> Trace | None:
    """Return the tube of ``radius`` [m] through points (k, 3) [m], or None if they are all in one place.

    Rings are where the line or the colour, a ``share`` of its scale (k,), bend, and at least every :data:`FRAME` of the
    ``time`` (k,) [s] while the tool moves; where it stands there are few. If they are more than
    :data:`MOST_RINGS`, everything is taken less strictly until they are not.
    """
    looseness = 1.0
    while len(rings := _rings(time, points, share, radius, looseness)) > MOST_RINGS:
        looseness *= 1.4
    rings = rings[distinct_rows(points[rings])]
    return Trace(tube(points[rings], radius), rings) if len(rings) > 1 else None


def _rings(time: Array, points: Array, share: Array, radius: float, looseness: float) -> Indices:
    """Return the samples from which the others follow by linear interpolation."""
    known = np.nan_to_num(np.clip(share, 0.0, 1.0), nan=-1.0)
    values = np.column_stack([points / (_BEND * radius), known / _SHADE]) / looseness

    def holds(first: Indices, length: int) -> NDArray[np.bool_]:
        short = time[first + length] - time[first] <= looseness * FRAME
        still = np.linalg.norm(points[first + length] - points[first], axis=-1) <= looseness * _BEND * radius
        off = values[inside(first, length)] - interpolate(time, values, first, length)
        return (short | still) & ((off**2).sum(-1).max(-1) <= 1.0)

    return key_samples(len(time), holds)
