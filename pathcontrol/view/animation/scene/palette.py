"""The colours of a film: visible on a light and on a dark ground, and distinct with any colour vision."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.body_shapes import Color

#: Okabe and Ito's colours, for the runs in the order that figures have, too; the last is pale on white
RUNS: tuple[Color, ...] = (
    (0.0, 0.447, 0.698, 1.0),
    (0.835, 0.369, 0.0, 1.0),
    (0.0, 0.62, 0.451, 1.0),
    (0.8, 0.475, 0.655, 1.0),
    (0.902, 0.624, 0.0, 1.0),
    (0.337, 0.706, 0.914, 1.0),
    (0.941, 0.894, 0.259, 1.0),
)
_DARKER = 0.6
DESIRED: Color = (0.53, 0.56, 0.6, 1.0)
RAPID: Color = (0.6, 0.63, 0.67, 0.6)
DESIRED_POINT: Color = (0.45, 0.48, 0.53, 0.6)
#: the colour without a known error
PLAIN: Color = (0.6, 0.63, 0.67, 1.0)
#: see-through: what is behind it is to be seen
WALL: Color = (0.45, 0.58, 0.7, 0.35)
GRID: Color = (0.76, 0.79, 0.82, 1.0)

# From violet over magenta to red. Viridis and its kin begin near black and end near white, so that half a line is lost
# on a dark or a light ground; these keep a contrast above 3 to both (WCAG 2 asks for that of graphics). Within that
# narrow band the lightness rises all the way, and steps are even for people without one kind of cones, too.
_ANCHORS = np.array([[0.4, 0.273, 0.968], [0.7, 0.336, 0.604], [1.0, 0.206, 0.145]])


def scale_colors(share: Array) -> Array:
    """Return red, green and blue, (*batch, 3), for shares (*batch,) of the scale from 0 to 1; grey where NaN."""
    known = np.clip(np.nan_to_num(share), 0.0, 1.0)
    steps = np.linspace(0.0, 1.0, len(_ANCHORS))
    colors = np.stack([np.interp(known, steps, channel) for channel in _ANCHORS.T], axis=-1)
    return np.where(np.isnan(share)[..., None], PLAIN[:3], colors)


def run_color(index: int) -> Color:
    """Return the colour of a run, counted from 0; where they are used up, they come again darker."""
    red, green, blue, opacity = RUNS[index % len(RUNS)]
    shade = _DARKER ** (index // len(RUNS))
    return red * shade, green * shade, blue * shade, opacity
