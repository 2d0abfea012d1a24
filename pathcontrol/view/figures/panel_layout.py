"""The layout of the panels of a figure: as large as the page lets them be with all their words on it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from pathcontrol.view.figures.formula_memory import remembered_formulas
from pathcontrol.view.figures.tick_memory import remembered_ticks

_PAD = 0.03  # in, around panels
_LAYOUTS, _SETTLED = 6, 5e-4  # at most so many, shares of the figure


class SettledLayout(ConstrainedLayoutEngine):
    """A constrained layout that is the same every time.

    With equal scales on both axes it is repeated until nothing moves: after the first time labels are off the page.
    """

    def __init__(self) -> None:
        super().__init__(w_pad=_PAD, h_pad=_PAD)

    def execute(self, fig: Any) -> None:
        """Move and resize the panels of a figure."""
        before = _places(fig)
        for _ in range(_LAYOUTS):
            with remembered_ticks(fig):
                super().execute(fig)
            places = _places(fig)
            if not _has_equal_scales(fig) or np.allclose(places, before, rtol=0.0, atol=_SETTLED):
                break
            before = places
        _round_places(fig)


@contextmanager
def laid_out(figure: Figure, dpi: float) -> Iterator[None]:
    """Lay a figure out once, for a picture of ``dpi``, and keep it for all files that are drawn inside."""
    engine, before = figure.get_layout_engine(), figure.dpi
    if not isinstance(engine, SettledLayout):
        yield
        return
    figure.dpi = dpi
    with remembered_formulas():
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


def _places(figure: Figure) -> list[tuple[float, ...]]:
    """Return the places of all panels, as shares of the figure."""
    return [axes.get_position(original=True).bounds for axes in figure.axes]


def _round_places(figure: Figure) -> None:
    """Round the places: the solver differs in the last bit, and names inside SVG files come from these numbers."""
    for axes in figure.axes:
        axes._set_position(np.round(axes.get_position(original=True).bounds, 9).tolist())  # type: ignore[attr-defined]
