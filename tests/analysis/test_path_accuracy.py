"""Accuracy and repeatability along a path: synthetic laps give their closed forms."""

import json

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

import pathcontrol as pc
from pathcontrol.errors import InputError, UnknownNameError

ARM = pc.load_robot("cicese_2dof")
RADIUS, RATE, PERIOD = 1.0, 2.0, 5e-3  # rad, rad/s, s
CIRCLE = pc.Circle(RADIUS, RATE)
LAP = 2 * np.pi / RATE


def laps_of(x, v, laps, late=0.0):
    """A run of whole laps on the paper's circle whose plan is at t, with positions x(t) and velocities v(t)."""
    t = np.arange(0.0, (laps + 0.5) * LAP + 2 * late, PERIOD)
    run = pc.Run.from_log(t, x(t), v(t), robot=ARM, task=CIRCLE)
    data = run.data.copy()
    data["s"] = (("rollout", "time"), (RATE * t)[None])
    return run.with_data(data)


def turning(radii, offset=(0.0, 0.0), late=0.0):
    """Positions and velocities of an ellipse with these half axes, moved and late."""
    a, b = radii

    def x(t):
        angle = RATE * (t - late)
        return np.array(offset) + np.stack([a * np.cos(angle), b * np.sin(angle)], axis=-1)

    def v(t):
        angle = RATE * (t - late)
        return RATE * np.stack([-a * np.sin(angle), b * np.cos(angle)], axis=-1)

    return x, v


def test_an_exact_lap_has_no_error():
    found = pc.accuracy(laps_of(*turning((1.0, 1.0)), laps=3))
    assert found.cycles == 2
    assert found.unit == "rad"
    assert found.path_accuracy < 1e-9
    assert found.path_repeatability < 1e-9
    assert abs(found.velocity_accuracy) < 1e-9
    assert found.velocity_fluctuation < 1e-9


def test_a_lag_is_no_error_of_the_path():
    found = pc.accuracy(laps_of(*turning((1.0, 1.0), late=0.1), laps=3, late=0.1))
    assert found.path_accuracy < 1e-9
    assert found.path_repeatability < 1e-9


@pytest.mark.parametrize("offset", [(0.02, 0.0), (0.03, -0.04)])
def test_a_moved_circle_is_away_by_what_is_seen_in_normal_planes(offset):
    """Along e = (cos φ, sin φ) a circle moved by o lies at o·e + √(r² − ‖o‖² + (o·e)²)."""
    found = pc.accuracy(laps_of(*turning((1.0, 1.0), offset), laps=2))
    along = np.array(offset) @ np.stack([np.cos(found.s), np.sin(found.s)])
    expected = along + np.sqrt(RADIUS**2 - np.dot(offset, offset) + along**2) - RADIUS
    np.testing.assert_allclose(np.linalg.norm(found.attained[0], axis=-1) - RADIUS, expected, atol=1e-9)
    assert found.path_accuracy == pytest.approx(np.abs(expected).max(), abs=1e-9)


def test_an_ellipse_is_away_by_its_polar_equation():
    a, b = 1.03, 0.96
    found = pc.accuracy(laps_of(*turning((a, b)), laps=2))
    polar = a * b / np.hypot(b * np.cos(found.s), a * np.sin(found.s))
    assert found.path_accuracy == pytest.approx(np.abs(polar - RADIUS).max(), abs=1e-9)
    # the polar angle φ is crossed at the eccentric anomaly E, tan E = (a/b) tan φ
    anomaly = np.arctan2(a * np.sin(found.s), b * np.cos(found.s))
    speed = RATE * np.hypot(a * np.sin(anomaly), b * np.cos(anomaly))
    np.testing.assert_allclose(found.speed[0], speed, atol=1e-9)
    assert found.velocity_fluctuation == pytest.approx(np.ptp(speed), abs=1e-9)
    assert found.velocity_accuracy == pytest.approx(speed.mean() / RATE - 1, abs=1e-9)


@pytest.mark.parametrize("radii", [(1.0, 1.01), (0.98, 1.0, 1.05, 1.01)])
def test_laps_that_differ_repeat_by_mean_and_three_deviations(radii):
    """Laps are circles of radii r_j, joined far from the sections by steps at the beginning of each lap."""
    radii = np.array(radii)

    def radius(t):
        return radii[np.clip((RATE * t / (2 * np.pi)).astype(int), 0, len(radii) - 1)]

    def x(t):
        return radius(t)[:, None] * turning((1.0, 1.0))[0](t)

    def v(t):
        return radius(t)[:, None] * turning((1.0, 1.0))[1](t)

    found = pc.accuracy(laps_of(x, v, laps=len(radii)), skip=0, sections=50)
    assert found.cycles == len(radii)
    distance = np.abs(radii - radii.mean())
    assert found.path_accuracy == pytest.approx(abs(radii.mean() - 1), abs=1e-9)
    assert found.path_repeatability == pytest.approx(distance.mean() + 3 * np.std(distance, ddof=1), abs=1e-9)
    assert found.velocity_repeatability == pytest.approx(3 * np.std(radii, ddof=1), abs=1e-9)
    assert found.velocity_accuracy == pytest.approx(radii.mean() - 1, abs=1e-9)


def test_one_lap_cannot_say_how_repeatable_the_arm_is():
    found = pc.accuracy(laps_of(*turning((1.0, 1.0)), laps=1), skip=0)
    assert found.cycles == 1
    assert np.isnan(found.path_repeatability)
    assert np.isnan(found.velocity_repeatability)
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert told["path_repeatability"] is None
    assert "one cycle" in told["notes"][0]


def test_noise_of_the_radius_repeats_by_its_own_statistics():
    """Smooth noise: each lap has a random radius r_j(φ) = r + Σ a_jk sin(kφ + p_jk), known at every section."""
    rng = np.random.default_rng(1)
    laps, waves = 4, np.arange(1, 4)
    size, phase = 1e-2 * rng.standard_normal((laps, 3)), rng.uniform(0, 2 * np.pi, (laps, 3))

    def lap_of(t):
        return np.clip((RATE * t / (2 * np.pi)).astype(int), 0, laps - 1)

    def radius(t):
        at = np.multiply.outer(RATE * t, waves) + phase[lap_of(t)]
        return 1 + (size[lap_of(t)] * np.sin(at)).sum(-1), RATE * (size[lap_of(t)] * waves * np.cos(at)).sum(-1)

    def x(t):
        return radius(t)[0][:, None] * turning((1.0, 1.0))[0](t)

    def v(t):
        r, rate = radius(t)
        return r[:, None] * turning((1.0, 1.0))[1](t) + rate[:, None] * turning((1.0, 1.0))[0](t)

    found = pc.accuracy(laps_of(x, v, laps=laps), skip=0, sections=40)
    at = np.multiply.outer(found.s, waves)[None] + phase[:, None]
    exact = 1 + (size[:, None] * np.sin(at)).sum(-1)  # (laps, sections)
    distance = np.abs(exact - exact.mean(0))
    assert found.path_accuracy == pytest.approx(np.abs(exact.mean(0) - 1).max(), abs=1e-9)
    assert found.path_repeatability == pytest.approx((distance.mean(0) + 3 * distance.std(0, ddof=1)).max(), abs=1e-9)


def test_a_tool_is_compared_in_metres_with_its_orientation():
    """Splines of the tool's positions and of its angle, crossed by a root finder, say the same."""
    circle = pc.Circle(0.3, 0.6, center=[0.3, 1.2])  # away from the straight elbow, where the tool would stop
    law = pc.Projection(ARM, circle, 800.0, [45.0, 100.0])
    run = pc.simulate(law, [0.6, 1.2], duration=4 * LAP, progress=False)
    found = pc.accuracy(run, frame="tool", sections=20)
    assert found.unit == "m"
    t, q, s = run.time, run.array("q")[0], run.array("s")[0]
    position = CubicSpline(t, ARM.frame_pose(q, "tool")[:, :3, 3])
    angles = CubicSpline(t, q)
    for i, at in enumerate(found.s):
        q_d, dq_d = circle.q_d(np.array(at)), circle.dq_d(np.array(at))
        centre, tangent = ARM.frame_pose(q_d, "tool")[:3, 3], ARM.frame_jacobian(q_d, "tool")[:3] @ dq_d

        def ahead(time, centre=centre, tangent=tangent):
            return (position(time) - centre) @ tangent

        plan = float(np.interp(at + 2 * np.pi, s, t))
        here = brentq(ahead, plan - 0.1, plan + 0.1, xtol=1e-14)
        np.testing.assert_allclose(found.attained[0, i], position(here), atol=1e-8)
        # a planar arm turns by the sum of the errors of its joints
        assert np.linalg.norm(found.rotation[0, i]) == pytest.approx(abs((angles(here) - q_d).sum()), abs=1e-8)
    distance = np.linalg.norm(found.attained[0] - found.commanded, axis=-1)
    assert found.path_accuracy == pytest.approx(distance.max(), abs=1e-12)
    assert found.orientation_accuracy.max() > 0
    assert np.isnan(found.orientation_repeatability).all()


def test_rollouts_of_an_open_path_are_its_cycles():
    line = pc.Line([0.0, 0.5], [1.0, 1.0], speed=0.5)
    law = pc.Projection(ARM, line, 800.0, [45.0, 100.0])
    run = pc.simulate(law, [[0.0, 0.5], [0.01, 0.5], [0.0, 0.51]], duration=6.0, progress=False)
    found = pc.accuracy(run)
    assert found.cycles == 3
    assert 10 <= len(found.s) < 200  # the one that starts on the way does not cross the first ones
    distance = np.linalg.norm(found.attained - found.attained.mean(0), axis=-1)
    assert distance[:, 0].max() > 1e-3
    assert distance[:, -1].max() < 1e-3


def test_what_cannot_be_measured_is_told():
    run = laps_of(*turning((1.0, 1.0)), laps=1)
    with pytest.raises(InputError, match="skip"):
        pc.accuracy(run)
    with pytest.raises(InputError, match="sections"):
        pc.accuracy(run, sections=3)
    with pytest.raises(UnknownNameError, match="nowhere"):
        pc.accuracy(run, frame="nowhere", skip=0)
