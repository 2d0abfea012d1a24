"""The figures of toolpaths: the content of a file, and the plan for others, in millimetres."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.toolpaths.smoothing.corners import corners
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.style import BLUE, GREY, ORANGE, apply_style, new_figure, style

_CURVE_SAMPLES = 64
_MOST_POINTS = 200_000
_MOST_NUMBERS = 40  # contours that are numbered
_AXES = "xyz"


def toolpath_figure(toolpath: Toolpath) -> Figure:
    """Draw the contours in order, along the axis in which they extend least: cuts, rapids, starts, corners."""
    expect("toolpath", toolpath, Toolpath)
    with style():
        figure, (axes,), (i, j) = plan_figure(toolpath)
        for contour in toolpath:
            _draw(axes, contour, i, j)
        _number(axes, toolpath, i, j)
        bends = [corner.point for contour in toolpath.cuts for corner in corners(contour)]
        if 0 < len(bends) <= _MOST_POINTS:
            x, y = 1e3 * np.array(bends)[:, [i, j]].T
            axes.plot(x, y, ".", color=ORANGE, markersize=3, label=f"corner ({len(bends)})")
        handles, labels = axes.get_legend_handles_labels()
        legend(figure, dict(zip(labels, handles, strict=True)))
    return figure


def plan_figure(toolpath: Toolpath, extra: float = 0.0) -> tuple[Figure, list[Axes], tuple[int, int]]:
    """Return an empty plan of a toolpath [mm], with axes ``extra`` inches high below it, and the axes it shows."""
    lower, upper = toolpath.bounds
    i, j = plane_axes(upper - lower)
    width, height = np.maximum((upper - lower)[[i, j]], 1e-9)
    tall = float(np.clip(4.6 * height / width, 1.2, 7.0))
    figure = new_figure(5.2, 0.7 + tall + extra)
    parts = figure.add_gridspec(2 if extra else 1, 1, height_ratios=[tall, extra] if extra else None)
    plan = apply_style(figure.add_subplot(parts[0], aspect="equal"))
    plan.set(xlabel=f"{_AXES[i]} [mm]", ylabel=f"{_AXES[j]} [mm]")
    return figure, [plan, *([figure.add_subplot(parts[1])] if extra else [])], (i, j)


def plane_axes(extent: Array) -> tuple[int, int]:
    """Return the indices of the two axes of the largest extent, in their order."""
    i, j = sorted(np.argsort(-np.asarray(extent), kind="stable")[:2])
    return int(i), int(j)


def outline(contour: Contour) -> Array:
    """Return points of a contour [m], (k, 3), near enough for a picture."""
    parts = []
    for segment in contour.segments:
        u = np.linspace(0.0, 1.0, _CURVE_SAMPLES + 1)
        parts.append(segment.points if isinstance(segment, Polyline) else segment.point(u))
    points = np.concatenate(parts)
    return points[:: -(-len(points) // _MOST_POINTS)]


def _draw(axes: Axes, contour: Contour, i: int, j: int) -> None:
    """Draw a contour."""
    x, y = 1e3 * outline(contour)[:, [i, j]].T
    if contour.rapid:
        axes.plot(x, y, color=GREY, linewidth=0.7, linestyle=(0, (4, 3)), label="rapid")
    else:
        axes.plot(x, y, color=BLUE, label="cut")


def _number(axes: Axes, toolpath: Toolpath, i: int, j: int) -> None:
    """Number the start of each cut in the order of cutting; cuts that start at the same place share a label."""
    starts = 1e3 * np.array([contour.start for contour in toolpath.cuts])[:, [i, j]]
    if len(starts):
        axes.plot(*starts.T, "o", color=BLUE, markersize=3.5, label="start of a cut")
    if len(starts) > _MOST_NUMBERS:
        return
    labels: dict[tuple[float, ...], list[str]] = {}
    for rank, start in enumerate(starts):
        labels.setdefault(tuple(np.round(start, 3)), []).append(str(rank + 1))
    for start, ranks in labels.items():
        text, above = ", ".join(ranks), (4.0, 4.0)
        axes.annotate(text, (start[0], start[1]), above, textcoords="offset points", color=BLUE, fontsize=8)
