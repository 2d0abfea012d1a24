"""A whole toolpath as a task: its paths follow the contours of the file, one after another, at the file's feeds."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats

from pathcontrol import (
    Contour,
    ExtendedMotionPlan,
    InputError,
    Line,
    PathSequence,
    TaskError,
    Toolpath,
    ToolpathTask,
    UnknownNameError,
    load_robot,
    simulate_sequence,
    tool_deviation,
    toolpath_metrics,
)
from pathcontrol.cartesian.contour_links import link_contours
from pathcontrol.toolpaths.gcode.strokes import ContourBuilder
from pathcontrol.toolpaths.segments.arc import Arc

BOARD = np.array([[1, 0, 0, 0.3], [0, 0, -1, -0.05], [0, 1, 0, 0.7], [0, 0, 0, 1.0]])  # upright, in the arm's plane


def drawn(points, **attributes) -> Contour:
    builder = ContourBuilder(points[0])
    for point in points[1:]:
        builder.line_to(point)
    return builder.contour(**attributes)


def letters(scale: float = 1.0) -> Toolpath:
    """A hook, a ring and a bar."""
    hook = ContourBuilder([0.0, 0.0, 0.0])
    hook.line_to([0.0, 0.05 * scale, 0.0])
    hook.line_to([0.03 * scale, 0.05 * scale, 0.0])
    x, y = np.array([0.02, 0.0, 0.0]) * scale, np.array([0.0, 0.02, 0.0]) * scale
    ring = ContourBuilder([0.09 * scale, 0.0, 0.0])
    ring.add(Arc([0.07 * scale, 0.0, 0.0], x, y, 0.0, 2 * np.pi))
    bar = drawn([[0.1 * scale, 0.0, 0.0], [0.1 * scale, 0.06 * scale, 0.0]], feed=0.08)
    return Toolpath((hook.contour(feed=0.05), ring.contour(feed=0.05), bar))


@pytest.fixture(scope="module")
def arm():
    return load_robot("cicese_2dof")


@pytest.fixture(scope="module")
def task(arm):
    return ToolpathTask(arm, "tool", letters(), BOARD, clearance=0.0)


def tool(arm, path, count=2001):
    return arm.frame_pose(path.q_d(np.linspace(path.s0, path.s_end, count)), "tool")[:, :3, 3]


# --- ways between contours ----------------------------------------------------------------------------------


@settings(deadline=None)
@given(st.lists(st.tuples(*[floats(-1, 1)] * 6), min_size=1, max_size=6), floats(0.0, 0.3))
def test_linked_contours_meet_and_keep_the_files(ends, clearance):
    contours = [drawn([np.array(e[:3]), np.array(e[3:]) + 3.0], feed=1.0) for e in ends]
    whole = link_contours(contours, clearance, np.array([0.0, 0.0, 1.0]), 1e-4, "blend")
    assert [contour for contour, _ in whole if not contour.rapid] == contours
    for (before, _), (after, _) in itertools.pairwise(whole):
        assert np.linalg.norm(before.end - after.start) <= 1e-6
        if after.rapid and clearance:
            top = max(after.start[2], after.end[2]) + clearance
            assert after.segments[0].points[:, 2].max() == pytest.approx(top)
        elif after.rapid:
            assert after.length == pytest.approx(np.linalg.norm(after.end - after.start))


def test_contours_that_meet_need_no_link():
    contours = [drawn([[0, 0, 0], [1, 0, 0]]), drawn([[1, 0, 0], [1, 1, 0]])]
    assert [
        contour for contour, _ in link_contours(contours, 0.1, np.array([0.0, 0.0, 1.0]), 1e-4, "blend")
    ] == contours


def test_a_sharp_tip_that_is_stopped_at_may_be_anywhere_on_a_closed_contour(arm):
    tip = drawn([[0.01, 0.02, 0], [0.08, 0.02, 0], [0.01, 0.03, 0], [0.01, 0.02, 0]], feed=0.05)
    after = drawn([[0.04, 0.05, 0], [0.06, 0.05, 0]], feed=0.05)
    task = ToolpathTask(arm, "tool", Toolpath((tip, after)), BOARD, clearance=0.0)
    assert [contour.rapid for contour in task.contours] == [False, False, True, False]  # from its start, by the tip


# --- the paths ----------------------------------------------------------------------------------------------


def test_the_tool_keeps_to_the_drawing_and_visits_all_of_it(arm, task):
    tolerance = 1e-4 + 1e-5
    assert task.deviation <= 1e-4 * 1.001
    for path, contour in zip(task.paths, task.contours, strict=True):
        x = tool(arm, path)
        assert contour.distance(x).max() <= tolerance
        assert np.linalg.norm(x[0] - contour.start) <= tolerance
        assert np.linalg.norm(x[-1] - contour.end) <= tolerance
        parts = [segment.point(np.linspace(0, 1, 101)) for segment in contour.segments]
        drawing = np.concatenate(parts)
        step = np.linalg.norm(np.diff(x, axis=0), axis=-1).max()
        nearest = np.linalg.norm(drawing[:, None] - x, axis=-1).min(1)
        assert nearest.max() <= tolerance + step


def test_the_feed_is_that_of_the_file_within_the_acceleration(arm, task):
    for path, contour in zip(task.paths, task.contours, strict=True):
        s = np.linspace(path.s0, path.s_end, 4001)
        velocity, _ = arm.frame_motion(path.q_d(s), path.dq_d(s), path.ddq_d(s), "tool")
        speed = np.linalg.norm(velocity[:, :3], axis=-1) * path.theta(s)
        feed = task.rapid_speed if contour.rapid else contour.feed
        assert speed.max() <= feed * 1.002
        time = np.concatenate([[0], np.cumsum(np.diff(s) * 0.5 * (1 / path.theta(s)[1:] + 1 / path.theta(s)[:-1]))])
        assert np.abs(np.gradient(speed, time))[2:-2].max() <= task.acceleration * 1.05
    assert speed.max() == pytest.approx(0.08, rel=2e-3)  # the bar is long enough to reach its feed


@settings(max_examples=3, deadline=None)
@given(st.tuples(floats(-0.03, 0.03), floats(-0.03, 0.03)))
def test_moving_the_workpiece_is_moving_the_drawing(arm, shift):
    pose = np.eye(4)
    pose[:2, 3] = shift
    start = np.array([1.0, 0.9])
    toolpath = Toolpath((letters()[2],))
    placed = ToolpathTask(arm, "tool", toolpath, BOARD @ pose, start=start)
    moved = ToolpathTask(arm, "tool", toolpath.placed(pose), BOARD, start=start)
    s = np.linspace(0, placed.s_end, 101)
    assert placed.s_end == pytest.approx(moved.s_end)
    assert np.allclose(placed.q_d(s), moved.q_d(s), atol=1e-6)


def test_stopping_at_corners_makes_more_paths_and_no_deviation(arm):
    hook = Toolpath((letters()[0],))
    blended, stopped = (ToolpathTask(arm, "tool", hook, BOARD, corner=corner) for corner in ("blend", "stop"))
    assert (len(blended), len(stopped)) == (1, 2)
    corner = BOARD @ [0.0, 0.05, 0.0, 1.0]
    assert np.linalg.norm(tool(arm, stopped.paths[0])[-1] - corner[:3]) <= 1e-5
    assert np.linalg.norm(tool(arm, blended.paths[0]) - corner[:3], axis=-1).min() > 5e-5
    assert stopped.deviation < 1e-9 < blended.deviation


# --- what is refused ----------------------------------------------------------------------------------------


def test_a_cut_without_a_feed_is_named(arm):
    no_feed = Toolpath((letters()[2], drawn([[0, 0, 0], [0.1, 0, 0]], name="N20")), source="part.ngc")
    with pytest.raises(InputError, match=r"contour 1 \(N20\) has no feed in part.ngc; give feed in m/s"):
        ToolpathTask(arm, "tool", no_feed, BOARD)
    assert len(ToolpathTask(arm, "tool", no_feed, BOARD, feed=0.1, clearance=0.0)) == 3


def test_a_contour_out_of_reach_is_named(arm):
    far = Toolpath((letters()[2], drawn([[0, 0, 0], [2.0, 0, 0]], feed=0.1, name="too far")))
    with pytest.raises(TaskError, match=r"contour 2 of 3 \(too far\): .*s = "):
        ToolpathTask(arm, "tool", far, BOARD, clearance=0.0)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"orientation": "up"}, UnknownNameError, "orientation = 'up', expected one of 'free', 'down'"),
        ({"corner": "cut"}, UnknownNameError, "corner = 'cut', expected one of 'blend', 'stop'"),
        ({"feed": -1.0}, InputError, "feed = -1, expected a number greater than 0"),
        ({"rapid_speed": 0.0}, InputError, "rapid_speed = 0, expected"),
        ({"acceleration": np.nan}, InputError, "acceleration = nan, expected"),
        ({"clearance": -0.1}, InputError, "clearance = -0.1, expected"),
        ({"tolerance": 0.0}, InputError, "tolerance = 0, expected"),
        ({"workpiece": 2 * np.eye(4)}, InputError, "workpiece is no rigid motion"),
    ],
)
def test_bad_arguments_are_named(arm, options, error, message):
    with pytest.raises(error, match=message):
        ToolpathTask(arm, "tool", letters(), **({"workpiece": BOARD} | options))


def test_orientations_that_do_not_suit_are_refused(arm):
    with pytest.raises(InputError, match="no contour has any; give i j k in a CSV, or take 'down'"):
        ToolpathTask(arm, "tool", letters(), BOARD, orientation="normals")
    with pytest.raises(InputError, match="'tangent', but the contours have 1 stops at corners"):
        ToolpathTask(arm, "tool", letters(), BOARD, orientation="tangent", corner="stop")


def test_rapids_turn_a_tool_that_goes_along_the_tangent():
    pytest.importorskip("example_robot_data")
    ur5 = load_robot("ur5").with_frame("tip", "tool0", [0.0, 0.0, 0.1])
    table = np.eye(4)
    table[:3, 3] = [0.42, -0.1, 0.15]
    strokes = Toolpath((drawn([[0, 0, 0], [0.1, 0, 0]], feed=0.05), drawn([[0.1, 0.05, 0], [0.1, 0.1, 0]], feed=0.05)))
    ready = [0.0, -1.2, 1.8, -2.1, -1.6, 0.0]
    task = ToolpathTask(ur5, "tip", strokes, table, orientation="tangent", start=ready)
    assert len(task) == 3
    for path, direction in ((task.paths[0], [1, 0, 0]), (task.paths[2], [0, 1, 0])):
        poses = ur5.frame_pose(path.q_d(np.linspace(path.s0, path.s_end, 50)), "tip")
        assert np.allclose(poses[:, :3, 0], direction, atol=2e-4)
        assert np.allclose(poses[:, :3, 2], [0, 0, -1], atol=2e-4)


# --- sequences ----------------------------------------------------------------------------------------------


def test_a_sequence_is_its_paths_strung_together(task):
    assert isinstance(task, PathSequence)
    for i, path in enumerate(task):
        # irregular places: a table's slope jumps at its knots
        s = np.sort(path.s0 + (path.s_end - path.s0) * np.modf(0.618034 * np.arange(1, 50))[0])
        for name in ("q_d", "dq_d", "ddq_d", "theta", "dtheta"):
            strung, own = getattr(task, name)(s + task.starts[i] - path.s0), getattr(path, name)(s)
            assert np.allclose(strung, own, rtol=1e-7, atol=1e-9), name
        assert set(task.index(s + task.starts[i])) == {i}
    before, after = task.q_d(task.starts[1:-1] - 1e-9), task.q_d(task.starts[1:-1])
    assert np.abs(before - after).max() < 1e-6
    json.dumps(task.describe())


@given(st.integers(0, 999))
def test_the_projection_on_a_sequence_is_the_best_of_its_paths(seed):
    points = np.cumsum(np.random.default_rng(seed).normal(size=(4, 2)), axis=0)
    task = PathSequence([Line(a, b, 1.0) for a, b in itertools.pairwise(points)])
    q = np.random.default_rng(seed + 1).normal(size=(20, 2))
    s = task.sigma_bar(q)
    dense = task.q_d(np.linspace(0, task.s_end, 4001))
    brute = np.linalg.norm(q[:, None] - dense, axis=-1).min(1)
    assert np.all(np.linalg.norm(task.q_d(s) - q, axis=-1) <= brute + 1e-12)
    near = task.starts[1] + 0.1
    assert set(task.index(task.sigma_bar(q, near=near))) <= {1, 2}  # its end belongs to the next


@pytest.mark.parametrize(
    ("paths", "message"),
    [
        ([], "at least one path"),
        ([Line([0, 0], [1, 0], 1.0), Line([2, 0], [3, 0], 1.0)], "path 1 begins 1 rad away from the end of path 0"),
        ([Line([0, 0], [1, 0], 1.0), Line([1, 0, 0], [3, 0, 0], 1.0)], "path 0 is for 2 joints, path 1 for 3"),
    ],
)
def test_what_is_no_sequence_is_refused(paths, message):
    with pytest.raises(InputError, match=message):
        PathSequence(paths)


# --- runs ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(arm, task):
    laws = [ExtendedMotionPlan(arm, path, K_p=800.0, K_v=45.0, k=2.0, friction="full") for path in task]
    return simulate_sequence(laws, task.q_d(np.array(0.0)), duration=20.0, progress=False)


def test_the_deviation_is_from_the_files_own_geometry(arm, task, run):
    deviation = tool_deviation(run, arm, task.frame, task.contours)[0]
    x = arm.frame_pose(run.array("q")[0], "tool")[:, :3, 3]
    ring = run["path_index"].to_numpy() == 2
    on_board = (x[ring] - BOARD[:3, 3]) @ BOARD[:3, :3]
    exact = np.abs(np.linalg.norm(on_board[:, :2] - [0.07, 0.0], axis=-1) - 0.02)
    assert np.allclose(deviation[ring], np.hypot(exact, on_board[:, 2]), atol=1e-9)


def test_the_metrics_are_of_the_cuts(arm, task, run):
    numbers = toolpath_metrics(run, arm, task)
    cutting = np.isin(run["path_index"].to_numpy(), [i for i, c in enumerate(task.contours) if not c.rapid])
    deviation = tool_deviation(run, arm, task.frame, task.contours)[0, cutting]
    assert numbers["tool_deviation_peak"] == [deviation.max()]
    assert numbers["tool_deviation_rms"][0] == pytest.approx(np.sqrt((deviation**2).mean()))
    assert run.status[0] == "finished"
    assert numbers["path_time"] == [run.finish_time[0]]
    assert numbers["smoothing_deviation"] == [task.deviation]
    assert 0 < deviation.max() < 1e-3
