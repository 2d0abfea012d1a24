"""Figure and page of a comparison: what was measured, with the event where it was."""

from __future__ import annotations

import dataclasses
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
def calm():
    return pc.compare("projection", "undisturbed", rollouts=1, progress=False)


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


def test_what_is_no_comparison_or_is_one_is_told(calm, tmp_path):
    with pytest.raises(pc.InputError, match="expected a Comparison"):
        pc.save_comparison(calm.runs["projection"], tmp_path / "page.html")
    with pytest.raises(pc.InputError, match=r"is a Comparison.*scenario_figure"):
        pc.comparison_figure(calm)


def test_without_an_event_all_of_the_run_is_drawn(calm):
    axes = pc.scenario_figure(calm).axes[0]
    assert axes.get_xlim() == pytest.approx((0.0, 10.0))
    assert not axes.patches


def test_the_table_of_the_page_is_that_of_the_terminal(jam, page):
    told = html.document_fromstring(page.read_text(encoding="utf-8"))
    rows = [[cell.text_content() for cell in row] for row in told.xpath("//table[contains(@class, 'report')]//tr")]
    assert rows == tabulate(jam)
    notes = [note.text_content() for note in told.xpath("//p[@class='note']")]
    assert notes == describe_comparison(jam)
    best = [cell.text_content() for cell in told.xpath("//td[@class='best']")]
    assert best == [cell for row in rows for cell in row if "*" in cell]
    assert any("±" in cell for cell in best)


def test_charts_and_slider_of_the_page_mark_the_event(page):
    with opened(page, (1440, 900), "#t=0") as film:
        over, band = (film.tab.locator(f".chart .u-over {more}").first.bounding_box() for more in ("", ".event"))
        assert (band["x"] - over["x"]) / over["width"] == pytest.approx(0.40, abs=0.01)
        assert band["width"] / over["width"] == pytest.approx(0.06, abs=0.01)
        assert band["height"] == pytest.approx(over["height"], abs=1)
        assert film.tab.locator("#track .event").count() == 1
        slider, band = (film.tab.locator(f"#track {part}").bounding_box() for part in ("#scrubber", ".event"))
        assert (band["x"] - slider["x"] - 8) / (slider["width"] - 16) == pytest.approx(0.40, abs=0.01)
        assert band["width"] / (slider["width"] - 16) == pytest.approx(0.06, abs=0.01)
        assert slider["y"] < band["y"] < band["y"] + band["height"] < slider["y"] + slider["height"]
        assert film.complaints == []


def test_an_event_that_outlasts_the_film_is_marked_up_to_its_end(tmp_path):
    unlimited = dataclasses.replace(pc.make_scenario("jammed-joint"), loop=pc.SampledLoop(0.01))
    wild = {"wild": lambda arm, task: pc.Projection(arm, task, 1e6, 2e3)}
    with pytest.warns(pc.PathControlWarning, match="unstable"):
        compared = pc.compare(wild, unlimited, rollouts=1, progress=False)
    assert compared.runs["wild"].time[-1] < 4.0  # it has diverged
    with opened(pc.save_comparison(compared, tmp_path / "page.html"), (1000, 700), "#t=0") as film:
        slider, band = (film.tab.locator(f"#track {part}").bounding_box() for part in ("#scrubber", ".event"))
        assert band["x"] + band["width"] == pytest.approx(slider["x"] + slider["width"] - 8, abs=0.5)


def test_a_page_without_an_event_has_none_and_another_name_is_refused(calm, tmp_path):
    with pytest.raises(pc.InputError, match=r"\.html"):
        pc.save_comparison(calm, tmp_path / "page.pdf")
    with opened(pc.save_comparison(calm, tmp_path / "page.html"), (1000, 700), "#t=0") as film:
        assert film.tab.locator(".event").count() == 0
        assert film.complaints == []


def with_measures(jam, **values):
    """The comparison with other numbers of the measures, for each law one number."""
    measures = {
        law: dict(jam.measures[law]) | {name: np.full(2, numbers[k]) for name, numbers in values.items()}
        for k, law in enumerate(jam.measures)
    }
    return dataclasses.replace(jam, measures=measures)


def test_rounding_is_nothing_and_what_all_laws_share_is_not_the_best(jam):
    """A number that is rounding beside those of others is 0, and a star is nowhere if it were everywhere."""
    made = with_measures(jam, lag_peak=(0.5, 2e-7), energy_j=(120.0, 1e-4), saturated_s=(0.0, 0.0), recovery_s=(3, 3))
    rows = {row[0].rpartition(" ")[0]: row[1:] for row in tabulate(made)}
    assert [cell.split()[0] for cell in rows["lag peak"]] == ["28.6", "0*"]
    assert rows["energy"] == ["120", "0*"]
    assert rows["saturated"] == ["0", "0"]
    assert rows["recovery"] == ["3.00", "3.00"]
    assert with_measures(jam, lag_peak=(0.0, 1e-9)).best("lag_peak") == LAWS
    apart = with_measures(jam, lag_peak=(1.0, 1e-3))
    assert apart.best("lag_peak") == ["projection"]


def test_names_and_counts_are_as_a_reader_has_them(jam, calm):
    held = {field: getattr(calm, field)["projection"] for field in ("laws", "runs", "undisturbed", "measures")}
    names = ["pd_plus", "adaptive_slotine_li"]
    one = dataclasses.replace(calm, **{field: dict.fromkeys(names, of) for field, of in held.items()})
    assert tabulate(one)[0] == ["", "PD+", "adaptive Slotine–Li"]
    assert [line for line in describe_comparison(one) if "one start" in line]
    assert not any("deviation" in line for line in describe_comparison(one))
    assert "of 2 starts" in describe_comparison(jam)[0]


def test_the_figure_of_the_page_is_as_wide_as_the_page(jam):
    wide, narrow = (pc.scenario_figure(jam, wide=wide) for wide in (True, False))
    assert wide.get_figwidth() > 3 * narrow.get_figwidth()
    for one, other in zip(wide.axes, narrow.axes, strict=True):
        for line, same in zip(one.lines, other.lines, strict=True):
            np.testing.assert_array_equal(line.get_xydata(), same.get_xydata())
