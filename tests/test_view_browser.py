"""The page in a real browser, from disk and without a network."""

from __future__ import annotations

from pathlib import Path

import browser
import numpy as np
import pytest
from PIL import Image
from test_view_recorder import HOSTILE, ODD, circling, wild

from pathcontrol import Circle, RobotModel, load_robot
from pathcontrol.view.film.recorder import record

SIZE = (900, 600)


@pytest.fixture(scope="module")
def page(arm: RobotModel, circle: Circle, tmp_path_factory: pytest.TempPathFactory) -> Path:
    browser.binary()
    film = record(circling(arm, circle), arm, circle)
    return film.save(tmp_path_factory.mktemp("film") / "film.html")


def pixels(png: Path) -> np.ndarray:
    """The picture below the title line and left of the controls, (height, width, 3), 0 to 255."""
    return np.asarray(Image.open(png).convert("RGB"), dtype=np.float64)[60:, :620]


def test_the_arm_and_its_path_are_seen(page: Path, tmp_path: Path) -> None:
    png = tmp_path / "still.png"
    assert browser.screenshot(page, png, size=SIZE, moment=1.0) == []
    seen = pixels(png)
    red, green, blue = seen.reshape(-1, 3).T
    dark, orange = seen.max(axis=-1) < 110, (red > 150) & (blue < 80) & (green < 150)
    assert dark[150:400, 200:600].mean() > 0.05  # the column and the motors
    assert orange.sum() > 300  # the path taken
    assert ((blue > 150) & (red < 130)).sum() > 100  # the desired path
    assert not dark[:, :3].any()  # all of it is in the picture
    assert not dark[-3:].any()


def test_moments_differ_and_the_same_moment_does_not(page: Path, tmp_path: Path) -> None:
    shots = []
    for i, moment in enumerate((0.5, 1.5, 0.5)):
        browser.screenshot(page, tmp_path / f"{i}.png", size=SIZE, moment=moment)
        shots.append(pixels(tmp_path / f"{i}.png"))
    changed = (np.abs(shots[1] - shots[0]).max(axis=-1) > 30).mean()
    assert 0.01 < changed < 0.5
    np.testing.assert_array_equal(shots[0], shots[2])


def test_it_plays_by_itself(page: Path, tmp_path: Path) -> None:
    for name, seconds in (("early", 1.5), ("late", 2.7)):
        assert browser.screenshot(page, tmp_path / f"{name}.png", size=SIZE, seconds=seconds) == []
    early, late = (pixels(tmp_path / f"{name}.png") for name in ("early", "late"))
    assert (np.abs(early - late).max(axis=-1) > 30).mean() > 0.01


def test_hostile_names_do_nothing(page: Path, tmp_path: Path) -> None:
    robot = load_robot(ODD)
    hostile = record(wild(robot), robot).save(tmp_path / "hostile.html")
    assert browser.screenshot(hostile, tmp_path / "hostile.png", size=SIZE, moment=1.0) == []
    assert pixels(tmp_path / "hostile.png")[150:400, 200:600].std() > 5
    document = browser.dom(hostile)
    assert document.count("<script") == 3
    assert HOSTILE.replace("<", "&lt;").replace(">", "&gt;") in document
