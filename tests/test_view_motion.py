"""Laws of what is drawn: frames, quaternions, lines, the ground and the camera."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pathcontrol.view.film.camera import HIGHEST, LOWEST, Camera, picture_axes, view_direction
from pathcontrol.view.film.ground import ground_grid
from pathcontrol.view.film.motion import at_times, continuous_quaternions, frame_times
from pathcontrol.view.film.tube import distinct, simplified, tube

seeds = st.integers(0, 2**32 - 1)


def wandering(seed: int, steps: int = 200) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(steps, 3)).cumsum(axis=0)


def to_polyline(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each point from a polyline."""
    start, along = line[:-1], np.diff(line, axis=0)
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(-1) / (along**2).sum(-1), 0, 1)
    return np.linalg.norm(offset - share[..., None] * along, axis=-1).min(axis=1)


@given(st.floats(1e-3, 100), st.floats(1, 240))
def test_frames_go_from_the_first_sample_to_the_last(duration: float, fps: float) -> None:
    times = frame_times(np.array([0.0, duration]), fps)
    steps = np.diff(times)
    assert times[0] == 0
    assert times[-1] == duration
    assert (steps > 0).all()
    np.testing.assert_allclose(steps[:-1], 1 / fps, rtol=1e-6)
    assert steps[-1] <= 1 / fps * (1 + 1e-5)


def test_a_run_of_one_sample_has_one_frame() -> None:
    np.testing.assert_array_equal(frame_times(np.array([0.0]), 50), [0.0])


@given(seeds)
def test_interpolation_hits_the_samples(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time, samples = np.sort(rng.uniform(size=20)), rng.normal(size=(20, 3))
    np.testing.assert_array_equal(at_times(time, samples, time), samples)
    np.testing.assert_array_equal(at_times(time, samples[:, 0], time), samples[:, 0])


@given(seeds)
def test_quaternions_are_unit_keep_their_sign_and_mean_the_rotation(seed: int) -> None:
    angles = np.linspace(0, 7 * np.pi, 300)[:, None] * np.random.default_rng(seed).normal(size=3)
    rotations = Rotation.from_euler("zyx", angles).as_matrix()
    quaternions = continuous_quaternions(rotations)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1, atol=1e-12)
    assert ((quaternions[1:] * quaternions[:-1]).sum(-1) >= 0).all()
    np.testing.assert_allclose(Rotation.from_quat(quaternions).as_matrix(), rotations, atol=1e-12)


@given(seeds, st.floats(1e-3, 10))
def test_a_simplified_line_is_nowhere_farther_than_the_tolerance(seed: int, tolerance: float) -> None:
    points = wandering(seed)
    line = simplified(points, tolerance)
    assert to_polyline(points, line).max() <= tolerance * (1 + 1e-9)
    np.testing.assert_array_equal(line[[0, -1]], points[[0, -1]])


@given(seeds)
def test_a_simplified_line_has_no_more_segments_than_allowed(seed: int) -> None:
    assert len(simplified(wandering(seed), 1e-9, most=40)) <= 41


def test_a_straight_line_is_one_segment() -> None:
    assert len(simplified(np.linspace([0, 0, 0], [1, 2, 3], 500), 1e-9)) == 2


@given(seeds, st.integers(3, 9))
def test_a_tube_is_round_and_faces_outwards(seed: int, sides: int) -> None:
    points = wandering(seed, 30)
    mesh = tube(points, 0.01, sides)
    rings = mesh.vertices.reshape(len(points), sides, 3)
    np.testing.assert_allclose(np.linalg.norm(rings - points[:, None], axis=-1), 0.01, rtol=1e-9)
    np.testing.assert_allclose(rings.mean(axis=1), points, atol=1e-9)
    assert mesh.faces.max() == len(mesh.vertices) - 1
    straight = tube(np.array([[0.0, 0, 0], [1, 1, 1]]), 0.1, sides)
    a, b, c = straight.vertices[straight.faces.T]
    middle = ((a + b + c) / 3 - 0.5) @ (np.eye(3) - 1 / 3)
    assert ((np.cross(b - a, c - a) * middle).sum(-1) > 0).all()


def test_a_tube_survives_a_line_that_turns_back() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0]])
    assert np.isfinite(tube(points, 0.1).vertices).all()


def test_points_that_repeat_are_dropped() -> None:
    np.testing.assert_array_equal(distinct(np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]]))[:, 0], [0, 1, 0])
    assert len(distinct(np.zeros((5, 3)))) == 1


@given(seeds, st.floats(0.01, 100))
def test_the_ground_is_level_under_the_scene_and_not_crowded(seed: int, size: float) -> None:
    points = size * np.random.default_rng(seed).normal(size=(20, 3))
    grid = ground_grid(points)
    assert (grid[..., 2] == 0).all()
    assert 100 < len(grid) < 3000
    lower, upper = grid.reshape(-1, 3).min(0), grid.reshape(-1, 3).max(0)
    assert (lower[:2] <= points.min(0)[:2]).all()
    assert (upper[:2] >= points.max(0)[:2]).all()


@given(seeds, st.floats(0.3, 3))
def test_the_camera_sees_all_of_the_scene(seed: int, aspect: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(500, 3)) * rng.uniform(0.1, 2, size=3) + rng.normal(size=3)
    camera = Camera.framing(points, view_direction(points[:50], points))
    slope = np.tan(np.deg2rad(35 / 2))
    right, up, near = camera.outline.T
    distance = (near + 1.08 * np.maximum(np.abs(up), np.abs(right) / aspect) / slope).max()  # as in player.js
    right, up, near = picture_axes(camera.direction) @ (points - camera.target).T
    assert (np.abs(up) / (distance - near) < slope).all()
    assert (np.abs(right) / (distance - near) < slope * aspect).all()


@given(seeds)
def test_the_eye_is_above_and_z_is_up_in_the_picture(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(50, 3))
    direction = view_direction(points, points + 1)
    assert LOWEST - 1e-9 <= np.arcsin(direction[2]) <= HIGHEST + 1e-9
    axes = picture_axes(direction)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert axes[0, 2] == pytest.approx(0)
    assert axes[1, 2] > 0


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_path_in_an_upright_plane_is_seen_from_the_side_that_is_free(axis: int, side: int) -> None:
    angle = np.linspace(0, 6, 100)
    path = np.zeros((100, 3))
    path[:, 1 - axis], path[:, 2] = np.cos(angle), np.sin(angle)
    body = np.zeros((2, 3))
    body[:, axis] = -0.3 * side
    assert view_direction(path, body)[axis] * side > np.cos(np.deg2rad(35))


@pytest.mark.parametrize(
    "path",
    [
        np.zeros((1, 3)),
        np.linspace([0, 0, 0], [0, 0, 1.0], 50),
        np.linspace([0, 0, 0], [1.0, 0, 0], 50),
        np.column_stack([np.cos(np.arange(50)), np.sin(np.arange(50)), np.zeros(50)]),
    ],
    ids=["point", "upright line", "level line", "level circle"],
)
def test_any_path_can_be_looked_at(path: np.ndarray) -> None:
    direction = view_direction(path, np.zeros((1, 3)))
    assert np.linalg.norm(direction) == pytest.approx(1)
