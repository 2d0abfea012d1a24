"""A figure is laid out once for all its files, with every word on the page, and its numbers are plain text."""

from __future__ import annotations

import re
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from io import BytesIO
from itertools import combinations, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.axis import Axis, XAxis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text
from test_pareto import table as front_table
from test_sweep_figures import table as sweep_table
from test_view_figures_layout import assert_readable, made, makers

from pathcontrol import (
    Circle,
    basin_figure,
    pareto_figure,
    read_toolpath,
    robustness_figure,
    save_figure,
    tool_figure,
    toolpath_figure,
)
from pathcontrol.view.figures import formula_memory, text_memory
from pathcontrol.view.figures.formula_memory import remembered_formulas
from pathcontrol.view.figures.style import apply_style, new_figure, style
from pathcontrol.view.figures.text_memory import remembered_texts
from pathcontrol.view.figures.tick_memory import METHODS, remembered_ticks

FORMATS = ["png", "svg", "pdf"]
MINUS = "−"  # as figures write it


def wide_table():
    data = sweep_table().assign_coords(k=("sample", np.geomspace(1.0, 1e4, 30)))
    data["e_p_peak"] = ("sample", np.geomspace(1e-3, 1e2, 30), {"units": "rad"})
    return data


def tiny_table():
    data = front_table()
    data["b"] = 1e-6 * data["b"]
    return data


@pytest.fixture(scope="module")
def rectangle(tmp_path_factory):
    """Makes the figure of a rectangle of some width and height [mm] that is cut."""
    folder = tmp_path_factory.mktemp("drawings")

    def draw(width, height):
        path = folder / f"{width} {height}.nc"
        path.write_text(f"G21 G90\nG0 X0 Y0\nG1 X{width} F600\nG1 Y{height}\nG1 X0\nG1 Y0\n")
        return toolpath_figure(read_toolpath(path.rename(path.with_suffix(".gcode"))))

    return draw


OF_TABLES = {
    "basin": lambda: basin_figure(sweep_table(), "q[0]", "q[1]", "e_p_peak"),
    "basin, wide": lambda: basin_figure(wide_table(), "k", "q[1]", "e_p_peak"),
    "spread": lambda: robustness_figure(sweep_table((0, 7)), "q[0]", "e_p_peak"),
    "spread, wide": lambda: robustness_figure(wide_table(), "k", "e_p_peak"),
    "front": lambda: pareto_figure(front_table(), "e_p_peak", "b", colour="k"),
    "front, tiny": lambda: pareto_figure(tiny_table(), "e_p_peak", "b", colour="k"),
}


@pytest.mark.parametrize("name", OF_TABLES)
def test_words_of_sweeps_are_on_the_page_and_apart(name):
    assert_readable(OF_TABLES[name](), name)


@pytest.mark.parametrize("size", [(200, 20), (20, 200), (70, 71), (0.02, 0.01), (900, 1000)])
def test_words_of_drawings_are_on_the_page_and_apart(size, rectangle):
    assert_readable(rectangle(*size), str(size))


@pytest.mark.parametrize("errors", [False, True])
def test_words_of_tools_are_on_the_page_and_apart(errors, arm):
    run = made(2, samples=200, scale=1.1, task=False)
    assert_readable(tool_figure(run, arm, Circle(1.0, 2.0), errors=errors), "tool")


class Saved(NamedTuple):
    """A figure that was saved in all formats: how its layout was before, where its panels were, and its files."""

    figure: Figure
    before: tuple
    places: list
    files: list[Path]


# with equal scales, and free ones, for which two formats are enough
@pytest.fixture(scope="module", params=[("path", FORMATS), ("errors", FORMATS[:2])], ids=lambda param: param[0])
def saved(request, tmp_path_factory) -> Saved:
    (kind, formats), places = request.param, []
    figure = makers(made(3, scale=1.3))[kind]()
    before = figure.get_layout_engine(), figure.dpi
    figure.canvas.mpl_connect("draw_event", lambda _: places.append([a.get_position().bounds for a in figure.axes]))
    files = save_figure(figure, tmp_path_factory.mktemp("saved") / kind, formats)
    return Saved(figure, before, places, files)


def test_all_formats_have_one_layout_and_the_figure_keeps_its_own(saved):
    assert len(saved.places) >= 1
    assert all(np.array_equal(place, saved.places[0]) for place in saved.places)
    assert (saved.figure.get_layout_engine(), saved.figure.dpi) == saved.before


def test_figures_of_others_are_laid_out_as_they_say(tmp_path):
    figure = Figure(layout="tight")
    figure.add_subplot().set_ylabel("a tall label", fontsize=40)
    engine = figure.get_layout_engine()
    save_figure(figure, tmp_path / "theirs")
    assert figure.get_layout_engine() is engine
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    assert figure.axes[0].yaxis.label.get_window_extent().x0 > 0


def test_a_figure_that_is_changed_is_laid_out_again(tmp_path):
    figure = makers(made(2))["errors"]()
    save_figure(figure, tmp_path / "before", ["svg"])
    figure.axes[0].set_ylabel("much\ntaller\nthan\nit was")
    save_figure(figure, tmp_path / "after", ["svg"])
    assert_readable(figure, "changed")


def test_what_is_remembered_changes_no_byte_and_leaves_matplotlib_as_it_was(saved, tmp_path, monkeypatch):
    for name in ("remembered_ticks", "remembered_formulas", "remembered_texts"):
        monkeypatch.setattr(f"pathcontrol.view.figures.panel_layout.{name}", lambda *_: nullcontext())
    kind = saved.files[0].stem
    found = save_figure(makers(made(3, scale=1.3))[kind](), tmp_path / kind, [file.suffix[1:] for file in saved.files])
    assert [file.read_bytes() for file in saved.files] == [file.read_bytes() for file in found]
    axes = saved.figure.findobj(Axis)
    assert axes
    assert not any(name in vars(axis) for axis in axes for name in METHODS)
    assert MathTextParser._parse_cached is formula_memory._parse
    assert Text._get_layout is text_memory._measure
    assert text_memory._measured == {}


def test_texts_are_measured_again_where_they_look_different(monkeypatch):
    monkeypatch.setattr(text_memory, "_MOST", 12)
    looks = [{}, {"fontsize": 20}, {"ha": "right"}, {"va": "top"}, {"ma": "right"}, {"linespacing": 3.0}]
    looks += [{"rotation": 30}, {"rotation": 30, "rotation_mode": "anchor"}, {"parse_math": False}, {"wrap": True}]
    figure = Figure(figsize=(2.0, 1.0))
    renderer = FigureCanvasAgg(figure).get_renderer()
    texts = [figure.text(0.6, 0.5, "$x$ and\nmuch more of it", **look) for look in looks]

    def measure(dpi, first):
        figure.dpi = dpi
        texts[0].set_text(first)
        found = [text.get_window_extent(renderer) and text._get_layout(renderer) for text in texts]
        return [(box.bounds, lines, corner) for box, lines, corner in found]

    changes = list(product((100, 200), ("one", "another")))
    with style():
        own = [measure(*change) for change in changes]
        with remembered_texts():
            assert [measure(*change) for change in changes] == own
            assert measure(*changes[-1]) == own[-1]
            assert len(text_memory._measured) <= 12
    for found in own:
        assert all(one != other for one, other in combinations(found, 2))


def test_a_formula_is_parsed_once_for_all_files_but_for_each_size_and_thread(monkeypatch):
    own, asked = formula_memory._parse, []
    monkeypatch.setattr(formula_memory, "_parsed", {})
    monkeypatch.setattr(formula_memory, "_parse", lambda *how: asked.append(how) or own(*how))

    def draw(size=8.0):
        with style(), remembered_formulas():
            for _ in range(2):
                figure = Figure()
                figure.text(0.5, 0.5, "$\\dot{q}_1$", fontsize=size)
                figure.savefig(BytesIO(), format="svg")
        return len(asked)

    of_one = draw()
    assert of_one > 0
    assert draw() == of_one
    larger = draw(size=9.0)
    assert larger > of_one
    with ThreadPoolExecutor(1) as other:
        assert other.submit(draw).result() == larger + of_one
    monkeypatch.setattr(formula_memory, "_MOST", 2)
    draw(size=10.0)
    assert len(formula_memory._parsed) <= 2


def read(ticks, boxes):
    return [(tick.get_loc(), tick.label1.get_text()) for tick in ticks], [box.bounds for box in boxes[0]]


def test_ticks_are_found_again_where_an_axis_has_moved():
    figure, axes = panel(0.0, 1.0)
    changes = {
        "range": lambda: axes.set_xlim(0.0, 50.0),
        "place": lambda: axes.set_position((0.3, 0.3, 0.2, 0.6)),
        "size": lambda: figure.set_size_inches(9.0, 3.0),
        "dpi": lambda: figure.set_dpi(300),
    }
    axis, renderer = axes.xaxis, figure.canvas.get_renderer()
    with style(), remembered_ticks(figure):
        for name, change in changes.items():
            before = axis._update_ticks()
            assert axis._update_ticks() is before, name
            change()
            ticks = axis._update_ticks()
            assert ticks is not before, name
            remembered, again = axis._get_ticklabel_bboxes(ticks, renderer), XAxis._update_ticks(axis)
            assert read(ticks, remembered) == read(again, XAxis._get_ticklabel_bboxes(axis, again, renderer)), name


def panel(low, high):
    """A panel from ``low`` to ``high`` both ways."""
    with style():
        figure = new_figure(3.0, 3.0)
        axes = apply_style(figure.add_subplot())
        axes.set(xlim=(low, high), ylim=(low, high))
    return figure, axes


@settings(max_examples=12, deadline=None)
@given(middle=st.floats(-1e6, 1e6), half=st.floats(1e-9, 1e9))
def test_numbers_are_plain_text_and_are_what_they_stand_at(middle, half):
    half = max(half, 1e-6 * abs(middle))
    figure, axes = panel(middle - half, middle + half)
    with style(), warnings.catch_warnings():
        warnings.simplefilter("error")
        for axis in (axes.xaxis, axes.yaxis):
            axis.get_tightbbox(figure.canvas.get_renderer())  # writes its numbers as they are drawn
            found = [
                (p, t.get_text()) for p, t in zip(axis.get_majorticklocs(), axis.get_majorticklabels(), strict=True)
            ]
            power = axis.get_offset_text().get_text()
            assert "$" not in "".join(text for _, text in found)
            scale = 10.0 ** float(re.search(r"\^\{(.*?)\}", power)[1].replace(MINUS, "-")) if power else 1.0
            step = np.diff(axis.get_majorticklocs()).min()
            for place, text in found:
                if text:
                    assert float(text.replace(MINUS, "-")) * scale == pytest.approx(place, rel=1e-6, abs=1e-3 * step)


def test_a_power_of_ten_is_written_once():
    figure, axes = panel(0.0, 3e-6)
    with style():
        FigureCanvasAgg(figure).draw()
    assert [t.get_text() for t in axes.get_xticklabels()] == ["0", "1", "2", "3"]
    assert "10^{" + MINUS + "6}" in axes.xaxis.get_offset_text().get_text()
