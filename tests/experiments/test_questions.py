"""Feeds and lengths far beyond the arm are questioned, as metres where millimetres were meant; others are not."""

from __future__ import annotations

import contextlib
import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import PathControlWarning
from pathcontrol.experiments.runner import load_setup
from pathcontrol.robot.extent import extent

LINE = np.linspace([0.45, -0.05, 0.6], [0.55, -0.05, 0.9], 5)
TASK = """
duration = 1.0
[robot]
source = "cicese_2dof"
[task]
type = "toolpath"
file = "line.csv"
frame = "tool"
feed = FEED
clearance = 0.0
[controller]
type = "projection"
k_p = 800.0
K_v = 45.0
"""


def path(arm, **options):
    return pc.CartesianPath(arm, "tool", LINE, **options)


@pytest.fixture
def toolpath(tmp_path):
    file = tmp_path / "line.csv"
    rows = "\n".join(",".join(f"{x:.6f}" for x in row) for row in LINE)
    file.write_text(f"x [m],y [m],z [m]\n{rows}\n", encoding="utf-8")
    return file


def limit(arm, speed):
    return pc.MotionLimit(pc.ToolMotion(arm, "tool"), speed)


def task(arm, file, **options):
    return pc.ToolpathTask(arm, "tool", pc.read_toolpath(file), **{"feed": 0.05, "clearance": 0.0} | options)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda arm, file: path(arm, speed=50.0), ["50 m/s", "did you mean 50 mm/s, which is 0.05?"]),
        (lambda arm, file: path(arm, tolerance=1.0), ["tolerance = 1 m", "did you mean 1 mm"]),
        (lambda arm, file: pc.ToolSpeed(arm, "tool", 50.0), ["speed = 50 m/s", "50 mm/s"]),
        (lambda arm, file: limit(arm, 50.0), ["50 m/s", "50 mm/s"]),
        (lambda arm, file: task(arm, file, feed=50.0), ["50 m/s", "50 mm/s"]),
        (lambda arm, file: task(arm, file, tolerance=1.0), ["tolerance = 1 m", "1 mm"]),
        (lambda arm, file: task(arm, file, clearance=10.0), ["clearance = 10 m", "10 mm"]),
    ],
)
def test_what_is_far_beyond_the_arm_is_questioned(arm, toolpath, call, words):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with contextlib.suppress(pc.TaskError):  # it may not be possible either
            call(arm, toolpath)
    told = [str(one.message) for one in caught if issubclass(one.category, PathControlWarning)]
    assert any(all(word in text for word in words) for text in told), told


def test_a_curve_in_millimetres_is_questioned_before_it_is_refused(arm):
    with (
        pytest.warns(PathControlWarning, match=r"distance of the curve = .* did you mean .* mm"),
        pytest.raises(pc.TaskError),
    ):
        pc.CartesianPath(arm, "tool", 1e3 * LINE)


@pytest.mark.parametrize("speed", [1e-3, 0.05, 0.5, 2.0])
def test_what_an_arm_can_do_is_not_questioned(arm, speed):
    with warnings.catch_warnings():
        warnings.simplefilter("error", PathControlWarning)
        path(arm, speed=speed)
        pc.ToolSpeed(arm, "tool", speed)
        limit(arm, speed)


@pytest.mark.parametrize(
    ("feed", "questioned"), [("50", True), ('"50 mm/s"', False), ('"50 m/s"', True), ("0.05", False)]
)
def test_a_feed_of_an_experiment_is_questioned(arm, toolpath, feed, questioned):
    file = toolpath.with_name("experiment.toml")
    file.write_text(TASK.replace("FEED", feed), encoding="utf-8")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_setup(file)
    told = [str(one.message) for one in caught if "did you mean" in str(one.message)]
    assert bool(told) == questioned


def test_the_extent_of_two_links_is_that_of_their_lengths(arm):
    """Stretched out the tool moves with 0.9 m about joint 1 and 0.45 m about joint 2, each at 20 rad/s."""
    found = extent(arm, "tool")
    assert 0.8 * 20 * (0.9 + 0.45) < found.speed <= 20 * (0.9 + 0.45) * (1 + 1e-9)
    height = np.linalg.norm(arm.frame_pose([0.0, 0.0], "joint_1")[:3, 3])
    assert 0.8 * (height + 0.9) < found.reach <= np.hypot(height + 0.9, 0.2)


@pytest.mark.parametrize(
    ("line", "questioned"),
    [
        ('payload = { mass = 1.0, frame = "tool", com = [0.0, 0.0, 50.0] }', "robot.payload.com is 50 m long"),
        ('payload = { mass = 1.0, frame = "tool", com = [0.0, 0.0, "50 mm"] }', ""),
        ('tool = { frame = "tool", position = [0.0, 0.0, 120.0] }', "robot.tool.position is 120 m long"),
        ('tool = { frame = "tool", position = [0.0, 0.0, 0.12] }', ""),
    ],
)
def test_an_offset_longer_than_the_arm_is_questioned(tmp_path, line, questioned):
    from pathcontrol.experiments.template import example_text

    file = tmp_path / "experiment.toml"
    text = example_text().replace('source = "cicese_2dof"', f'source = "cicese_2dof"\n{line}', 1)
    file.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_setup(file)
    told = [str(one.message) for one in caught if "did you mean" in str(one.message)]
    assert (bool(told) and questioned in told[0]) if questioned else not told
