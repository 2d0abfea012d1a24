"""What the figures show is what happened, in the units a person reads."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import pathcontrol as pc
from pathcontrol import (
    Circle,
    ExtendedMotionPlan,
    InputError,
    Projection,
    SampledLoop,
    comparison_figure,
    error_bands_figure,
    error_figure,
    load_robot,
    path_figure,
    phase_figure,
    save_figure,
    simulate,
    speed_figure,
    tool_figure,
    torque_figure,
)
from pathcontrol.experiments.schema.experiment import Output
from pathcontrol.view.figures.error_figures import quantiles
from pathcontrol.view.figures.lines import select_by_cell, select_by_column
from pathcontrol.view.figures.run_figures import run_figure
from pathcontrol.view.figures.style import RUN_COLOURS

START = np.deg2rad([40.0, 70.0])


@pytest.fixture(scope="module")
def runs(arm, circle):
    laws = {
        "plan": ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0),
        "projection": Projection(arm, circle, 800.0, [45.0, 100.0]),
    }
    loop = SampledLoop(torque_limits=True)
    return {name: simulate(law, START, duration=2.0, loop=loop, progress=False) for name, law in laws.items()}


def curves(axes):
    """The lines of a panel that are drawn over several samples, by colour and thickness."""
    return [line for line in axes.lines if len(line.get_xdata()) > 2]


def test_the_joints_that_move_are_drawn():
    pytest.importorskip("example_robot_data")
    robot = load_robot("ur5").with_friction(None)
    task = Circle(0.3, 0.6, center=[0, -1.2, 1.2, -1.0, -1.5, 0], joints=(1, 2))
    run = simulate(ExtendedMotionPlan(robot, task, 400.0, 40.0, 20.0), task.center, duration=4.0, progress=False)
    axes = path_figure(run, task).axes[0]
    assert "q_{2}" in axes.get_xlabel()
    assert "q_{3}" in axes.get_ylabel()
    assert ["q_{2}" in a.get_xlabel() or "q_{3}" in a.get_xlabel() for a in phase_figure(run).axes] == [True, True]
    with pytest.raises(InputError, match="from 0 to 5"):
        path_figure(run, task, joints=(0, 6))
    with pytest.raises(InputError, match="from 0 to 5"):
        phase_figure(run, [0, 6])


def test_angles_are_shown_in_degrees(runs):
    run = runs["plan"]
    drawn = next(line for line in path_figure(run).axes[0].lines if line.get_label() == "arm")
    assert np.allclose(drawn.get_xdata(), np.rad2deg(run.array("q")[0, :, 0]))
    phase = phase_figure(run, 1).axes[0]
    drawn = next(line for line in phase.lines if line.get_label() == "arm")
    assert np.allclose(drawn.get_ydata(), np.rad2deg(run.array("qd")[0, :, 1]))
    with pytest.raises(InputError, match="rollout 5"):
        error_figure(run, rollout=5)


def test_the_phase_plane_has_the_curve_gamma(runs):
    """(q_d, q_d'ϑ) of the paper's circle in each joint: an ellipse with semi-axes r₀ and v₀."""
    for axes in phase_figure(runs["plan"]).axes:
        desired = curves(axes)[1]
        q, rate = np.deg2rad(desired.get_xdata()), np.deg2rad(desired.get_ydata())
        assert np.allclose((q / np.deg2rad(57.3)) ** 2 + (rate / np.deg2rad(114.59)) ** 2, 1.0, atol=1e-9)


def test_every_run_has_one_colour_in_all_figures(runs):
    found = [path_figure(runs), phase_figure(runs), error_figure(runs), speed_figure(runs), tool_figure(runs)]
    for figure in [*found, torque_figure(runs), error_bands_figure(runs)]:
        for axes in figure.axes:
            drawn = {to_hex(line.get_color()).upper() for line in curves(axes)}
            assert set(RUN_COLOURS[:2]) <= drawn
            assert not drawn & set(RUN_COLOURS[2:])
    grid = np.reshape(comparison_figure(runs).axes, (-1, 2))
    for column, colour in enumerate(RUN_COLOURS[:2]):
        assert all(colour in {to_hex(line.get_color()).upper() for line in a.lines} for a in grid[:, column])


def test_columns_of_a_comparison_have_the_same_axes(runs):
    for left, right in np.reshape(comparison_figure(runs).axes, (-1, 2)):
        assert left.get_xlim() == right.get_xlim()
        assert left.get_ylim() == right.get_ylim()


def test_limits_are_drawn_where_they_are(runs, arm):
    """By default those of the run's own robot, always inside the panel, on both sides."""
    for axes, limit in zip(torque_figure(runs).axes, arm.limits.effort, strict=True):
        flat = {line.get_ydata()[0] for line in axes.lines if np.ptp(line.get_ydata()) == 0}
        assert {limit, -limit} <= flat
        assert axes.get_ylim()[1] > limit > -limit > axes.get_ylim()[0]
    assert "peak 100 % of 150 N m" in torque_figure(runs["plan"]).axes[0].get_title(loc="right")
    unbounded = torque_figure(runs, limits=[np.inf, 30.0]).axes
    assert [len([line for line in a.lines if np.ptp(line.get_ydata()) == 0]) for a in unbounded] == [0, 2]
    with pytest.raises(InputError, match="limits"):
        torque_figure(runs, limits=[1.0, 2.0, 3.0])


def test_limits_that_drop_are_drawn_as_they_act(arm):
    law = pc.Projection(arm, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0])
    loop, drop = pc.SampledLoop(torque_limits=[60.0, 12.0]), pc.TorqueLimitDrop([0.5, 0.25], 0.05, 0.02)
    run = pc.simulate(law, [0.7, 1.2], duration=0.1, loop=loop, disturbance=drop, progress=False)
    for k, axes in enumerate(torque_figure(run).axes):
        drawn = [line.get_ydata() for line in axes.lines if line.get_drawstyle() == "steps-post"]
        limit = run.array("tau_limit")[0, :, k]
        np.testing.assert_array_equal(drawn, [limit, -limit])
        share = (np.abs(run.array("tau")[0, :, k]) / limit).max()
        assert axes.get_title(loc="right") == f"peak {100 * share:.3g} % of its limit"
        assert np.ptp(limit) > 0


def test_the_speed_is_beside_its_profile(runs, circle):
    rate, profile = curves(speed_figure(runs["plan"]).axes[0])
    assert np.array_equal(rate.get_ydata(), runs["plan"].array("sdot")[0])
    assert np.allclose(profile.get_ydata(), circle.theta(np.zeros(1)))


def test_the_tool_is_where_the_robot_says(runs, arm):
    run = runs["projection"]
    x = 1e3 * arm.frame_pose(run.array("q")[0], "tool")[:, :3, 3]
    axes = tool_figure(run, tool="tool").axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [mm]", "z [mm]")
    assert any(np.allclose(line.get_xydata(), x[:, [0, 2]]) for line in curves(axes) if len(line.get_xdata()) == len(x))
    coloured = tool_figure(run, tool="tool", errors=True)
    assert coloured.axes[0].collections[-1].get_array().max() > 10  # mm, at the start


def test_the_inset_never_hides_the_curve(arm, circle):
    """It magnifies a small steady state; a large one is drawn without it."""
    law = ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    settled = simulate(law, START, duration=4.0, progress=False)
    swinging = simulate(law, START, duration=0.05, progress=False)
    assert len(error_figure(settled).axes[0].child_axes) == 1
    assert len(error_figure(swinging).axes[0].child_axes) == 0


def test_bands_hold_the_rollouts(arm, circle):
    starts = START + 0.2 * np.random.default_rng(0).normal(size=(20, 2))
    law = Projection(arm, circle, 800.0, [45.0, 100.0])
    run = simulate(law, starts, duration=0.5, progress=False)
    axes = error_bands_figure(run).axes[0]
    assert np.allclose(axes.lines[0].get_ydata(), np.median(np.rad2deg(run.norm("e_p")), axis=0))
    heights = [band.get_paths()[0].vertices[:, 1] for band in axes.collections]
    assert heights[0].max() == pytest.approx(np.rad2deg(run.norm("e_p")).max())
    assert heights[1].max() < heights[0].max()


def test_quantiles_are_those_of_what_is_a_number():
    values = np.random.default_rng(1).normal(size=(30, 7))
    values[::4, 2], values[:, 3] = np.nan, np.nan
    for level, found in zip((0.0, 0.05, 0.5, 1.0), quantiles(values, (0.0, 0.05, 0.5, 1.0)), strict=True):
        known = [column[~np.isnan(column)] for column in values.T]
        expected = [np.quantile(column, level) if len(column) else np.nan for column in known]
        assert np.allclose(found, expected, equal_nan=True)


def test_long_lines_keep_their_peaks_and_gaps():
    values = np.random.default_rng(2).normal(size=300_000)
    values[123_456], values[222_222], values[50_000:50_500] = 50.0, -60.0, np.nan
    kept = select_by_column(values)
    assert len(kept) < 15_000
    assert {0, 123_456, 222_222, len(values) - 1} <= set(kept.tolist())
    assert np.isnan(values[kept]).any()
    assert np.array_equal(select_by_column(values[:5000]), np.arange(5000))


def test_long_curves_keep_their_shape():
    s = np.linspace(0, 20 * np.pi, 1_000_000)
    x, y = np.cos(s), np.sin(2 * s)
    kept = select_by_cell(x, y)
    assert len(kept) < len(s)
    at = np.searchsorted(kept, np.arange(len(s)))
    assert np.hypot(x - x[kept[at]], y - y[kept[at]]).max() < 2e-3


def test_files_are_the_same_for_the_same_run(runs, tmp_path):
    for folder in "ab":
        written = save_figure(path_figure(runs), tmp_path / folder / "run", ["svg", "png", "pdf"])
        assert [path.name for path in written] == ["run.svg", "run.png", "run.pdf"]
    for name in ("run.svg", "run.png", "run.pdf"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.fixture
def undrawn(monkeypatch):
    """For files whose content does not matter: the name of their format stands in them."""
    monkeypatch.setattr(Figure, "savefig", lambda self, file, format, **more: file.write_text(format))  # noqa: A006
    monkeypatch.setattr("pathcontrol.view.figures.style.laid_out", lambda figure, dpi: nullcontext())


@pytest.mark.usefixtures("undrawn")
def test_a_suffix_asks_for_its_format(runs, tmp_path):
    figure = speed_figure(runs)
    assert [p.name for p in save_figure(figure, tmp_path / "v1.2")] == ["v1.2.svg", "v1.2.png"]
    assert [p.name for p in save_figure(figure, tmp_path / "x.svg")] == ["x.svg", "x.png"]
    assert [p.name for p in save_figure(figure, tmp_path / "y.pdf", formats=["svg"])] == ["y.svg", "y.pdf"]
    assert all(file.read_text() == file.suffix[1:] for file in tmp_path.iterdir())
    with pytest.raises(InputError, match="'jpg', expected some of 'svg', 'png', 'pdf'"):
        save_figure(figure, tmp_path / "z", formats=["jpg"])


def test_all_files_or_none(runs, tmp_path):
    (tmp_path / "run.png").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        save_figure(speed_figure(runs), tmp_path / "run")
    assert [p.name for p in tmp_path.iterdir()] == ["run.png"]


def test_what_does_not_belong_together_is_refused(runs, circle):
    with pytest.raises(InputError, match="expected a Run, or some by their names"):
        path_figure({})
    with pytest.raises(InputError, match="the task is for 3 joints, the run has 2"):
        path_figure(runs, Circle(0.3, 0.6, center=[0, 0, 0], joints=(0, 1)))
    one = runs["plan"].with_data(runs["plan"].data.assign_coords(joint=["a", "b"]))
    with pytest.raises(InputError, match="different joints: joint_1, joint_2; a, b"):
        comparison_figure({**runs, "other": one})


@pytest.mark.usefixtures("undrawn")
def test_the_figures_of_an_experiment(runs, tmp_path):
    written = run_figure(runs["plan"], tmp_path / "a.pdf", joints=(1, 0))
    kinds = [f"a-{kind}.{suffix}" for kind in ("errors", "path", "torque", "speed") for suffix in ("svg", "png", "pdf")]
    assert [path.name for path in written] == kinds
    assert {path.name for path in tmp_path.iterdir()} == set(kinds)


@pytest.mark.parametrize("joints", [[0], [0, 0], [0, -1], [0, 1, 2], [0.0, 1.0], [True, False], "01", 1])
def test_the_joints_of_an_experiment_are_two(joints):
    assert Output(figure_joints=[2, 0]).figure_joints == [2, 0]
    with pytest.raises(ValueError, match="two different joints, counted from 0"):
        Output(figure_joints=joints)
