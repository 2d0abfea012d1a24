"""Paths through waypoints: through them, smooth, no stiffer than asked."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, make_interp_spline
from strategies import floats

from pathcontrol import InputError, Projection, SplinePath, UnknownNameError, WaypointPath, check_task, simulate


def waypoints(seed: int, closed: bool, n: int = 3, count: int = 7) -> np.ndarray:
    """Postures in a rough circle, or along a rough line, so that the path never stands still."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    base = np.stack([np.cos(angle), np.sin(angle)], -1) if closed else np.stack([angle, 0 * angle], -1)
    return np.concatenate([base, np.zeros((count, n - 2))], -1) + 0.15 * rng.normal(size=(count, n))


def bending(path) -> float:
    """∫‖q_d''‖²ds, exact for a cubic spline: Gauss's rule of two points on each piece."""
    s = path.parameters
    middle, half = (s[1:] + s[:-1]) / 2, np.diff(s) / 2
    return sum(float((half * (path.ddq_d(middle + sign * half / np.sqrt(3)) ** 2).sum(-1)).sum()) for sign in (-1, 1))


@given(st.integers(0, 999), st.booleans(), st.sampled_from(["centripetal", "chord", "uniform"]))
def test_it_passes_through_every_waypoint_and_is_a_valid_task(seed, closed, parametrisation):
    points = waypoints(seed, closed)
    path = WaypointPath(points, 0.7, closed=closed, parametrisation=parametrisation)
    check_task(path, 3)
    assert np.abs(path.q_d(path.parameters[: len(points)]) - points).max() < 1e-12
    assert np.allclose(np.linalg.norm(path.at(np.linspace(*path.one_traverse, 50)).velocity, axis=-1), 0.7)
    powers = {"centripetal": 0.5, "chord": 1.0, "uniform": 0.0}
    ring = np.concatenate([points, points[:1]]) if closed else points
    steps = np.linalg.norm(np.diff(ring, axis=0), axis=-1) ** powers[parametrisation]
    assert np.allclose(np.diff(path.parameters), steps)


@given(st.integers(0, 999), st.booleans())
def test_it_is_twice_continuously_differentiable(seed, closed):
    path = WaypointPath(waypoints(seed, closed), 1.0, closed=closed)
    knots, h = path.parameters[:-1] if closed else path.parameters[1:-1], 1e-9
    for f in (path.q_d, path.dq_d, path.ddq_d):
        scale = np.abs(f(np.linspace(*path.one_traverse, 50))).max()
        assert np.abs(f(knots + h) - f(knots - h)).max() < 1e-5 * scale
    if closed:
        assert np.allclose(path.q_d(path.s0 + 3.3 * path.period), path.q_d(path.s0 + 0.3 * path.period))


def test_it_is_the_natural_spline_of_scipy():
    points = waypoints(3, False)
    path = WaypointPath(points, 1.0)
    s = np.linspace(*path.one_traverse, 101)
    reference = CubicSpline(path.parameters, points, bc_type="natural")
    assert np.allclose(path.q_d(s), reference(s), atol=1e-12)
    assert np.allclose(path.ddq_d(s), reference(s, 2), atol=1e-9)


@given(st.integers(0, 99), st.booleans(), floats(1e-4, 0.1))
def test_the_tolerance_is_kept_used_and_worth_it(seed, closed, tolerance):
    points = waypoints(seed, closed)
    exact, loose = (WaypointPath(points, 1.0, closed=closed, tolerance=t) for t in (0.0, tolerance))
    moves = np.linalg.norm(loose.q_d(loose.parameters[: len(points)]) - points, axis=-1)
    assert moves.max() <= tolerance * (1 + 1e-9)
    assert moves.max() > 0.99 * tolerance  # the smoothest path leaves none of it unused
    assert bending(loose) < bending(exact)


@pytest.mark.parametrize("closed", [False, True])
def test_the_smoothed_path_is_the_optimum_for_its_stiffness(closed):
    """At the optimum the moves are a multiple of the gradient of the bending: y − p = −λ K y."""
    points = waypoints(5, closed, n=2)
    path = WaypointPath(points, 1.0, closed=closed, tolerance=0.03)
    y, h = path.q_d(path.parameters[: len(points)]), 1e-5

    def bent(at: np.ndarray) -> float:
        ring = np.concatenate([at, at[:1]]) if closed else at
        spline = make_interp_spline(path.parameters, ring, k=3, bc_type="periodic" if closed else "natural")
        probe = SplinePath(spline, 1.0, closed)
        probe.parameters = path.parameters
        return bending(probe)

    gradient = np.zeros_like(y)
    for index in np.ndindex(*y.shape):
        step = np.zeros_like(y)
        step[index] = h
        gradient[index] = (bent(y + step) - bent(y - step)) / (2 * h)
    move = (points - y).ravel()
    cosine = move @ gradient.ravel() / np.linalg.norm(move) / np.linalg.norm(gradient)
    assert cosine == pytest.approx(1.0, abs=1e-6)


def test_an_arm_follows_it(ideal_arm):
    path = WaypointPath(waypoints(1, True, n=2) * 0.8, 1.0, closed=True)
    law = Projection(ideal_arm, path, 800.0, [45.0, 100.0])
    run = simulate(law, path.q_d(np.array(0.0)), duration=2 * path.period, progress=False)
    assert run.norm("e_p")[0, run.time > 1].max() < 0.02
    assert run.array("s")[0, -1] > path.period


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: WaypointPath([[0.0, 0.0]], 1.0), ["(1, 2)", "at least 2"]),
        (lambda: WaypointPath([[0.0, 0.0], [1.0, 0.0]], 1.0, closed=True), ["at least 3"]),
        (lambda: WaypointPath([0.0, 1.0], 1.0), ["(2,)", "(m, n)"]),
        (lambda: WaypointPath([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]], 1.0), ["points 1 and 2", "leave one"]),
        (lambda: WaypointPath([[0, 0], [1, 0], [1, 1], [0, 0]], 1.0, closed=True), ["points 3 and 0", "first point"]),
        (lambda: WaypointPath([[0.0, np.nan], [1.0, 0.0]], 1.0), ["points[0, 1] is nan"]),
        (lambda: WaypointPath([[0.0, 0.0], [1.0, 0.0]], 1.0, tolerance=-1), ["tolerance = -1"]),
        (lambda: WaypointPath(waypoints(0, True), 1.0, closed=True, tolerance=10.0), ["standstill", "tolerance = 10"]),
        (lambda: WaypointPath([[0.0, 0.0], [1.0, 0.0]], 1.0, parametrisation=[1.0, 0.0]), ["2 increasing"]),
        (lambda: SplinePath(make_interp_spline([0.0, 1.0, 2.0], np.eye(3), k=1), 1.0), ["degree 1", "3 or more"]),
    ],
)
def test_bad_waypoints(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


def test_an_unknown_parametrisation():
    with pytest.raises(UnknownNameError, match="'centripetal'"):
        WaypointPath([[0.0, 0.0], [1.0, 0.0]], 1.0, parametrisation="arc")
