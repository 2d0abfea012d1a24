"""Numbers along logarithmic axes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from pathcontrol.view.figures.style import apply_style, new_figure, style
from pathcontrol.view.figures.ticks import label_plainly


def labels(low, high):
    """Positions and words along an axis from one value to another."""
    axes = Figure().add_subplot()
    axes.set(xscale="log", xlim=(low, high))
    label_plainly(axes.xaxis)
    axis, found = axes.xaxis, []
    for ticker in (axis.major, axis.minor):
        places = [place for place in ticker.locator() if low <= place <= high]
        found += [pair for pair in zip(places, ticker.formatter.format_ticks(places), strict=True) if pair[1]]
    return found


@settings(max_examples=15, deadline=None)
@given(low=st.floats(1e-3, 100), decades=st.floats(0.2, 1.9))
def test_numbers_near_1_are_written_out_and_are_what_they_stand_at(low, decades):
    found = labels(low, low * 10**decades)
    assert found
    for place, text in found:
        assert float(text) == pytest.approx(place, rel=1e-9)


def test_numbers_far_from_1_are_powers_of_ten():
    found = dict(labels(1e-6, 1e7))
    assert any("^{6}" in text for text in found.values())
    assert all("mathdefault" not in text for place, text in found.items() if 1e-3 <= place < 1e4)
    assert np.isclose(min(found), 1e-6)


@settings(max_examples=25, deadline=None)
@given(low=st.floats(1e-2, 100), decades=st.floats(0.15, 4), width=st.floats(1.2, 5))
def test_numbers_along_a_horizontal_axis_do_not_touch(low, decades, width):
    with style():
        figure = new_figure(width, 1.0)
        figure.set_layout_engine("none")
        axes = apply_style(figure.add_axes((0.1, 0.4, 0.8, 0.5)))
        axes.set(xscale="log", xlim=(low, low * 10**decades))
        apply_style(axes)
        axes.xaxis.set_major_locator(LogLocator())
        axes.xaxis.get_tightbbox(figure.canvas.get_renderer())  # puts its numbers where they are drawn
        shown = [label for label in axes.get_xticklabels(which="both") if label.get_text()]
        boxes = sorted((label.get_window_extent().x0, label.get_window_extent().x1) for label in shown)
    assert len({label.get_fontsize() for label in shown}) <= 1
    inside = [box for box in boxes if axes.bbox.x0 <= sum(box) / 2 <= axes.bbox.x1]
    assert all(right <= left for (_, right), (left, _) in pairwise(inside)), boxes
