"""The tool's velocity is within 0.1 % of the curve's everywhere, also where that alone says how many knots it takes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import CartesianPath, ToolCurve, load_robot


@pytest.mark.parametrize("tolerance", [1e-5, 1e-2])
@settings(max_examples=3)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_velocity_is_kept_between_the_places_of_the_report(tolerance, seed):
    """On 64 places in each interval, by the arm's Jacobian; with a wide tolerance the velocity decides."""
    robot, rng = load_robot("cicese_2dof"), np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    points = np.stack([0.1 * np.cos(angle), 0 * angle, 0.1 * np.sin(angle)], axis=-1)
    points[:, ::2] += rng.uniform(-0.03, 0.03, (8, 2))
    center = np.array([rng.uniform(0.3, 0.55), -0.05, rng.uniform(0.8, 1.1)])
    curve = ToolCurve.spline(center + points, closed=True)
    path = CartesianPath(robot, "tool", curve, speed=0.1, tolerance=tolerance)
    knots = path.knots
    s = (knots[:-1, None] + np.diff(knots)[:, None] * np.linspace(0, 1, 65)).ravel()
    velocity = (robot.frame_jacobian(path.q_d(s), "tool")[:, :3] @ path.dq_d(s)[..., None])[..., 0]
    wanted = curve.at(s).dp
    off = np.linalg.norm(velocity - wanted, axis=-1) / np.linalg.norm(wanted, axis=-1)
    assert off.max() <= 1e-3
    assert off.max() <= 1.5 * path.report.velocity_deviation + 1e-9
