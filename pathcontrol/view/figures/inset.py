"""An inset that magnifies the second half of a run where the beginning dwarfs it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes

from pathcontrol._arrays import Array
from pathcontrol.view.figures.limits import extent, over_time
from pathcontrol.view.figures.style import apply_style

_UPPER, _LOWER = (0.42, 0.40, 0.58, 0.46), (0.42, 0.14, 0.58, 0.46)  # places, as shares of a panel
_THIN = 0.3  # part of the panel's height that lines fill which an inset neither hides nor is too large for
_FROM = 0.3  # part of the time from which on an inset, with its numbers, lies over the panel


def later(time: Array, part: float = 0.5) -> Array:
    """Return which samples are later than the ``part`` of the time, by default the first half."""
    return time >= time[0] + part * (time[-1] - time[0])


def add_inset(
    axes: Axes, times: Sequence[Array], values: Sequence[Array], draw: Callable[[Axes], object]
) -> Axes | None:
    """Add an inset of the second half, filled by ``draw``; ``None`` where it would hide a line or show no more.

    ``values`` (rollout, time) over ``times`` are what the panel shows; its limits have been set.
    """
    bottom, top = axes.get_ylim()
    after = [v[:, later(time, _FROM)] for time, v in zip(times, values, strict=True)]
    low, high = (np.array(extent(after)) - bottom) / (top - bottom)
    late = [v[:, later(time)] for time, v in zip(times, values, strict=True)]
    (least, most), moments = extent(late), max(map(len, times))
    if moments < 2 or least == most == 0 or (high > _THIN and low < 1 - _THIN):
        return None
    inset = apply_style(axes.inset_axes(_UPPER if high <= _THIN else _LOWER))
    draw(inset)
    margin = 0.15 * (most - min(least, bottom if bottom == 0 else least))
    inset.set_ylim(0 if bottom == 0 else least - margin, most + (margin or 0.15 * abs(most)))
    over_time(inset, [time[later(time)] for time in times])
    return inset
