"""A film of a toolpath: the drawing itself, rapids apart from cuts, and the distance of the tool from it."""

from __future__ import annotations

import numpy as np
import pytest
from test_film import Reel, played, reel
from test_toolpath_task import BOARD, letters
from test_view_motion import to_polyline

from pathcontrol import (
    Contour,
    ExtendedMotionPlan,
    RobotModel,
    Run,
    Toolpath,
    ToolpathTask,
    simulate_sequence,
    tool_deviation,
    toolpath_metrics,
)
from pathcontrol.figures import error_figure, tool_figure
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.view.animation.path_error import PathError, in_fitting_units
from pathcontrol.view.animation.record import record
from pathcontrol.view.animation.scene.tube import distinct


@pytest.fixture(scope="module")
def task(arm: RobotModel) -> ToolpathTask:
    return ToolpathTask(arm, "tool", letters(), BOARD, clearance=0.0, rapid_speed=0.3)


@pytest.fixture(scope="module")
def run(arm: RobotModel, task: ToolpathTask) -> Run:
    laws = [ExtendedMotionPlan(arm, path, 800.0, 45.0, 2.0, friction="full") for path in task]
    return simulate_sequence(laws, task.q_d(np.array(0.0)), duration=20.0, progress=False, task=task)


@pytest.fixture(scope="module")
def film(run: Run) -> Reel:
    return reel(record(run))


def outlines(task: ToolpathTask, rapid: bool) -> list[np.ndarray]:
    """Points of the contours of the drawing in the base frame."""
    u = np.linspace(0, 1, 401)
    parts = [[s.point(u) for s in contour.segments] for contour in task.drawing if contour.rapid == rapid]
    return [np.concatenate(part) @ BOARD[:3, :3].T + BOARD[:3, 3] for part in parts]


def on_line(points: np.ndarray, lines: list[np.ndarray]) -> float:
    """The largest distance of points from the nearest of some lines."""
    return float(np.min([to_polyline(points, distinct(line)) for line in lines], axis=0).max())


def test_cuts_are_lines_and_rapids_dashes_where_the_drawing_has_them(film: Reel, task: ToolpathTask) -> None:
    cuts, rapids = outlines(task, rapid=False), outlines(task, rapid=True)
    line = film.center_line("lines/0 desired path")
    assert on_line(line, cuts) < 2e-5
    radius = np.linalg.norm(film.attribute("lines/0 desired path")[0] - line[0])
    for cut in cuts:
        assert np.linalg.norm(cut[:, None] - line, axis=-1).min(axis=1).max() < 0.06
        assert to_polyline(cut, line).max() < radius
    dashes = film.attribute("lines/0 rapids")
    assert on_line(dashes, rapids) < 1e-6
    ends = np.concatenate([rapid[[0, -1]] for rapid in rapids])
    assert np.linalg.norm(ends[:, None] - dashes, axis=-1).min(axis=1).max() < 1e-6
    assert {"desired path": "line", "rapid": "dashed"}.items() <= {
        entry["label"]: entry["kind"] for entry in film.header["legend"]
    }.items()


def test_rapids_that_were_made_are_dashed_in_planes(film: Reel, run: Run, task: ToolpathTask) -> None:
    """Each kept sample of the film's plane says whether it is on a rapid; the figure draws both kinds apart."""
    [trace] = film.header["plane"]["traces"]
    times, rapid = film.block(trace["times"]), film.block(trace["rapid"]).astype(bool)
    expected = np.array([contour.rapid for contour in task.contours])[run.array("path_index")]
    at = np.abs(run.time[:, None] - run.time[0] - times).argmin(0)
    assert (rapid == expected[at]).all()
    assert rapid.any()
    assert not rapid.all()
    changes = np.flatnonzero(np.diff(expected))
    assert np.isin(changes, at).all()  # no dash ends in a cut
    axes = tool_figure(run).axes[0]
    dashed, solid = (
        [
            line
            for line in axes.lines
            if len(line.get_xdata()) == len(expected) and (line.get_linestyle() == "--") == kind
        ]
        for kind in (True, False)
    )
    (made,) = (np.isfinite(line.get_xdata()) for line in dashed)
    (cut,) = (np.isfinite(line.get_xdata()) for line in solid)
    assert (cut == ~expected).all()
    assert (made >= expected).all()
    assert made.sum() <= expected.sum() + 2 * len(changes)


def test_peaks_of_the_figure_are_those_of_the_table(run: Run) -> None:
    """Both are of the cuts, however large the errors of the rapids are."""
    numbers = toolpath_metrics(run)
    for axes, name in zip(error_figure(run).axes, ("e_p_peak", "e_v_peak"), strict=True):
        (words,) = (text.get_text() for text in axes.get_legend().get_texts())
        assert words.startswith(f"peak of the cuts {np.rad2deg(numbers[name][0]):.3g} deg")


def test_the_distance_is_that_of_the_cuts_in_a_fitting_unit(film: Reel, run: Run, task: ToolpathTask) -> None:
    times, lines, chart = film.chart("distance from the drawing")
    [values] = lines.values()
    deviation = 1e6 * tool_deviation(run)[0]
    cutting = np.array([not contour.rapid for contour in task.contours])[run["path_index"].to_numpy()]
    assert chart["unit"] == "µm"
    assert np.nanmax(values) == pytest.approx(deviation[cutting].max(), rel=1e-5)
    samples = np.searchsorted(run.time, times - 1e-4)
    np.testing.assert_array_equal(np.isnan(values), ~cutting[samples])
    known = ~np.isnan(values)
    np.testing.assert_allclose(values[known], deviation[samples][known], rtol=1e-4, atol=1e-3)


def test_the_line_is_coloured_on_cuts_only(film: Reel, run: Run, task: ToolpathTask) -> None:
    colors = film.attribute("lines/0 path taken", "color").reshape(-1, 6, 3)
    assert (colors == colors[:, :1]).all()
    times, _ = film.growing()["lines/0 path taken"]
    cutting = np.array([not contour.rapid for contour in task.contours])[run["path_index"].to_numpy()]
    grey = np.ptp(colors[:, 0], axis=-1) < 0.1
    np.testing.assert_array_equal(grey, ~cutting[np.searchsorted(run.time, times - 1e-4)])


def test_the_tool_is_the_frame_that_follows_the_drawing(film: Reel, run: Run, arm: RobotModel) -> None:
    positions, _ = played(film.tracks()["markers/0 tool"], run.time.astype(np.float32))
    tool = arm.frame_pose(run.array("q")[0], "tool")[:, :3, 3]
    np.testing.assert_allclose(positions, tool, atol=5.1e-5)


def test_the_plane_is_that_of_the_workpiece(film: Reel, run: Run, arm: RobotModel, task: ToolpathTask) -> None:
    plane = film.header["plane"]
    assert (plane["x_label"], plane["y_label"], plane["unit"]) == ("x", "y", "mm")
    assert [line["kind"] for line in plane["desired"]] == ["rapid" if c.rapid else "cut" for c in task.drawing]
    first = [film.block(plane["desired"][0][axis])[0] for axis in "xy"]
    np.testing.assert_allclose(first, 1e3 * task.drawing[0].start[:2], atol=1e-3)
    tool = arm.frame_pose(run.array("q")[0, 0], "tool")[:3, 3]
    on_board = 1e3 * (tool - BOARD[:3, 3]) @ BOARD[:3, :3]
    start = [film.block(plane["traces"][0][axis])[0] for axis in "xy"]
    np.testing.assert_allclose(start, on_board[:2], atol=1e-3)


def test_metrics_are_those_of_the_drawing(film: Reel) -> None:
    [metrics] = [table for table in film.header["tables"] if table["title"] == "Metrics"]
    rows = dict(metrics["rows"])
    assert rows["tool from its path, peak"].endswith("µm")
    assert rows["time for the path"].endswith(" s")


def test_a_run_that_came_to_no_cut_is_filmed(run: Run, arm: RobotModel) -> None:
    """The first sample of a rapid; nothing is cut, so nothing is measured."""
    rapid = np.flatnonzero([contour.rapid for contour in run.task.contours])[0]
    part = Run.from_arrays(
        run.time[:1],
        {"joint_1": "rad", "joint_2": "rad"},
        {name: run.array(name)[:, :1] for name in run.data.data_vars},
        run.config,
        {"path_index": np.array([rapid])},
        robot=arm,
        task=run.task,
    )
    film = reel(record(part))
    assert [table["title"] for table in film.header["tables"]] == ["Settings"]
    assert np.isnan(film.chart("distance")[1]["distance from the drawing"]).all()


def test_a_saved_run_makes_the_same_lines(run: Run, film: Reel, tmp_path) -> None:
    again = reel(record(Run.load(run.save(tmp_path / "run.nc"))))
    for path in ("lines/0 desired path", "lines/0 path taken"):
        ends = [each.center_line(path)[[0, -1]] for each in (again, film)]
        np.testing.assert_allclose(*ends, atol=1e-5)
    assert [e["label"] for e in again.header["legend"]] == [e["label"] for e in film.header["legend"]]


def test_a_drawing_of_very_many_cuts_stays_light(arm: RobotModel, run: Run, task: ToolpathTask) -> None:
    rng = np.random.default_rng(0)
    starts = rng.uniform(0, 0.1, (2500, 3))
    task = ToolpathTask.__new__(ToolpathTask)
    task.__dict__ |= run.task.__dict__
    task.drawing = Toolpath(tuple(Contour((Polyline([x, x + 1e-3]),)) for x in starts))
    film = reel(record(run, task=task))
    assert film.attribute("lines/0 desired path").shape == (5000, 3)


# --- units and scales ---------------------------------------------------------------------------------------


def error(values: list[float], unit: str = "mm") -> PathError:
    return PathError("distance", unit, np.array(values))


def test_lengths_share_the_unit_that_fits_the_largest() -> None:
    small, large, angle = error([0.1, 0.2]), error([0.5, 3.0]), error([1.0], "deg")
    assert [e.unit for e in in_fitting_units([small, large, angle, None]) if e] == ["mm", "mm", "deg"]
    fine = in_fitting_units([small, None, angle])
    assert fine[0].unit == "µm"
    np.testing.assert_allclose(fine[0].values, [100, 200])
    assert fine[1:] == [None, angle]


def test_the_beginning_does_not_spoil_the_scale_and_late_peaks_count() -> None:
    settled = error([100.0, 10.0, 1.0, *[1.0] * 96, 2.0])
    assert settled.top == 2.0
    assert settled.largest == 100.0
    assert error([2.2, *[1.0] * 98, 2.0]).top == 2.2  # a little more is shown as it is
    assert error([5.0] * 50 + [1.0] * 50).top == 5.0
    assert error([np.nan, np.nan]).top == 0.0
