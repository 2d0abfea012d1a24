"""The panels of a figure that has one for each joint, over time."""

from __future__ import annotations

from collections.abc import Iterator

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pathcontrol.view.figures.style import COLUMN, PAGE, apply_style, new_figure

_TALL_COLUMN = 3  # panels


def figure_of_joints(joints: int) -> Figure:
    """Return a new figure with room for a panel for each joint: one column of them, or two for many joints."""
    return new_figure(COLUMN if _columns(joints) == 1 else PAGE, 0.6 + 1.35 * _rows(joints))


def joint_panels(figure: Figure, joints: int) -> Iterator[Axes]:
    """Yield the panel of each joint, to be drawn before the next; the lowest of a column have the axis of time."""
    rows, columns = _rows(joints), _columns(joints)
    for k in range(joints):
        # down the columns, so that neighbours on the page are neighbours on the arm
        axes = apply_style(figure.add_subplot(rows, columns, 1 + columns * (k % rows) + k // rows))
        yield axes
        last = k % rows == rows - 1 or k == joints - 1
        axes.set_xlabel("time [s]" if last else "")
        axes.tick_params(labelbottom=last)
    figure.align_ylabels()


def _columns(joints: int) -> int:
    """Return the number of columns."""
    return 1 if joints <= _TALL_COLUMN else 2


def _rows(joints: int) -> int:
    """Return the number of rows."""
    return -(-joints // _columns(joints))
