"""Numbers along linear horizontal axes stand apart, however many figures they have."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.view.figures.style import apply_style, new_figure, style


@settings(deadline=None)
@given(offset=st.floats(-5e3, 5e3), span=st.floats(0.01, 1.0), width=st.floats(1.2, 4.0))
def test_numbers_with_many_figures_do_not_touch(offset, span, width):
    with style():
        figure = new_figure(width, 1.0)
        figure.set_layout_engine("none")
        axes = apply_style(figure.add_axes((0.1, 0.4, 0.8, 0.5)))
        axes.set_xlim(offset, offset + span)
        axes.xaxis.get_tightbbox(figure.canvas.get_renderer())  # puts its numbers where they are drawn
        shown = [label for label in axes.get_xticklabels() if label.get_text()]
        boxes = sorted((label.get_window_extent().x0, label.get_window_extent().x1) for label in shown)
    inside = [box for box in boxes if axes.bbox.x0 <= sum(box) / 2 <= axes.bbox.x1]
    assert inside
    assert all(before[1] < after[0] for before, after in pairwise(inside))
