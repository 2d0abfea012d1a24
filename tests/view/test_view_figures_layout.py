"""Figures of any run can be read: nothing is cut off, nothing lies over something else, no name is markup."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from lxml import etree
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from pathcontrol import (
    Ellipse,
    PathTask,
    Run,
    comparison_figure,
    error_bands_figure,
    error_figure,
    path_figure,
    phase_figure,
    speed_figure,
    tool_figure,
    torque_figure,
)
from pathcontrol.view.figures.formula_memory import remembered_formulas
from pathcontrol.view.figures.panel_layout import laid_out
from pathcontrol.view.figures.style import style

SVG = "{http://www.w3.org/2000/svg}"
NAMES = [
    "arm",
    "<b>&amp;</b>",
    "$x_1$",
    "_hidden",
    "a$b",
    "100 %",
    "a\\$b\\",
    "tab\tline\nend\x00",
    "W" * 90,
    "関節 ü",
    " ",
]


class Swing(PathTask):
    period = 2 * np.pi

    def __init__(self, joints, scale):
        self.joints, self.scale = joints, scale

    def q_d(self, s):
        return self.scale * np.sin(np.asarray(s)[..., None] * np.arange(1, self.joints + 1) + 0.3)

    def theta(self, s):
        return 1.0 + 0.0 * s


def made(n=2, samples=60, rollouts=1, seed=0, scale=1.0, unit="rad", joints=None, task=True) -> Run:
    """A run of ``n`` joints that swing."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(samples)
    names = [f"joint_{k}" for k in range(n)] if joints is None else joints
    swing = scale * np.sin(time[:, None] * np.arange(1, n + 1) + rng.normal(size=(rollouts, 1, n)))
    arrays = dict.fromkeys(("q", "qd", "q_measured", "qd_measured", "tau_demand", "tau", "e_p", "e_v"), swing + 0.0)
    arrays |= dict.fromkeys(("s", "sdot", "regular"), swing[..., 0] + 0.0)
    return Run.from_arrays(time, dict.fromkeys(names, unit), arrays, {}, task=Swing(n, scale) if task else None)


def makers(run, limits=None) -> dict[str, Callable[[], Figure]]:
    """All figures of a run, or of several by their names, that need no robot."""
    several = run if isinstance(run, dict) else {"run": run}
    found = {
        "phase": lambda: phase_figure(run),
        "errors": lambda: error_figure(run),
        "bands": lambda: error_bands_figure(run),
        "torque": lambda: torque_figure(run, limits),
        "speed": lambda: speed_figure(run),
        "comparison": lambda: comparison_figure(several, limits=limits),
    }
    if next(iter(several.values())).data.sizes["joint"] > 1:
        found["path"] = lambda: path_figure(run)
    return found


def figures(run, limits=None) -> dict[str, Figure]:
    return {name: make() for name, make in makers(run, limits).items()}


def words_of(figure: Figure) -> list[tuple[str, Bbox]]:
    """The words of a figure and where they stand on the page, which is laid out as for its files but not painted."""
    found, draw = [], Text.draw

    def note(text: Text, renderer: RendererBase) -> None:
        if text.get_visible() and text.get_text().strip():
            found.append((text.get_text(), text.get_window_extent(renderer)))
        draw(text, renderer)

    with style(), laid_out(figure, figure.dpi), pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", note)
        figure.draw_without_rendering()
    return [(word, box) for word, box in found if box.width > 0]


def assert_readable(figure: Figure, name: str) -> None:
    """Words are inside the figure and apart from each other."""
    page, found = figure.bbox.extents, words_of(figure)
    if not found:
        return
    texts, boxes = [text for text, _ in found], np.array([box.extents for _, box in found])
    low, high = boxes[:, :2], boxes[:, 2:]
    inside = (np.minimum(low - page[:2], page[2:] - high) > -1).all(axis=1)
    for i in np.flatnonzero(~inside):
        pytest.fail(f"{name}: {texts[i]} is cut off")
    overlap = np.minimum(high, high[:, None]) - np.maximum(low, low[:, None])  # of each two along both axes
    for i, k in np.argwhere(np.triu(~(overlap < 1).any(axis=-1), k=1)):
        pytest.fail(f"{name}: {texts[i]!r} lies over {texts[k]!r}")


def assert_units(figure: Figure, name: str) -> None:
    """Every axis that has numbers has a unit, itself or in the panel it shares its axis with."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            numbers = axis.get_tick_params()[f"label{'bottom' if axis is axes.xaxis else 'left'}"]
            assert not numbers or axis.get_label_text().endswith("]"), f"{name}: {axis.get_label_text()!r} has no unit"


@pytest.mark.parametrize(("n", "count"), [(1, 2), (2, 2), (7, 0)])
def test_words_stand_apart_and_axes_have_units(n, count):
    runs = {f"controller number {k}": made(n, seed=k, rollouts=3) for k in range(count)} or made(n)
    of_joints = {"phase", "torque", "comparison"}  # the others have as many panels for any number of joints
    for name, make in makers(runs, np.linspace(2.0, 200.0, n)).items():
        if n == 2 or name in of_joints:
            figure = make()
            assert_readable(figure, name)
            assert_units(figure, name)


@pytest.mark.parametrize(("size", "offset"), [(1e-7, 0.0), (1e-7, 123.456), (30.0, 123.456)])
def test_numbers_stand_apart(size, offset):
    run = made(3, scale=size)
    run.data["q"] += offset
    for name, figure in {"phase": phase_figure(run), "path": path_figure(run)}.items():
        assert_readable(figure, name)


@pytest.mark.parametrize("names", [NAMES[k : k + 3] for k in range(0, len(NAMES), 3)])
def test_names_are_words(names):
    """Names of joints and of runs, three at a time."""
    runs = {name: made(3, joints=[*names, "b"][:3], seed=k) for k, name in enumerate(names)}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")  # a font without the letter, no matter of ours
        for kind, figure in {"path": path_figure(runs), "torque": torque_figure(runs)}.items():
            assert_readable(figure, kind)
            file = io.BytesIO()
            figure.set_layout_engine("none")  # it is laid out
            with style(), remembered_formulas():
                figure.savefig(file, format="svg")
            words = ["".join(node.itertext()) for node in etree.fromstring(file.getvalue()).iter(f"{SVG}text")]
            for name in names:
                letters = "".join(c if c.isprintable() else " " for c in name).strip()
                if len(letters) < 20:
                    assert any(letters.split() == word.split() for word in words) or not letters, f"{kind}: {words}"


@pytest.mark.parametrize("unit", ["rad", "m", "mixed"])
def test_units_are_those_of_the_joints(unit):
    run = made(3, unit="rad" if unit == "mixed" else unit)
    if unit == "mixed":
        kinds = {"a": "rad", "b": "m", "c": "rad"}
        run = Run.from_arrays(run.time, kinds, {name: run.array(name) for name in run.data.data_vars}, {})
    expected = {"rad": "[deg]", "m": "[m]", "mixed": "[rad or m]"}[unit]
    assert path_figure(run).axes[0].get_xlabel().endswith(expected)
    assert error_figure(run).axes[0].get_ylabel().endswith(expected)
    torque = {"rad": "[N m]", "m": "[N]", "mixed": "[N m or N]"}[unit]
    assert torque_figure(run).axes[0].get_ylabel().endswith(torque)


ODD = [0.0, -1.0, 1e-300, 1e5, -1e9, 1e40, 1e200, 1.7e308, np.nan, np.inf, -np.inf]


@settings(max_examples=10, phases=(Phase.explicit, Phase.generate))  # to shrink pictures takes minutes
@given(st.integers(0, 10**6), st.integers(1, 3), st.sampled_from([1, 2, 3, 40]), st.integers(1, 3))
def test_odd_runs_are_drawn(seed, n, samples, rollouts):
    """One sample, no number anywhere, numbers that no axis holds: a figure all the same."""
    run, rng = made(n, samples, rollouts), np.random.default_rng(seed)
    few = rng.choice(ODD, rng.integers(1, len(ODD) + 1))
    for name in ("q", "qd", "tau", "e_p", "e_v", "s", "sdot"):
        run.data[name] = run.data[name].copy(data=rng.choice(few, run.array(name).shape))
    limits = [None, np.full(n, 1e3), np.full(n, np.inf)][seed % 3]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = makers(run, limits)
        figure = found[sorted(found)[seed % len(found)]]()
        with style(), laid_out(figure, figure.dpi):
            FigureCanvasAgg(figure).draw()


def test_what_does_not_move_is_drawn():
    run = made(2)
    for name in run.data.data_vars:
        run.data[name] *= 0.0
    for name, figure in figures(run).items():
        assert_readable(figure, name)


def test_the_first_drawing_is_as_good_as_the_second(arm, monkeypatch):
    """Whatever is written first, SVG or PNG, has its labels where they belong, after few layouts."""
    own, layouts = ConstrainedLayoutEngine.execute, []
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda *of: (layouts.append(name), own(*of)))
    several = {name: made(2, scale=scale) for name, scale in (("a name that is long", 1.0), ("b", 1.6))}
    found = makers(several) | {"tool": lambda: tool_figure(several, arm)}
    # panels of free shapes, with equal scales, which are laid out until they rest, and both
    for name, near in (("errors", 1e-3), ("path", 1e-5), ("tool", 1e-5), ("comparison", 1e-3)):
        figure, places = found[name](), []
        for _ in range(2):
            with style():
                figure.draw_without_rendering()
            places.append([axes.get_position(original=True).bounds for axes in figure.axes])
            assert layouts.count(name) <= 5 * len(places), name
        np.testing.assert_allclose(places[0], places[1], rtol=0, atol=near, err_msg=name)


def test_an_ellipse_that_is_nearly_a_line_keeps_its_shape():
    """Scales are equal, so the panel grows instead."""
    s = np.linspace(0, 6, 300)
    task = Ellipse((1.0, 0.01), 1.0)
    run = made(2, samples=300)
    run.data["q"] = run.data["q"].copy(data=task.q_d(s)[None])
    axes = path_figure(run, task).axes[0]
    assert axes.get_aspect() == 1.0
    assert np.ptp(axes.get_ylim()) > 0.4 * np.ptp(axes.get_xlim())
