"""The memory of ticks: those of an axis that rests are found once while a figure is laid out or drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

#: of an axis, Matplotlib's own; without them nothing is remembered
METHODS = ("_update_ticks", "_get_ticklabel_bboxes")


@contextmanager
def remembered_ticks(figure: Figure) -> Iterator[None]:
    """Find ticks and the boxes of their labels again only for axes that have moved; nothing else may change inside.

    Matplotlib finds them three times whenever it measures or draws an axis, and again for each axis with which its
    label is aligned.
    """
    axes = _with_insets(figure.axes)
    places = [
        (axis, name) for one in axes for axis in (one.xaxis, one.yaxis) for name in METHODS if hasattr(axis, name)
    ]
    for axis, name in places:
        setattr(axis, name, _remember(axis, getattr(axis, name)))
    try:
        yield
    finally:
        for axis, name in places:
            delattr(axis, name)


def _with_insets(panels: Iterable[Any]) -> Iterator[Axes]:
    """Yield some axes and those inside them; to look through all of their parts would make ticks that are not drawn."""
    for axes in panels:
        yield axes
        yield from _with_insets(axes.child_axes)


def _remember(axis: Any, find: Callable[..., Any]) -> Callable[..., Any]:
    """Return ``find`` with a memory of its last result, for the place of an axis, its range, and the renderer."""
    last: list[Any] = [None, None]

    def found(*args: Any) -> Any:
        # boxes are those of the ticks that the axis has now, and depend on the renderer after them
        state = (axis.axes.bbox.bounds, tuple(axis.get_view_interval()), axis.axes.figure.dpi, *args[1:])
        if state != last[0]:
            last[:] = state, find(*args)
        return last[1]

    return found
