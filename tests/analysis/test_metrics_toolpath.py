"""The numbers of a run along a toolpath: how much was cut, how fast beside the feed, contour by contour."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.analysis.contours import contour_numbers, contour_table
from pathcontrol.analysis.deviation import tool_deviation

BOARD = np.array([[1, 0, 0, 0.3], [0, 0, -1, -0.05], [0, 1, 0, 0.6], [0, 0, 0, 1.0]])
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="30mm" viewBox="0 0 60 30"><path d="{}"/></svg>'


def followed(tmp_path, duration, d="M0,0 H20 M30,0 H45"):
    file = tmp_path / "lines.svg"
    file.write_text(SVG.format(d).replace("<path", '<path fill="none" stroke="black"'), encoding="utf-8")
    robot = pc.load_robot("cicese_2dof")
    task = pc.ToolpathTask(robot, "tool", pc.read_toolpath(file, feed=0.05), BOARD, clearance=0.0)
    laws = [pc.ExtendedMotionPlan(robot, path, 800.0, 45.0, k=2.0, friction="full") for path in task]
    return task, pc.simulate_sequence(laws, task.q_d(np.array(0.0)), duration=duration, task=task, progress=False)


def test_speed_coverage_and_time_of_each_contour(tmp_path):
    task, run = followed(tmp_path, 10.0)
    numbers = pc.toolpath_metrics(run)
    assert numbers["coverage"] == numbers["progress"] == [1.0]
    assert numbers["feed"][0] == pytest.approx(0.05)
    assert numbers["drawing_deviation_peak"][0] < 2e-4
    assert "orientation_error_peak" not in numbers  # the tool may turn as it likes
    tool = run.robot.frame_pose(run.array("q")[0], "tool")[:, :3, 3]
    speed = np.linalg.norm(np.gradient(tool, run.time, axis=0), axis=-1)
    cutting = np.array([not contour.rapid for contour in task.contours])[run["path_index"].to_numpy()]
    assert numbers["tool_speed_mean"][0] == pytest.approx(speed[cutting].mean(), rel=0.02)
    contours = contour_numbers(run, task, run.robot)
    away = tool_deviation(run, run.robot, task.frame, task.contours)
    assert contour_numbers(run, task, run.robot, away=away[0]) == contours
    assert max(one.deviation for one in contours if not one.rapid) == numbers["tool_deviation_peak"][0]
    assert [one.rapid for one in contours] == [False, True, False]
    finish = run.data["path_finish_time"].to_numpy()
    assert [one.time for one in contours] == pytest.approx(np.diff(finish, prepend=0.0))
    assert numbers["cut_time"][0] == pytest.approx(contours[0].time + contours[2].time)
    assert [one.length for one in contours] == pytest.approx([0.02, 0.01, 0.015])
    assert len(contour_table(run)) == 4


def test_what_was_not_cut_shows(tmp_path):
    """The time is up in the middle of the second contour: 20 mm and what was done of 15 mm."""
    task, whole = followed(tmp_path, 10.0)
    finish = whole.data["path_finish_time"].to_numpy()
    longest = [5.0, 5.0, 0.5 * (finish[2] - finish[1])]
    laws = [pc.ExtendedMotionPlan(whole.robot, path, 800.0, 45.0, k=2.0, friction="full") for path in task]
    run = pc.simulate_sequence(laws, task.q_d(np.array(0.0)), duration=longest, task=task, progress=False)
    numbers = pc.toolpath_metrics(run, tolerance=1e-4)
    end = run.robot.frame_pose(run.array("q")[0, -1], "tool")[:3, 3]
    left = np.linalg.norm(end - task.contours[2].end)
    assert numbers["drawing_deviation_peak"][0] == pytest.approx(left, abs=1e-4)
    assert numbers["coverage"][0] == pytest.approx(1 - left / 0.035, abs=0.01)
    assert np.isnan(numbers["path_time"][0])
    assert numbers["progress"][0] < 0.95
