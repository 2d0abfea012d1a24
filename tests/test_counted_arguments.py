"""Numbers that set how much is allocated are bounded, and the error names them before anything is."""

from __future__ import annotations

import numpy as np
import pytest

from pathcontrol.errors import InputError
from pathcontrol.profiles.limited.limited import limited
from pathcontrol.profiles.topp.time_optimal import time_optimal
from pathcontrol.robot.loading import load_robot
from pathcontrol.tasks.curves import Line
from pathcontrol.tasks.waypoints import WaypointPath
from pathcontrol.toolpaths.tool_curve import ToolCurve
from pathcontrol.view.video import _clip

LINE = Line([0.0, 0.0], [0.6, 0.4], speed=1.0)
SQUARE = WaypointPath([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], speed=0.5, closed=True)


@pytest.mark.parametrize("points", [10**12, 10**400, 1e300, 1000.5, 0, -1, np.nan, [10, 20]])
def test_tables_of_profiles_have_a_bounded_number_of_points(points):
    with pytest.raises(InputError, match=r"points"):
        time_optimal(load_robot("cicese_2dof"), LINE, points=points)
    with pytest.raises(InputError, match=r"points"):
        limited(LINE, velocity=[1.0, 1.0], points=points)


def test_points_may_be_a_whole_float():
    """Numbers of a file or of NumPy are no other numbers."""
    tables = [limited(LINE, velocity=[1.0, 1.0], points=points).s for points in (50, 50.0, np.int64(50))]
    np.testing.assert_array_equal(tables[1], tables[0])
    np.testing.assert_array_equal(tables[2], tables[0])


@pytest.mark.parametrize("laps", [1e8, 1e15, 1e300])
def test_a_stretch_of_very_many_laps_is_refused(laps):
    with pytest.raises(InputError, match=r"s_end = .* pieces, expected at most .* fewer laps"):
        _ = SQUARE.between(0.0, laps * SQUARE.period).knots


def test_a_stretch_of_many_laps_has_the_pieces_of_each():
    knots = SQUARE.between(0.0, 1000 * SQUARE.period).knots
    assert len(knots) == 4 * 1000 + 1
    np.testing.assert_allclose(np.diff(knots).reshape(1000, 4).sum(1), SQUARE.period)


@pytest.mark.parametrize(("fps", "speed"), [(1e9, 1.0), (30.0, 1e-12), (1e300, 1e-300)])
def test_a_video_has_a_bounded_number_of_frames(fps, speed):
    with pytest.raises(InputError, match=r"fps = .* speed = .* frames"):
        _clip(10.0, (1280, 720), fps, speed)


@pytest.mark.parametrize("size", [(10**6, 10**6), (1280, 20_000), (10**400, 720)])
def test_a_video_is_no_larger_than_its_format_allows(size):
    with pytest.raises(InputError, match=r"size = .* up to 16384"):
        _clip(10.0, size, 30.0, 1.0)


def test_a_curve_says_which_knots_do_not_increase():
    with pytest.raises(InputError, match=r"s\[2\] = 1 m after s\[1\] = 1 m"):
        ToolCurve([0.0, 1.0, 1.0], *np.zeros((3, 3, 3)))
