"""The picture in a real browser, from disk and without a network: what moves is where forward kinematics says."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
from browser import Opened, opened
from markupsafe import Markup

from pathcontrol import Circle, ExtendedMotionPlan, RobotModel, Run, load_robot, record, simulate
from pathcontrol.view.animation.animation import Animation
from pathcontrol.view.animation.payload import Film
from pathcontrol.view.page.html import Section, page

DURATION = 2.0
MARKUP = "</script><img src=x onerror=alert(1)>"
SCRIPT = "<script>alert(1)</script>"


def short_run(robot: RobotModel, task: Circle) -> Run:
    """The paper's controller for two seconds, from a start beside the path."""
    controller = ExtendedMotionPlan(robot, task, K_p=800.0, K_v=[45.0, 100.0], k=20.0)
    return simulate(controller, np.deg2rad([40.0, 70.0]), duration=DURATION, progress=False)


def made_up(robot: RobotModel, q: np.ndarray, duration: float) -> Run:
    """A run through joint positions (time, n) at equal steps of time."""
    time, joints = np.linspace(0.0, duration, len(q)), dict.fromkeys(robot.joint_names, "rad")
    data = {"q": q[None], "s": np.zeros((1, len(q)))}
    return Run.from_arrays(time, joints, data, {"controller": {"controller": MARKUP}})


def turning(robot: RobotModel) -> Run:
    """Every joint turns, at its own pace."""
    t = np.linspace(0.0, DURATION, 401)[:, None]
    return made_up(robot, np.sin((1 + np.arange(robot.n)) * t / 2 + np.arange(robot.n)), DURATION)


@pytest.fixture(scope="module")
def run(arm: RobotModel, circle: Circle) -> Run:
    return short_run(arm, circle)


@pytest.fixture(scope="module")
def animation(arm: RobotModel, circle: Circle, run: Run) -> Animation:
    return record(run, arm, circle)


@pytest.fixture(scope="module")
def file(animation: Animation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return animation.save(tmp_path_factory.mktemp("film") / "film.html")


@pytest.fixture(scope="module")
def still_page(file: Path) -> Iterator[Opened]:
    """The film, waiting at its beginning."""
    with opened(file, hash="#t=0") as film:
        yield film
        assert film.complaints == []


def saved(html: str, folder: Path) -> Path:
    path = folder / "page.html"
    path.write_text(html, encoding="utf-8")
    return path


def numbers(film: Film, block: dict[str, Any]) -> np.ndarray:
    """The numbers of a block, as the page reads them."""
    whole = gzip.decompress(film.pack())
    first = 4 + int.from_bytes(whole[:4], "little") + block["at"]
    return np.frombuffer(whole, np.dtype(block["type"]).newbyteorder("<"), block["count"], first)


def check_poses(film: Opened, animation: Animation, robot: RobotModel, run: Run) -> None:
    """Every link that moves is where forward kinematics has it, at samples of the run in any order."""
    paths = [track["path"] for track in animation.film.header["tracks"] if track["path"].startswith("/meshcat/arms/")]
    links = [path.rsplit("/", 1)[1].split(" ", 1)[1] for path in paths]
    assert len(links) >= robot.n
    for i in (0, len(run.time) // 3, len(run.time) - 1, len(run.time) // 2 + 1):
        film("t => film.seek(t)", float(run.time[i] - run.time[0]))
        seen = np.array([film("path => film.transform(path)", path) for path in paths])
        expected = np.stack([robot.frame_pose(run.array("q")[0, i], link) for link in links])
        np.testing.assert_allclose(seen.reshape(-1, 4, 4).swapaxes(1, 2), expected, rtol=0, atol=1e-4)


def test_the_arm_is_where_it_was(still_page: Opened, animation: Animation, arm: RobotModel, run: Run) -> None:
    check_poses(still_page, animation, arm, run)


def test_an_arm_of_six_joints_is_where_it_was(tmp_path: Path) -> None:
    pytest.importorskip("example_robot_data")
    robot = load_robot("ur5")
    run = turning(robot)
    animation = record(run, robot)
    with opened(animation.save(tmp_path / "ur5.html"), (300, 300), "#t=0") as film:
        check_poses(film, animation, robot, run)
        assert film.complaints == []


def test_lines_grow_with_time(still_page: Opened, animation: Animation) -> None:
    [line] = animation.film.header["growing"]
    times = numbers(animation.film, line["times"])
    moments = np.append(np.linspace(0.0, DURATION, 9), times[[1, 5, 50]])
    drawn = [
        still_page("([path, t]) => { film.seek(t); return film.drawn(path); }", [line["path"], t]) for t in moments
    ]
    rings = [np.count_nonzero(times <= np.float32(t)) for t in moments]
    assert drawn == [line["indices"] * (n - 1) for n in rings]
    assert max(rings) == len(times)


def test_the_arm_and_its_path_are_in_the_picture(still_page: Opened) -> None:
    still_page("() => film.seek(1.5)")
    seen = still_page.picture()
    dark, colorful = seen.max(axis=-1) < 110, np.ptp(seen, axis=-1) > 60
    assert dark.mean() > 0.02  # the column and the motors
    assert colorful.sum() > 300  # the path taken
    for edge in (seen[:3], seen[-3:], seen[:, :3], seen[:, -3:]):
        assert not (edge.max(axis=-1) < 110).any()  # all of it is in the picture


def test_moments_differ_and_the_same_moment_does_not(still_page: Opened) -> None:
    shots = []
    for moment in (0.5, 1.5, 0.5):
        still_page("t => film.seek(t)", moment)
        shots.append(still_page.picture())
    changed = (np.abs(shots[1] - shots[0]).max(axis=-1) > 30).mean()
    assert 0.003 < changed < 0.5  # the arm, thin as it is
    np.testing.assert_array_equal(shots[0], shots[2])


def test_it_plays_by_itself_unless_that_is_not_wanted(file: Path) -> None:
    with opened(file, (300, 300)) as film:
        film.until("film.playing && film.time > 0.05")
        film.tab.emulate_media(reduced_motion="reduce")
        film.tab.reload()
        film("() => film.ready")
        assert film("[film.playing, film.time]") == [False, 0]
        assert film.complaints == []


def test_the_address_says_the_moment(file: Path) -> None:
    with opened(file, hash="#t=1.25&bare") as film:
        assert film("[film.time, film.playing, film.duration]") == [1.25, False, DURATION]
        assert film("document.getElementById('pane').clientHeight") == 600
        assert not film.tab.locator("header, #panel, #charts").filter(visible=True).count()
        assert film.tab.locator("#legend").is_visible()
        film("() => { location.hash = '#t=0.5'; }")
        film.until("film.time === 0.5")
        assert film.tab.locator("#panel").is_visible()
        assert film.complaints == []


@pytest.fixture(scope="module")
def hostile_arm(arm: RobotModel) -> RobotModel:
    text = arm.source.text
    for name, other in (("cicese_2dof", MARKUP), ("link_1", SCRIPT), ("joint_1", MARKUP), ("joint_2", "__proto__")):
        text = text.replace(f'"{name}"', quoteattr(other))
    return load_robot(text)


def test_hostile_names_are_text(hostile_arm: RobotModel, circle: Circle, tmp_path: Path) -> None:
    run = short_run(hostile_arm, circle)
    animation = record({MARKUP: run, SCRIPT: run}, hostile_arm, circle)
    html = page(animation.film, [MARKUP, SCRIPT], [Section(SCRIPT, Markup("<p>fine</p>"))])
    with opened(saved(html, tmp_path), (450, 300), "#t=1") as film:
        text = film("document.body.textContent")
        assert text.count(MARKUP) > 5  # the title, a label, the charts, the tables
        assert text.count(SCRIPT) > 5
        assert film("document.images.length") == 0
        assert film("document.scripts.length") == 2  # the player, and the viewer that it has put there
        assert film("document.title") == f"{MARKUP} - {SCRIPT}"
        assert sorted(film.tab.locator("#labels span").all_text_contents()) == sorted([MARKUP, SCRIPT])
        assert film.complaints == []
    with opened(record(run, hostile_arm, circle).save(tmp_path / "one.html"), (450, 300), "#t=1") as film:
        assert "__proto__" in film.tab.locator("#charts").inner_text()  # the joints of one run
        assert film.complaints == []


def test_a_still_has_no_clock(arm: RobotModel, tmp_path: Path) -> None:
    film_of_nothing = record(made_up(arm, np.full((1, 2), 0.3), 0.0), arm)
    with opened(film_of_nothing.save(tmp_path / "still.html")) as film:
        film("() => { film.play(); film.seek(3); }")
        film.tab.keyboard.press("Space")
        assert film("[film.time, film.playing]") == [0, False]
        assert not film.tab.locator("#panel").is_visible()
        assert np.ptp(film.picture()) > 100
        assert film.complaints == []


@pytest.mark.parametrize(
    ("lack", "said"),
    [
        ("delete window.DecompressionStream", "too old"),
        ("HTMLCanvasElement.prototype.getContext = () => null", "WebGL"),
    ],
)
def test_a_browser_that_cannot_show_it_says_why(file: Path, lack: str, said: str) -> None:
    with opened(file, before=lack) as film:
        assert said in film.tab.locator("#message").inner_text()
        assert not film.tab.locator("#panel").is_visible()
        assert not film.requests


def test_without_scripts_a_word_says_so(file: Path) -> None:
    with opened(file, java_script_enabled=False) as film:
        assert "allow it to run" in film.tab.locator("#stage").inner_text()
