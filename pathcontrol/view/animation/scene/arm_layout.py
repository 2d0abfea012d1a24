"""The layout of arms that are animated together: side by side, or in one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.scene.camera import picture_axes

Layout: TypeAlias = Literal["beside", "ghosted"]

_GAP = 0.12  # between arms, of the width of the widest


def shifts(extents: Sequence[Array], direction: Array, layout: Layout) -> Array:
    """Return the shift of each arm [m], (arms, 3); the first does not move.

    Arms side by side are moved along the picture's horizontal, in their order and all to the same scale, so far that
    what one sweeps and draws is apart from the next.

    Args:
        extents: points that show where each gets to [m], (k, 3) each.
        direction: unit vector towards the eye, (3,).
        layout: whether they stand beside one another.
    """
    if layout == "ghosted":
        return np.zeros((len(extents), 3))
    right = picture_axes(direction)[0]
    spans = np.array([[(points @ right).min(), (points @ right).max()] for points in extents])
    gap = _GAP * float((spans[:, 1] - spans[:, 0]).max())
    steps = spans[:-1, 1] - spans[1:, 0] + gap
    return np.concatenate([[0.0], np.cumsum(steps)])[:, None] * right
