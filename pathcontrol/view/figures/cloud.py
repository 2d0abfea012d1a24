"""Scatter plots of pairs of numbers around published values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.style import BLUE, DASHED, GREY, INK, ORANGE, PAGE, Look, apply_style, new_figure, style

_OTHER: Look = {"marker": "o", "linestyle": "none", "markersize": 2.4, "color": GREY, "alpha": 0.6, "mew": 0}
_NEAR: Look = {"marker": "o", "linestyle": "none", "markersize": 2.8, "color": BLUE, "alpha": 0.8, "mew": 0}
_OURS: Look = {"marker": "o", "linestyle": "none", "markersize": 5.5, "color": INK, "markerfacecolor": "white"}
_PUBLISHED: Look = {"marker": "*", "linestyle": "none", "markersize": 9, "color": ORANGE, "mec": "white", "mew": 0.6}
_BOX: Look = {"fill": False, "edgecolor": ORANGE, "linewidth": 0.8, "linestyle": DASHED}


class Panel(NamedTuple):
    """A plane of two quantities.

    Attributes:
        title: what it is of.
        labels: of both axes, with units.
        points: both quantities of each sample, (2, sample).
        ours: those of the settings that are shown elsewhere, (2,).
        published: those that were published, (2,).
    """

    title: str
    labels: tuple[str, str]
    points: Array
    ours: Array
    published: Array


def cloud_figure(panels: Sequence[Panel], near: NDArray[np.bool_], share: float, words: tuple[str, str]) -> Figure:
    """Draw panels beside one another, with a point for every sample, and the published value in a box.

    Args:
        panels: the planes.
        near: the samples that are told apart, (sample,).
        share: half the width of the box, as a share of the published values.
        words: what the samples in ``near`` and what ``ours`` are called.
    """
    with style():
        figure = new_figure(PAGE, 2.75)
        for axes, panel in zip(figure.subplots(1, len(panels)), panels, strict=True):
            _draw(apply_style(axes), panel, near, share)
        box = Line2D([], [], color=ORANGE, linewidth=0.8, linestyle=DASHED)
        handles = [Line2D([], [], **look) for look in (_OTHER, _NEAR, _OURS, _PUBLISHED)]
        names = ("a combination", *words, "the paper", f"±{100 * share:.0f} % of it")
        legend(figure, dict(zip(names, [*handles, box], strict=True)))
    return figure


def _draw(axes: Axes, panel: Panel, near: NDArray[np.bool_], share: float) -> None:
    """Draw one panel."""
    right, up = panel.points
    axes.plot(right[~near], up[~near], **_OTHER)
    axes.plot(right[near], up[near], **_NEAR)
    x, y = panel.published
    axes.add_patch(Rectangle((x * (1 - share), y * (1 - share)), 2 * share * x, 2 * share * y, **_BOX, zorder=2.2))
    axes.plot(*panel.ours, **_OURS, zorder=3)
    axes.plot(*panel.published, **_PUBLISHED, zorder=3.1)
    axes.set(xlabel=panel.labels[0], ylabel=panel.labels[1])
    axes.set_title(panel.title)
