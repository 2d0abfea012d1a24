"""What the figures choose to show."""

from __future__ import annotations

import numpy as np
import pytest

from pathcontrol import Circle, ExtendedMotionPlan, InputError, error_figure, load_robot, path_figure, simulate

START = np.deg2rad([40.0, 70.0])


def test_the_joints_that_move_are_drawn():
    pytest.importorskip("example_robot_data")
    robot = load_robot("ur5").with_friction(None)
    task = Circle(0.3, 0.6, center=[0, -1.2, 1.2, -1.0, -1.5, 0], joints=(1, 2))
    run = simulate(ExtendedMotionPlan(robot, task, 400.0, 40.0, 20.0), task.center, duration=4.0, progress=False)
    axes = path_figure(run, task).axes[0]
    assert "q_{2}" in axes.get_xlabel()
    assert "q_{3}" in axes.get_ylabel()
    with pytest.raises(InputError, match="from 0 to 5"):
        path_figure(run, task, joints=(0, 6))


def test_angles_are_shown_in_degrees(arm, circle):
    run = simulate(ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0), START, duration=1.0, progress=False)
    drawn = next(line for line in path_figure(run, circle).axes[0].lines if line.get_label() == "arm")
    assert np.allclose(drawn.get_xdata(), np.rad2deg(run.array("q")[0, :, 0]))
    with pytest.raises(InputError, match="rollout 5"):
        error_figure(run, rollout=5)


def test_the_inset_never_hides_the_curve(arm, circle):
    """It magnifies a small steady state; a large one is drawn without it."""
    law = ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    settled = simulate(law, START, duration=4.0, progress=False)
    swinging = simulate(law, START, duration=0.05, progress=False)
    assert len(error_figure(settled).axes[0].child_axes) == 1
    assert len(error_figure(swinging).axes[0].child_axes) == 0
