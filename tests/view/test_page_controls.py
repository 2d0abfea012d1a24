"""What a user does with the page: buttons, keys, charts, light and dark, paper and a telephone."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import FINE, Opened, opened
from markupsafe import Markup
from test_view_browser import DURATION, numbers, saved, short_run

from pathcontrol import Circle, RobotModel, record
from pathcontrol.view.animation.animation import Animation
from pathcontrol.view.page.html import Section, page

PHONE: dict[str, Any] = {"size": (390, 844), "has_touch": True, "is_mobile": True}
CELLS = ["line 8", "rapid", "not finished", "1.234e-05 m", "−17.25", "100 %", "8.886e+04", "12.3 deg/s", "0.4567"]
TABLE = {"title": "Contours", "columns": ["contour", *["mean speed [mm/s]"] * 8], "rows": [CELLS] * 3}
SECTIONS = [Section(f"Part {i}", Markup(f'<p style="height: 40rem">text {i}</p>')) for i in range(3)]


@pytest.fixture(scope="module")
def animation(arm: RobotModel, circle: Circle) -> Animation:
    run = short_run(arm, circle)
    recorded = record({"first": run, "second": run}, arm, circle)
    header = recorded.film.header
    film = dataclasses.replace(recorded.film, header=header | {"tables": [*header["tables"], TABLE]})
    return dataclasses.replace(recorded, film=film)


@pytest.fixture(scope="module")
def file(animation: Animation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(page(animation.film, animation.title, SECTIONS), tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def wide(file: Path) -> Iterator[Opened]:
    with opened(file, (1440, 900), "#t=0") as film:
        yield film


@pytest.fixture(scope="module")
def phone(file: Path) -> Iterator[Opened]:
    """The page on a telephone, by night."""
    with opened(file, hash="#t=0", color_scheme="dark", **PHONE) as film:
        yield film
        assert film.complaints == []


@pytest.fixture
def film(wide: Opened) -> Iterator[Opened]:
    """The page as it is at first: paused at 0, light, nothing has the focus."""
    wide("() => { film.pause(); film.seek(0); film.speed = 1; film.theme = 'light'; scrollTo(0, 0); }")
    wide("document.activeElement.blur()")
    wide.tab.mouse.move(5, 5)
    yield wide
    assert wide.complaints == []


def press(film: Opened, *keys: str) -> float:
    for key in keys:
        film.tab.keyboard.press(key)
    return film("film.time")


def fraction(film: Opened, chart: int = 0) -> float:
    """How far across a chart its line of the present time stands."""
    over, line = (film.tab.locator(f".chart .u-over {more}").nth(chart).bounding_box() for more in ("", ".playhead"))
    return (line["x"] + line["width"] / 2 - over["x"]) / over["width"]


def settle(film: Opened) -> None:
    film("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def test_playing_and_pausing(film: Opened) -> None:
    button = film.tab.locator("#play")
    assert button.get_attribute("aria-label") == "Play"
    button.click()
    assert button.get_attribute("aria-label") == "Pause"
    film.until("film.time > 0.02")
    press(film, "Space")  # the button has the focus, and is pressed once, not twice
    assert not film("film.playing")
    film("document.activeElement.blur()")
    press(film, "Space")
    assert film("film.playing")
    press(film, "Space")
    now = film("film.time")
    settle(film)
    assert film("[film.playing, film.time]") == [False, now]


def test_time_passes_at_the_speed_chosen(film: Opened) -> None:
    settle(film)
    # frames come when we say so: after so many seconds
    film("""() => {
        let [now, waiting] = [0, []];
        window.frames_of_the_browser = window.requestAnimationFrame;
        window.requestAnimationFrame = (frame) => waiting.push(frame);
        window.step = (seconds) => waiting.splice(0).forEach((frame) => frame((now += 1000 * seconds)));
    }""")
    try:
        for speed in ("0.1", "1", "4"):
            film.tab.locator("#speed").select_option(speed)
            film("() => { film.seek(0); film.play(); step(9); step(0.1); step(0.2); }")
            assert film("film.time") == pytest.approx(0.3 * float(speed))
            film("() => { film.pause(); step(0.1); }")
        assert film("film.time") == pytest.approx(1.2)
    finally:
        film("() => { film.pause(); step(0.1); step(0.1); requestAnimationFrame = frames_of_the_browser; }")


def test_it_begins_again_at_the_end(film: Opened) -> None:
    film("t => { film.seek(t); film.play(); }", DURATION - 0.02)
    film.until("film.time < 1")
    assert film("film.playing")


def test_keys_move_time(film: Opened) -> None:
    assert press(film, "ArrowRight") == pytest.approx(0.1)
    assert press(film, "Shift+ArrowRight") == pytest.approx(1.1)
    assert press(film, "ArrowLeft", "ArrowLeft") == pytest.approx(0.9)
    assert press(film, "End") == DURATION
    assert press(film, "ArrowRight") == DURATION
    assert press(film, "Home") == 0
    assert press(film, "Control+ArrowRight") == 0  # the browser's own


def test_keys_change_the_speed(film: Opened) -> None:
    press(film, "+")
    assert film("[film.speed, document.getElementById('speed').value]") == [2, "2"]
    press(film, "-", "-")
    assert film("[film.speed, document.getElementById('speed').value]") == [0.5, "0.5"]


def test_the_slider_moves_time_and_says_it(film: Opened) -> None:
    slider = film.tab.locator("#scrubber")
    slider.fill("1.5")
    assert film("film.time") == 1.5
    assert press(film, "ArrowRight") == pytest.approx(1.6)  # it has the focus; it would do smaller steps itself
    assert "1.6" in (slider.get_attribute("aria-valuetext") or "")
    settle(film)
    assert film.tab.locator("#time").inner_text().startswith("1.6")
    film("() => film.seek(0.5)")
    settle(film)
    assert float(slider.input_value()) == pytest.approx(0.5)


def test_a_form_keeps_its_keys(film: Opened) -> None:
    film.tab.locator("#speed").focus()
    assert press(film, "ArrowRight", "Home", "Escape") == 0
    film.tab.locator("#theme").focus()
    press(film, "Space")
    assert film("[film.playing, film.theme]") == [False, "dark"]


def test_the_keys_are_told(film: Opened) -> None:
    press(film, "?")
    assert film.tab.locator("dialog").is_visible()
    press(film, "ArrowRight", "t")
    assert film("[film.time, film.theme]") == [0, "light"]
    press(film, "Escape")
    assert not film.tab.locator("dialog").is_visible()


def test_charts_follow_the_film(film: Opened) -> None:
    count = film.tab.locator("#charts .chart").count()
    assert count >= 4
    for moment in (0.0, 0.5, 1.75):
        film("t => film.seek(t)", moment)
        settle(film)
        np.testing.assert_allclose([fraction(film, i) for i in range(count)], moment / DURATION, atol=0.01)


def test_a_click_or_a_drag_on_a_chart_is_a_moment(film: Opened) -> None:
    over = film.tab.locator("#charts .u-over").nth(1).bounding_box()
    x, y, mouse = (lambda part: over["x"] + part * over["width"]), over["y"] + 40, film.tab.mouse
    mouse.click(x(0.75), y)
    assert film("film.time") == pytest.approx(0.75 * DURATION, abs=0.02)
    mouse.move(x(0.5), y)
    mouse.down()
    mouse.move(x(0.25), y)
    assert film("film.time") == pytest.approx(0.25 * DURATION, abs=0.02)
    mouse.up()
    mouse.move(x(0.9), y)
    assert film("film.time") == pytest.approx(0.25 * DURATION, abs=0.02)


def test_values_are_those_under_the_pointer_or_of_now(film: Opened, animation: Animation) -> None:
    chart = animation.film.header["charts"][0]
    times = numbers(animation.film, chart["times"])
    values = numbers(animation.film, chart["lines"][0]["values"])
    shown = film.tab.locator("#charts .chart").first.locator("output").first
    film("t => film.seek(t)", float(times[-5]))
    settle(film)
    assert float(shown.inner_text()) == pytest.approx(values[-5], rel=5e-3)
    over = film.tab.locator("#charts .u-over").first.bounding_box()
    film.tab.mouse.move(over["x"] + 0.5 * over["width"], over["y"] + 30)
    near = np.abs(times - DURATION / 2) < 0.02 * DURATION
    assert values[near].min() * 0.99 <= float(shown.inner_text()) <= values[near].max() * 1.01


def test_a_part_of_a_chart_can_be_enlarged(film: Opened) -> None:
    over = film.tab.locator("#charts .u-over").first.bounding_box()
    x, y, mouse = (lambda part: over["x"] + part * over["width"]), over["y"] + 40, film.tab.mouse
    film.tab.keyboard.down("Shift")
    mouse.move(x(0.25), y)
    mouse.down()
    mouse.move(x(0.75), y)
    mouse.up()
    film.tab.keyboard.up("Shift")
    film("t => film.seek(t)", DURATION / 4 + DURATION / 8)
    settle(film)
    np.testing.assert_allclose([fraction(film, i) for i in (0, 1)], 0.25, atol=0.03)  # all charts together
    mouse.dblclick(x(0.5), y)
    film("t => film.seek(t)", DURATION / 2)
    settle(film)
    assert fraction(film) == pytest.approx(0.5, abs=0.01)


def test_a_click_on_the_plane_is_the_nearest_moment(film: Opened) -> None:
    plot = film.tab.locator(".plot.plane").bounding_box()
    film("t => film.seek(t)", 1.5)
    settle(film)
    dot = film.tab.locator(".plot.plane .dot:not(.desired)").first.bounding_box()
    film("() => film.seek(1.4)")
    film.tab.mouse.click(dot["x"] + dot["width"] / 2, dot["y"] + dot["height"] / 2)
    assert film("film.time") == pytest.approx(1.5, abs=0.1)
    assert plot["width"] > 250


def test_light_and_dark(film: Opened) -> None:
    light = film.picture()
    film.tab.locator("#theme").click()
    assert film("film.theme") == "dark"
    assert film.picture().mean() < light.mean() - 60
    assert film.pixels("#charts").mean() < 80
    press(film, "t")
    np.testing.assert_array_equal(film.picture(), light)


def test_the_system_says_light_or_dark(phone: Opened) -> None:
    assert phone("film.theme") == "dark"
    for scheme in ("light", "dark"):
        phone.tab.emulate_media(color_scheme=scheme)
        phone.until(f"film.theme === '{scheme}'")


def test_the_view_can_be_turned_and_reset(film: Opened) -> None:
    before, box = film.picture(), film.tab.locator("#pane").bounding_box()
    film.tab.mouse.move(box["x"] + 300, box["y"] + 200)
    film.tab.mouse.down()
    film.tab.mouse.move(box["x"] + 420, box["y"] + 220)
    film.tab.mouse.up()
    assert (np.abs(film.picture() - before).max(axis=-1) > 30).mean() > 0.01
    press(film, "r")
    np.testing.assert_array_equal(film.picture(), before)


def test_it_is_white_on_paper(film: Opened) -> None:
    film("() => { film.theme = 'dark'; dispatchEvent(new Event('beforeprint')); }")
    film.tab.emulate_media(media="print")
    paper = film.pixels("#stage")
    assert np.median(paper) > 200
    assert (np.ptp(paper, axis=-1) > 60).sum() > 100  # the path is on it
    film.tab.emulate_media(media="screen")
    film("() => dispatchEvent(new Event('afterprint'))")
    assert film("film.theme") == "dark"


def test_sections_have_a_table_of_contents(film: Opened, animation: Animation) -> None:
    links = film.tab.locator("#contents a")
    assert links.all_inner_texts() == [section.title for section in SECTIONS]
    links.nth(2).click()
    assert film("[film.time, document.getElementById('section-3').getBoundingClientRect().top < 200]") == [0, True]
    assert film.tab.locator(".section p").all_inner_texts() == ["text 0", "text 1", "text 2"]
    assert 'id="contents"' not in page(animation.film, animation.title, SECTIONS[:2])


def test_the_first_charts_are_seen_without_scrolling(film: Opened) -> None:
    chart = film.tab.locator("#charts .chart").first.bounding_box()
    assert chart["y"] + chart["height"] <= 900
    assert film.tab.locator("#pane").bounding_box()["height"] > 400


def test_a_telephone(phone: Opened) -> None:
    assert phone("document.documentElement.scrollWidth <= innerWidth")
    for control in phone.tab.locator("header button, #stage button, #panel button, select, #scrubber").all():
        if control.is_visible():
            assert control.bounding_box()["height"] >= 44
    lefts = {round(chart.bounding_box()["x"]) for chart in phone.tab.locator("#charts .chart").all()}
    assert len(lefts) == 1  # one below another
    over = phone.tab.locator("#charts .u-over").first
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    phone.tab.touchscreen.tap(box["x"] + 0.5 * box["width"], box["y"] + 50)
    assert phone("film.time") == pytest.approx(DURATION / 2, abs=0.03)


def test_a_transient_is_shown_on_request(film: Opened, animation: Animation) -> None:
    chart = animation.film.header["charts"][0]
    largest = max(numbers(animation.film, line["values"]).max() for line in chart["lines"])
    peak = film.tab.locator("#charts .peak").first
    assert float(peak.inner_text().removeprefix("peak ")) == pytest.approx(largest, rel=5e-3)
    before = film.pixels("#charts .plot >> nth=0")
    peak.click()
    assert peak.get_attribute("aria-pressed") == "true"
    settle(film)
    assert np.abs(film.pixels("#charts .plot >> nth=0") - before).max() > 60
    peak.click()


def test_a_small_path_is_seen_from_near(arm: RobotModel, tmp_path: Path) -> None:
    small = Circle(0.03, 0.06, center=[0.3, 0.9])
    page_file = record(short_run(arm, small), arm, small).save(tmp_path / "small.html")
    with opened(page_file, hash=f"#t={DURATION}", **FINE) as film:
        button = film.tab.locator("#near")
        assert button.get_attribute("aria-pressed") == "false"
        shown = []
        for view in ("whole", "near", "whole"):
            settle(film)
            shown.append(film.pixels("#pane canvas >> nth=0"))
            button.click()
            assert button.get_attribute("aria-pressed") == ("true" if view == "whole" else "false")
        drawn = [(s[..., 0] > s[..., 1] + 60) & (s[..., 2] > s[..., 1]) for s in shown]  # the line of the tool
        widths = [np.ptp(np.flatnonzero(picture.any(axis=0))) for picture in drawn]
        assert widths[1] > 2 * widths[0] > 0
        np.testing.assert_array_equal(shown[0], shown[2])
        assert film.complaints == []


def test_labels_of_arms_in_one_place_stand_apart(arm: RobotModel, circle: Circle, tmp_path: Path) -> None:
    run = short_run(arm, circle)
    ghosts = record({f"a law with the name {k}": run for k in range(4)}, arm, circle, layout="ghosted")
    written = ghosts.save(tmp_path / "ghosts.html")
    with opened(written, (390, 844), "#t=0") as film:
        for width, height in ((390, 844), (1440, 900), (700, 400)):
            film.tab.set_viewport_size({"width": width, "height": height})
            settle(film)
            labels = film.tab.locator("#labels span")
            boxes = [labels.nth(k).bounding_box() for k in range(labels.count())]
            assert len(boxes) == 4
            heights = sorted((box["y"], box["height"]) for box in boxes)
            for (above, high), (below, _) in pairwise(heights):
                assert below >= above + high, (width, height)


def test_a_path_that_fills_the_picture_needs_no_view_from_near(film: Opened) -> None:
    assert not film.tab.locator("#near").is_visible()
    press(film, "c")


def test_numbers_of_a_table_stay_whole_on_a_telephone(phone: Opened) -> None:
    """Each number and each word is on one line, however many columns there are; the table scrolls inside its card."""
    assert phone.tab.locator("#tables summary").last.inner_text() == TABLE["title"]
    lines = phone("""() => [...document.querySelectorAll("#tables details:last-child td")].map((cell) => {
        const range = document.createRange();
        range.selectNodeContents(cell);
        return [cell.textContent, new Set([...range.getClientRects()].map((box) => box.top)).size];
    })""")
    assert len(lines) == 3 * 8
    assert {text for text, count in lines if count > 1} <= {"not finished"}  # at the space
    assert max(count for _, count in lines) <= 2
    assert phone("document.documentElement.scrollWidth <= innerWidth")
