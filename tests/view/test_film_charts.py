"""Charts, plane and tables of a film say what the run says: peaks and gaps survive, units are a reader's."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_film import Reel, made_up_run, reel

from pathcontrol import Circle, ContinuousTime, ExtendedMotionPlan, Projection, RobotModel, Run, load_robot, simulate
from pathcontrol.analysis.readable import readable_number
from pathcontrol.analysis.run_metrics import contour_error, metrics
from pathcontrol.view.animation.charts.chart import MOST_POINTS, Chart, Curve, extremes
from pathcontrol.view.animation.charts.joint_curves import short_names
from pathcontrol.view.animation.payload import Film
from pathcontrol.view.animation.record import record

seeds = st.integers(0, 2**32 - 1)

SLIDER = """
<robot name="slider"><link name="base"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
  <joint name="slide" type="prismatic"><origin xyz="0 0 0.2"/><parent link="base"/><child link="car"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="0" velocity="1"/></joint>
  <link name="car"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><sphere radius="0.05"/></geometry></visual></link></robot>"""


@pytest.fixture(scope="module")
def runs(arm: RobotModel, circle: Circle) -> dict[str, Run]:
    """Runs of two controllers, of different durations and sample times."""
    plan, projection = ExtendedMotionPlan(arm, circle, 800.0, 45.0, 20.0), Projection(arm, circle, 800.0, 45.0)
    start = np.deg2rad([40.0, 70.0])
    loop = ContinuousTime(output_period=0.01)
    return {
        "path": simulate(plan, start, duration=2.0, progress=False),
        "motion": simulate(projection, start, duration=1.5, loop=loop, progress=False),
    }


@pytest.fixture(scope="module")
def film(runs: dict[str, Run]) -> Reel:
    return reel(record(runs["path"]))


@pytest.fixture(scope="module")
def both(runs: dict[str, Run]) -> Reel:
    return reel(record(runs))


# --- thinning -----------------------------------------------------------------------------------------------


@given(seeds, st.integers(1, 3000), st.integers(1, 200), st.floats(0, 0.9))
def test_extremes_and_gaps_of_every_stretch_survive(seed: int, samples: int, bins: int, gaps: float) -> None:
    rng = np.random.default_rng(seed)
    values = np.where(rng.uniform(size=samples) < gaps, np.nan, rng.normal(size=samples))
    kept = extremes(values, bins)
    assert (np.diff(kept) > 0).all()
    assert {0, samples - 1} <= set(kept)
    assert len(kept) <= 3 * bins + 2
    if np.isfinite(values).any():
        assert np.nanmax(values[kept]) == np.nanmax(values)
        assert np.nanmin(values[kept]) == np.nanmin(values)
    width = -(-samples // bins) + 1
    for gap in np.flatnonzero(np.isnan(values)):
        assert np.isnan(values[kept[np.abs(kept - gap) <= width]]).any()


@given(seeds, st.integers(1, 8))
def test_lines_of_a_chart_share_its_times_and_keep_their_peaks(seed: int, lines: int) -> None:
    rng = np.random.default_rng(seed)
    times = [np.cumsum(rng.uniform(0.5, 1, rng.integers(1, 5000))) for _ in range(lines)]
    curves = [Curve(str(i), t, rng.normal(size=len(t))) for i, t in enumerate(times)]
    film = Film()
    film.header = {"charts": [Chart("noise", "1", curves).header(film)]}
    shared, values, _ = Reel(film).chart("noise")
    assert (np.diff(shared) >= 0).all()
    assert len(shared) <= MOST_POINTS + 2 * lines
    for curve in curves:
        shown = values[curve.label]
        assert np.nanmax(shown) == np.float32(curve.values.max())
        assert np.nanmin(shown) == np.float32(curve.values.min())
        outside = (shared < np.float32(curve.times[0])) | (shared > np.float32(curve.times[-1]))
        assert np.isnan(shown[outside]).all()


# --- what is charted ----------------------------------------------------------------------------------------


def test_errors_are_those_of_the_run_in_degrees(film: Reel, runs: dict[str, Run]) -> None:
    run = runs["path"]
    wanted = {
        "position error": ("deg", run.norm("e_p")[0]),
        "velocity error": ("deg/s", run.norm("e_v")[0]),
        "contour error": ("deg", contour_error(run)[0]),
    }
    for title, (unit, values) in wanted.items():
        times, lines, chart = film.chart(title)
        assert chart["unit"] == unit
        [line] = lines.values()
        samples = np.searchsorted(run.time, times - 1e-4)
        np.testing.assert_allclose(line, np.rad2deg(values[samples]), rtol=1e-6)
        assert line.max() == pytest.approx(np.rad2deg(values.max()), rel=1e-6)


def test_the_rate_stands_beside_the_one_that_is_asked_for(film: Reel, runs: dict[str, Run], circle: Circle) -> None:
    times, lines, chart = film.chart("rate")
    assert [line["role"] for line in chart["lines"]] == ["value", "reference"]
    samples = np.searchsorted(runs["path"].time, times - 1e-4)
    np.testing.assert_allclose(lines["σ̇"], runs["path"].array("sdot")[0, samples], rtol=1e-6)
    np.testing.assert_allclose(lines["ϑ(s)"], circle.speed / circle.radius, rtol=1e-6)


def test_torques_of_one_run_are_shares_of_their_limits(film: Reel, runs: dict[str, Run], arm: RobotModel) -> None:
    times, lines, chart = film.chart("torque")
    assert chart["unit"] == "%"
    samples = np.searchsorted(runs["path"].time, times - 1e-4)
    for j, joint in enumerate(arm.joint_names):
        share = 100 * runs["path"].array("tau")[0, samples, j] / arm.limits.effort[j]
        np.testing.assert_allclose(lines[joint], share, rtol=1e-5)
        assert chart["lines"][j]["shade"] == j
    limits = [film.block(line["values"]) for line in chart["lines"] if line["role"] == "limit"]
    assert [set(values) for values in limits] == [{100}, {-100}]


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (["panda_joint1", "panda_joint2"], ["joint1", "joint2"]),
        (["shoulder_pan_joint", "wrist_1_joint"], ["shoulder_pan", "wrist_1"]),
        (["joint_1", "joint_2"], ["joint_1", "joint_2"]),
        (["a_b"], ["a_b"]),
        (["_", "__"], ["_", "__"]),
        (["same", "same"], ["same", "same"]),
    ],
)
def test_joints_are_called_by_what_tells_them_apart(names: list[str], short: list[str]) -> None:
    assert short_names(names) == short


def test_several_runs_show_the_largest_share_of_each(both: Reel, runs: dict[str, Run], arm: RobotModel) -> None:
    _, lines, chart = both.chart("torque")
    for i, (name, run) in enumerate(runs.items()):
        largest = 100 * np.abs(run.array("tau")[0] / arm.limits.effort).max()
        assert np.nanmax(lines[name]) == pytest.approx(largest, rel=1e-6)
        assert chart["lines"][i * 2]["run"] == i
    assert {line["role"] for line in chart["lines"]} == {"value", "limit"}


def test_a_robot_without_limits_shows_newton_metres(runs: dict[str, Run], arm: RobotModel) -> None:
    free = load_robot(re.sub(r'effort="[^"]*"', 'effort="0"', arm.source.text))
    _, lines, chart = reel(record(runs["path"], free)).chart("torque")
    assert chart["unit"] == "N m"
    assert max(np.abs(line).max() for line in lines.values()) == pytest.approx(np.abs(runs["path"].array("tau")).max())
    assert {line["role"] for line in chart["lines"]} == {"value"}


def test_lines_of_runs_of_their_own_duration_end_where_they_do(both: Reel, runs: dict[str, Run]) -> None:
    for chart in both.header["charts"]:
        times = both.block(chart["times"])
        assert times[-1] == 2.0
        for line in chart["lines"]:
            known = times[np.isfinite(both.block(line["values"]))]
            assert known[0] == 0
            assert known[-1] == (2.0 if line["run"] == 0 else 1.5)


def test_a_reference_that_is_the_same_is_drawn_once(runs: dict[str, Run]) -> None:
    twice = reel(record({"one": runs["path"], "two": runs["path"]}))
    assert [line["role"] for line in twice.chart("rate")[2]["lines"]] == ["value", "reference", "value"]


def test_an_arm_of_one_joint_shows_its_tool() -> None:
    robot = load_robot(SLIDER)
    film = reel(record(made_up_run(robot, np.linspace(0, 0.1, 50)[:, None], 1.0), task=None))
    assert film.header["plane"]["unit"] == "mm"
    assert film.header["charts"] == []  # the run holds positions only


# --- plane --------------------------------------------------------------------------------------------------


def test_two_joints_are_drawn_over_one_another_in_degrees(film: Reel, runs: dict[str, Run], circle: Circle) -> None:
    plane = film.header["plane"]
    assert (plane["title"], plane["x_label"], plane["y_label"], plane["unit"]) == ("q1–q2", "q1", "q2", "deg")
    [desired], [taken], [point] = plane["desired"], plane["traces"], plane["points"]
    radii = np.hypot(film.block(desired["x"]), film.block(desired["y"]))
    np.testing.assert_allclose(radii, np.rad2deg(circle.radius), rtol=1e-6)
    times, x, y = (film.block(taken[key]) for key in ("times", "x", "y"))
    run = runs["path"]
    drawn = np.stack([np.interp(run.time, times, c) for c in (x, y)], axis=-1)
    extent = np.ptp(np.rad2deg(run.array("q")[0]), axis=0).max() + 2 * np.rad2deg(circle.radius)
    assert np.abs(drawn - np.rad2deg(run.array("q")[0])).max() < extent / 1000
    where = np.stack([np.interp(run.time, film.block(point["times"]), film.block(point[key])) for key in "xy"], axis=-1)
    assert np.abs(where - np.rad2deg(circle.q_d(run.array("s")[0]))).max() < extent / 1000


def test_other_arms_show_their_tool_in_the_plane_of_its_path() -> None:
    pytest.importorskip("example_robot_data")
    robot = load_robot("ur5")
    q = np.array([0.0, -1.2, 1.4, -1.7, -1.5, 0.2]) + np.linspace(0, 1, 100)[:, None] * [1.0, 0, 0, 0, 0, 0]
    film = reel(record(made_up_run(robot, q, 1.0)))
    plane = film.header["plane"]
    assert (plane["x_label"], plane["y_label"], plane["unit"]) == ("x", "y", "mm")  # it turns about z
    tool = 1e3 * robot.frame_pose(q, "tool0")[:, :2, 3]
    ends = [[film.block(plane["traces"][0][axis])[i] for axis in "xy"] for i in (0, -1)]
    np.testing.assert_allclose(ends, tool[[0, -1]], atol=1e-3)


def test_runs_of_one_task_share_its_line(both: Reel) -> None:
    assert len(both.header["plane"]["desired"]) == 1
    assert [trace["run"] for trace in both.header["plane"]["traces"]] == [0, 1]


# --- tables -------------------------------------------------------------------------------------------------


def table(film: Reel, title: str) -> tuple[list[str], dict[str, list[str]]]:
    [found] = [t for t in film.header["tables"] if t["title"] == title]
    assert all(len(row) == len(found["columns"]) for row in found["rows"])
    return found["columns"], {row[0]: row[1:] for row in found["rows"]}


def test_metrics_are_those_of_each_run_in_degrees(both: Reel, runs: dict[str, Run]) -> None:
    columns, rows = table(both, "Metrics")
    assert columns == ["peaks and RMS of the second half of the time", "path", "motion"]
    for i, run in enumerate(runs.values()):
        numbers = metrics(run)
        assert rows["‖e_p‖ peak"][i] == f"{np.rad2deg(numbers['e_p_peak'][0]):.4g} deg"
        assert rows["‖e_v‖ RMS"][i] == f"{np.rad2deg(numbers['e_v_rms'][0]):.4g} deg/s"
        assert rows["torque demand, peak"][i] == f"{numbers['tau_demand_peak'][0]:.4g} N m"
        assert len(rows) == len(numbers)


def test_settings_say_what_each_run_was_made_with(both: Reel, runs: dict[str, Run]) -> None:
    _, rows = table(both, "Settings")
    assert rows["controller"] == ["ExtendedMotionPlan", "Projection"]
    assert rows["k"] == ["20", "–"]
    assert rows["loop"] == ["sampled", "continuous"]
    assert rows["control period [s]"] == ["0.0025", "–"]
    assert rows["friction of the plant"] == ["Viscous + Coulomb"] * 2
    assert rows["duration"] == ["2 s, 801 samples", "1.5 s, 151 samples"]
    assert "pathcontrol " in rows["versions"][0]


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (np.pi, "rad", "180 deg"),
        (2.5e-4, "m", "250 µm"),
        (-2.5e-3, "m", "-2.5 mm"),
        (np.inf, "s", "never"),
        (np.nan, "rad", "–"),
        (0.5, "", "0.5"),
        (12.3456, "N m", "12.35 N m"),
    ],
)
def test_numbers_are_written_for_a_reader(value: float, unit: str, words: str) -> None:
    assert readable_number(value, unit) == words
