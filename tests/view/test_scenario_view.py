"""Figure and page of a comparison: what was measured, with the event where it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import opened
from lxml import html

import pathcontrol as pc
from pathcontrol.comparison.comparison_table import describe_comparison, tabulate

LAWS = ["computed_torque", "projection"]


@pytest.fixture(scope="module")
def jam():
    return pc.compare(LAWS, "jammed-joint", rollouts=2, progress=False)


@pytest.fixture(scope="module")
def page(jam, tmp_path_factory) -> Path:
    return pc.save_comparison(jam, tmp_path_factory.mktemp("page") / "comparison.html")


def test_the_figure_draws_the_measures_of_each_law_around_the_event(jam):
    contour, lag, speed = pc.scenario_figure(jam, rollout=1).axes
    assert contour.get_xlim() == pytest.approx((3.7, 6.4))
    for k, law in enumerate(LAWS):
        for axes, name in ((contour, "contour_peak"), (lag, "lag_peak"), (speed, "speed_peak")):
            time, drawn = axes.lines[k].get_data()
            peak = np.abs(drawn[time >= 4.0 - 1e-9]).max()
            assert peak == pytest.approx(np.rad2deg(jam.measures[law][name][1]), rel=1e-6, abs=1e-9)
            assert axes.get_ylim()[1] > 0
    for axes in (contour, lag, speed):
        (band,) = axes.patches
        assert band.get_x() == pytest.approx(4.0)
        assert band.get_width() == pytest.approx(0.6)
    with pytest.raises(pc.InputError, match="rollout 2"):
        pc.scenario_figure(jam, rollout=2)
    with pytest.raises(pc.InputError, match="Comparison"):
        pc.scenario_figure(jam.runs["projection"])


def test_without_an_event_all_of_the_run_is_drawn():
    calm = pc.compare("projection", "undisturbed", rollouts=1, progress=False)
    axes = pc.scenario_figure(calm).axes[0]
    assert axes.get_xlim() == pytest.approx((0.0, 10.0))
    assert not axes.patches


def test_the_table_of_the_page_is_that_of_the_terminal(jam, page):
    told = html.document_fromstring(page.read_text(encoding="utf-8"))
    rows = [[cell.text_content() for cell in row] for row in told.xpath("//table[contains(@class, 'report')]//tr")]
    assert rows == tabulate(jam)
    notes = [note.text_content() for note in told.xpath("//p[@class='note']")]
    assert notes == describe_comparison(jam)
    best = told.xpath("//td[@class='best']")
    assert best
    assert all(cell.text_content().endswith("*") for cell in best)


def test_charts_of_the_page_mark_the_event(page):
    with opened(page, (1440, 900), "#t=0") as film:
        over, band = (film.tab.locator(f".chart .u-over {more}").first.bounding_box() for more in ("", ".event"))
        assert (band["x"] - over["x"]) / over["width"] == pytest.approx(0.40, abs=0.01)
        assert band["width"] / over["width"] == pytest.approx(0.06, abs=0.01)
        assert band["height"] == pytest.approx(over["height"], abs=1)
        assert film.complaints == []


def test_a_page_without_an_event_has_none_and_another_name_is_refused(tmp_path):
    calm = pc.compare("projection", "undisturbed", rollouts=1, progress=False)
    with pytest.raises(pc.InputError, match=r"\.html"):
        pc.save_comparison(calm, tmp_path / "page.pdf")
    with opened(pc.save_comparison(calm, tmp_path / "page.html"), (1000, 700), "#t=0") as film:
        assert film.tab.locator(".event").count() == 0
        assert film.complaints == []
