"""Parameters of closed curves."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array


def wrap(s: Array, lower: float, period: float) -> Array:
    """Return ``s`` (*batch,), shifted by whole periods into the lap that begins at ``lower``."""
    return lower + np.mod(s - lower, period)
