"""The layout of the panels of a figure: as large as the page lets them be with all their words on it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from pathcontrol._arrays import Array
from pathcontrol.view.figures.formula_memory import remembered_formulas
from pathcontrol.view.figures.text_memory import remembered_texts
from pathcontrol.view.figures.tick_memory import remembered_ticks

_PAD = 0.03  # in, around panels
_LAYOUTS, _SETTLED = 8, 5e-4  # at most so many, shares of the figure


class SettledLayout(ConstrainedLayoutEngine):
    """A constrained layout that is the same every time.

    With equal scales on both axes it is repeated until nothing moves: after the first time labels are off the page.
    """

    def __init__(self) -> None:
        super().__init__(w_pad=_PAD, h_pad=_PAD)

    def execute(self, fig: Any) -> None:
        """Move and resize the panels of a figure."""
        before, ahead = _places(fig), np.zeros(())
        for _ in range(_LAYOUTS):
            with remembered_ticks(fig):
                super().execute(fig)
            places = _places(fig)
            if not _has_equal_scales(fig) or np.allclose(places, before, rtol=0.0, atol=_SETTLED):
                break
            # not twice in a row, as from beyond their end panels come back at once
            ahead = 0.0 * places if ahead.any() else _still_to_go(places - before)
            before = places + ahead
            _set_places(fig, before)
        # the solver differs in the last bit, and names inside SVG files come from these numbers
        _set_places(fig, np.round(_places(fig), 9))


@contextmanager
def laid_out(figure: Figure, dpi: float) -> Iterator[None]:
    """Lay a figure out once, for a picture of ``dpi``, and keep it for all files that are drawn inside."""
    engine, before = figure.get_layout_engine(), figure.dpi
    if not isinstance(engine, SettledLayout):
        yield
        return
    figure.dpi = dpi
    with remembered_formulas(), remembered_texts():
        engine.execute(figure)
        figure.set_layout_engine(None)
        try:
            with remembered_ticks(figure):
                yield
        finally:
            figure.set_layout_engine(engine)
            figure.dpi = before


def _has_equal_scales(figure: Figure) -> bool:
    """Return whether a panel has a fixed shape, and does not fill its place."""
    return any(axes.get_aspect() != "auto" for axes in figure.axes)


def _places(figure: Figure) -> Array:
    """Return the places of all panels (panel, 4), as shares of the figure."""
    return np.array([axes.get_position(original=True).bounds for axes in figure.axes])


def _still_to_go(moved: Array) -> Array:
    """Return how far panels go on that have ``moved`` (panel, 4), their low edges and their sizes.

    Where an edge moves alone it goes half of the rest with each of the two layouts that Matplotlib makes at once, so
    that each move is a quarter of the last one; of places from which both edges move the next moves are others.
    """
    low, high = moved[:, :2], moved[:, :2] + moved[:, 2:]
    return moved / 3 if np.allclose(low * high, 0.0, rtol=0.0, atol=_SETTLED**2) else 0.0 * moved


def _set_places(figure: Figure, places: Array) -> None:
    """Put the panels in their places."""
    for axes, place in zip(figure.axes, places, strict=True):
        axes._set_position(place.tolist())  # type: ignore[attr-defined]
