"""Where the panels of a figure lie: as large as the page lets them be with all their words on it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

_PAD = 0.03  # in, around panels


class SettledLayout(ConstrainedLayoutEngine):
    """A constrained layout that is the same every time, panels with equal scales included.

    Matplotlib's own finds room at the sides of a panel with equal scales, and puts its labels off the page.
    """

    def __init__(self) -> None:
        super().__init__(w_pad=_PAD, h_pad=_PAD)

    def execute(self, fig: Any) -> None:
        """Move and resize the panels of a figure."""
        with _stretched(fig):
            super().execute(fig)
        _round_places(fig)


@contextmanager
def laid_out(figure: Figure, dpi: float) -> Iterator[None]:
    """Lay a figure out once, for a picture of so many ``dpi``, and keep it so for all files that are drawn inside."""
    engine, before = figure.get_layout_engine(), figure.dpi
    if not isinstance(engine, SettledLayout):
        yield
        return
    figure.dpi = dpi
    engine.execute(figure)
    figure.set_layout_engine(None)
    try:
        yield
    finally:
        figure.set_layout_engine(engine)
        figure.dpi = before


@contextmanager
def _stretched(figure: Figure) -> Iterator[None]:
    """Inside, panels with equal scales fill their place, so that labels are measured where the room is tight."""
    aspects = {axes: axes.get_aspect() for axes in figure.axes if axes.get_aspect() != "auto"}
    for axes in aspects:
        axes.set_aspect("auto")
    try:
        yield
    finally:
        for axes, aspect in aspects.items():
            axes.set_aspect(aspect)


def _round_places(figure: Figure) -> None:
    """The solver differs in the last bit from draw to draw, and names inside SVG files come from these numbers."""
    for axes in figure.axes:
        axes._set_position(np.round(axes.get_position(original=True).bounds, 9).tolist())  # type: ignore[attr-defined]
