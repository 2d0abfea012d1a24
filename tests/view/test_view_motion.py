"""Laws of what is drawn: key frames, quaternions, lines, the ground and the camera."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from test_film import played

from pathcontrol.view.animation.scene.camera import HIGHEST, LOWEST, Camera, picture_axes, view_direction
from pathcontrol.view.animation.scene.keyframes import line_keys
from pathcontrol.view.animation.scene.scene_builder import ground_grid
from pathcontrol.view.animation.scene.trace import FRAME, MOST_RINGS, trace
from pathcontrol.view.animation.scene.tracks import Track, continuous_quaternions
from pathcontrol.view.animation.scene.tube import SIDES, dashes, distinct, join_meshes, simplify, tube

seeds = st.integers(0, 2**32 - 1)


def wandering(seed: int, steps: int = 200) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(steps, 3)).cumsum(axis=0)


def to_polyline(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each point from a polyline."""
    start, along = line[:-1], np.diff(line, axis=0)
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(-1) / (along**2).sum(-1), 0, 1)
    return np.linalg.norm(offset - share[..., None] * along, axis=-1).min(axis=1)


@st.composite
def motions(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Sample times and poses (k, 4, 4) of something that swings, stops, jumps or wanders, sampled anyhow."""
    rng, samples = np.random.default_rng(draw(seeds)), draw(st.integers(1, 600))
    steps = rng.uniform(0.1, 1.9, samples) if draw(st.booleans()) else np.ones(samples)
    time = draw(st.sampled_from([1e-5, 1e-3, 0.1])) * (np.cumsum(steps) - steps[0])
    speed, size = draw(st.floats(0.0, 50.0)), draw(st.floats(0.0, 3.0))
    swing = np.sin(speed * time[:, None] * rng.uniform(0.2, 2, 6) + rng.uniform(0, 6, 6)) * rng.normal(size=6)
    kind = draw(st.sampled_from(["smooth", "kinks", "jumps", "wander", "rest"]))
    if kind == "kinks":
        swing = np.abs(swing)
    elif kind == "jumps":
        swing = np.where(rng.uniform(size=(samples, 1)).cumsum(0) % 40 < 20, swing, -swing)
    elif kind == "wander":
        swing = rng.normal(size=(samples, 6)).cumsum(axis=0) * 1e-3
    elif kind == "rest":
        swing = swing * (np.arange(samples) % 200 < 20)[:, None]
    poses = np.tile(np.eye(4), (samples, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = Rotation.from_rotvec(2 * swing[:, :3]).as_matrix(), size * swing[:, 3:]
    return time.astype(np.float32).astype(float), poses


@settings(max_examples=200)
@given(motions())
def test_a_track_is_within_its_error_at_every_sample(motion: tuple[np.ndarray, np.ndarray]) -> None:
    time, poses = motion
    track = Track.from_poses(time, poses).thin()
    single = [column.astype(np.float32).astype(float) for column in (track.times, track.positions, track.quaternions)]
    positions, rotations = played(tuple(single), time)
    assert np.linalg.norm(positions - poses[:, :3, 3], axis=-1).max() <= 5e-5
    assert np.abs(rotations - poses[:, :3, :3]).max() <= 5e-5
    assert {time[0], time[-1]} <= set(track.times) <= set(time)
    assert (np.diff(track.times) > 0).all()


@given(seeds, st.integers(2, 3000))
def test_even_motion_takes_few_keys_however_densely_it_is_sampled(seed: int, samples: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 2, samples)
    track = Track.from_positions(time, np.outer(time, rng.normal(size=3)) + rng.normal(size=3)).thin()
    assert len(track.times) <= 2 + np.log2(samples)


def test_keys_are_as_many_as_a_parabola_asks_for() -> None:
    """On x = t²/2 a chord of length h is off by h²/8."""
    time = np.linspace(0, 10, 100_001)
    track = Track.from_positions(time, np.outer(time**2 / 2, [1.0, 0, 0])).thin(1e-4)
    fewest = 10 / np.sqrt(8 * 1e-4)
    assert fewest <= len(track.times) <= 2 * fewest + 18


@given(seeds, st.integers(1, 500), st.floats(0.01, 10))
def test_samples_that_are_left_out_are_near_the_lines_between_the_others(seed: int, samples: int, near: float) -> None:
    rng = np.random.default_rng(seed)
    time, values = np.sort(rng.uniform(size=samples)), rng.normal(size=(samples, 2)).cumsum(axis=0)
    kept = line_keys(time, values, near)
    lines = np.stack([np.interp(time, time[kept], column) for column in values[kept].T], axis=-1)
    assert np.linalg.norm(lines - values, axis=-1).max() <= near * (1 + 1e-9)


def test_what_stands_still_has_the_keys_of_its_ends() -> None:
    track = Track.from_positions(np.linspace(0, 1, 1025), np.ones((1025, 3))).thin()
    np.testing.assert_array_equal(track.times, [0, 1])
    assert not track.moves


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
    line = simplify(points, tolerance)
    assert to_polyline(points, line).max() <= tolerance * (1 + 1e-9)
    np.testing.assert_array_equal(line[[0, -1]], points[[0, -1]])


@given(seeds)
def test_a_simplified_line_has_no_more_segments_than_allowed(seed: int) -> None:
    assert len(simplify(wandering(seed), 1e-9, most=40)) <= 41


def test_a_straight_line_is_one_segment() -> None:
    assert len(simplify(np.linspace([0, 0, 0], [1, 2, 3], 500), 1e-9)) == 2


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


@given(seeds, st.integers(2, 40), st.integers(1, 40))
def test_the_first_triangles_of_a_tube_are_the_tube_of_its_first_points(seed: int, points: int, first: int) -> None:
    line = wandering(seed, points)
    first = min(first + 1, points)
    drawn = tube(line, 0.01).faces[: 2 * SIDES * (first - 1)]
    np.testing.assert_array_equal(drawn, tube(line[:first], 0.01).faces)


@given(seeds, st.floats(0.05, 5))
def test_every_other_piece_of_a_line_is_a_dash(seed: int, length: float) -> None:
    line = wandering(seed, 20)
    pieces = dashes(line, length)
    assert to_polyline(pieces.reshape(-1, 3), line).max() < 1e-9
    np.testing.assert_allclose([pieces[0, 0], pieces[-1, 1]], line[[0, -1]], atol=1e-9)
    straight = dashes(np.array([[0.0, 0, 0], [3, 4, 0]]), length)
    lengths = np.linalg.norm(straight[:, 1] - straight[:, 0], axis=-1)
    np.testing.assert_allclose(lengths, lengths[0])
    np.testing.assert_allclose(np.linalg.norm(straight[1:, 0] - straight[:-1, 1], axis=-1), lengths[0])


@given(seeds, st.integers(0, 5))
def test_joined_meshes_are_all_there(seed: int, extra: int) -> None:
    parts = [tube(wandering(seed + i, 5), 0.1) for i in range(extra + 1)]
    whole = join_meshes(parts)
    triangles = np.concatenate([part.vertices[part.faces] for part in parts])
    np.testing.assert_array_equal(whole.vertices[whole.faces], triangles)


@given(motions(), st.floats(1e-3, 0.1))
def test_a_trace_is_near_the_tool_and_grows_in_small_steps(motion, radius: float) -> None:
    time, points = motion[0], motion[1][:, :3, 3]
    share = np.linspace(0, 1, len(time))
    line = trace(time, points, share, radius)
    if line is None:
        assert np.linalg.norm(points - points[0], axis=-1).max() <= radius
        return
    rings = line.mesh.vertices.reshape(-1, SIDES, 3).mean(axis=1)
    np.testing.assert_allclose(rings, points[line.rings], atol=1e-9)
    assert len(rings) <= MOST_RINGS
    assert to_polyline(points, rings).max() <= radius
    for ring, following in pairwise(line.rings.tolist()):
        near = np.linalg.norm(points[ring:following] - points[ring], axis=-1) <= radius
        left = ring + int(np.flatnonzero(near)[-1])  # a tool that rests may leave late
        assert left == following - 1 or time[following] - time[left] <= FRAME * (1 + 1e-9)


def test_a_long_trace_has_no_more_rings_than_allowed_and_few_where_the_tool_rests() -> None:
    time = np.linspace(0, 600, 60_001)
    angle = np.minimum(time, 300)
    points = np.stack([np.cos(angle), np.sin(angle), 0 * time], axis=-1)
    line = trace(time, points, np.full(len(time), np.nan), 0.01)
    assert 1000 < len(line.rings) <= MOST_RINGS
    assert np.count_nonzero(time[line.rings] > 300.1) < 20


def test_a_tool_that_stays_in_one_place_draws_nothing() -> None:
    assert trace(np.arange(5.0), np.ones((5, 3)), np.zeros(5), 0.01) is None


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
