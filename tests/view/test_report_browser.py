"""A report in a real browser, from disk and without a network."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import browser
import pytest
from browser import Opened
from lxml import html
from test_report import HOSTILE, followed, hostile_run

from pathcontrol import Circle, RobotModel, Run, metrics
from pathcontrol.view.report import pictures
from pathcontrol.view.report.report import report


@pytest.fixture(scope="module")
def runs(arm: RobotModel, circle: Circle) -> dict[str, Run]:
    browser.binary()
    return {law: followed(arm, circle, law) for law in ("plan", "projection")}


@pytest.fixture(scope="module", autouse=True)
def few_figures() -> Iterator[None]:
    """Some figures are as good as all of them: they are images."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "_figures", lambda runs, every=pictures._figures: islice(every(runs), 3))
        yield


@pytest.fixture(scope="module")
def file(runs: dict[str, Run], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report(runs, tmp_path_factory.mktemp("report") / "two.html")


@pytest.fixture(scope="module")
def still(file: Path) -> Iterator[Opened]:
    with browser.opened(file, hash="#t=1") as page:
        yield page


@pytest.fixture
def page(still: Opened) -> Iterator[Opened]:
    """The report, paused, on a light screen of a middle size."""
    still.tab.emulate_media(media="screen", color_scheme="light")
    still.tab.set_viewport_size({"width": 900, "height": 600})
    yield still
    assert still.complaints == []


def test_it_opens_without_a_complaint_and_plays(file):
    with browser.opened(file, (450, 300)) as page:
        began = page("film.time")
        page.until(f"film.time > {began} + 0.2")
        assert page("document.querySelectorAll('#summary thead th').length") == 2
        assert page.complaints == []


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_is_wider_than_the_window(page, size, scheme):
    page.tab.emulate_media(color_scheme=scheme)
    page.tab.set_viewport_size({"width": size[0], "height": size[1]})
    page.until("document.documentElement.scrollWidth <= innerWidth")  # charts follow the window with the next pictures
    # figures are drawn for white paper, so they lie on some in the dark, too
    assert page("getComputedStyle(document.querySelector('.figures figure')).backgroundColor") == "rgb(255, 255, 255)"
    broken = "[...document.images].filter(image => !image.complete || image.naturalWidth === 0).length"
    assert page(broken) == 0


def test_the_files_can_be_saved(page, runs):
    saved = {}
    for link in page.tab.locator(".files a").all():
        with page.tab.expect_download() as waiting:
            link.click()
        saved[waiting.value.suggested_filename] = Path(waiting.value.path()).read_text(encoding="utf-8")
    assert json.loads(saved["configuration.json"]) == {name: run.config for name, run in runs.items()}
    peaks = json.loads(saved["metrics.json"])["metrics"]["plan"]["e_p_peak"]
    assert peaks == metrics(runs["plan"], runs["plan"].task)["e_p_peak"]
    assert {"plan-signals.csv", "projection-signals.csv"} < set(saved)


def test_the_contents_lead_to_the_sections(page):
    for link in page.tab.locator("#contents a").all():
        link.click()
        title = link.inner_text()
        heading = page.tab.get_by_role("heading", name=title, exact=True)
        assert heading.bounding_box()["y"] < 600


def test_hostile_names_do_nothing(runs, tmp_path):
    run = hostile_run(runs["plan"], HOSTILE)
    run = Run.from_arrays(
        run.time,
        {"joint_1": "rad", "joint_2": "rad"},
        {n: run.array(n) for n in run.data.data_vars},
        run.config,
        robot=runs["plan"].robot,
        task=runs["plan"].task,
    )
    path = report({HOSTILE: run}, tmp_path / "r.html", title=HOSTILE, command=HOSTILE)
    with browser.opened(path, (450, 300), "#t=1") as page:
        assert page.complaints == []
        document = html.document_fromstring(page("document.documentElement.outerHTML"))
    assert not document.xpath("//*[@onerror]")
    assert not document.xpath("//img[not(starts-with(@src, 'data:image/'))]")
    assert HOSTILE in document.xpath("//pre[@id='made-by']")[0].text
    assert HOSTILE in document.findtext(".//title")


# what the edge of the paper would cut off
CUT = """[...document.querySelectorAll(".section *")].filter(
    (e) => e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX !== "visible").length"""


def test_it_prints(page, tmp_path):
    page.tab.set_viewport_size({"width": 720, "height": 1000})
    page.tab.pdf(path=tmp_path / "r.pdf", format="A4")
    page.tab.emulate_media(media="print")
    assert page(CUT) == 0
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF")
