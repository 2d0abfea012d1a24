"""Orientations along a curve: the frames they ask for, the error that is left, what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import floats, vectors

from pathcontrol import InputError
from pathcontrol.cartesian.orientation import (
    FixedOrientation,
    FreeOrientation,
    NormalOrientation,
    Orientation,
    TangentOrientation,
)
from pathcontrol.toolpaths.tool_curve import ToolCurve

CURVE = ToolCurve.spline([[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.2, -0.05, 0.05], [0.3, 0.0, 0.0], [0.4, 0.1, 0.1]])
CIRCLE = ToolCurve.circle([0.3, 0.2, 0.1], 0.1)
S = np.linspace(CURVE.s0, CURVE.s_end, 41)
seeds = st.integers(0, 2**32 - 1)


def wavy(s: np.ndarray) -> np.ndarray:
    """Normals that lean to and fro."""
    return np.stack([0.3 * np.sin(9 * s), 0.2 * np.cos(7 * s), np.ones_like(s)], axis=-1)


def orientations(seed: int) -> list[Orientation]:
    turn = Rotation.random(random_state=seed).as_matrix()
    return [
        FixedOrientation(turn),
        TangentOrientation([0.1, 0.2, -1.0]),
        NormalOrientation(turn[:, 0]),
        NormalOrientation(wavy),
        NormalOrientation(wavy, reference=[1.0, 0.2, 0.0]),
        NormalOrientation(wavy(CURVE.knots), at=CURVE.knots),
    ]


@given(seeds)
def test_frames_are_rotations(seed):
    for orientation in orientations(seed):
        frames = orientation.frames(CURVE, S)
        assert frames.shape == (41, 3, 3)
        assert np.allclose(frames @ frames.swapaxes(-1, -2), np.eye(3), atol=1e-12)
        assert np.allclose(np.linalg.det(frames), 1.0)


@given(seeds, vectors(3, 1.7))
def test_the_error_of_a_turned_frame_is_the_turn(seed, turn):
    """e is the rotation vector itself; with the rotation about z left free, the angle between the z axes."""
    rotation = Rotation.from_rotvec(turn).as_matrix()
    for orientation in orientations(seed):
        wanted = orientation.frames(CURVE, S)
        e, _ = orientation.error(CURVE, S, rotation @ wanted)
        if orientation.rows == 3:
            assert np.allclose(e, turn, atol=1e-9)
        else:
            cosine = (wanted[..., 2] * (rotation @ wanted)[..., 2]).sum(-1)
            assert np.allclose(np.cos(np.linalg.norm(e, axis=-1)), cosine, atol=1e-12)


@settings(max_examples=10)
@given(seeds, vectors(3, 1.7))
def test_the_slope_of_the_error_gives_the_gradient_of_its_square(seed, turn):
    """d½‖e‖²/dω = (de/dω)ᵀe wherever e is defined, by differences."""
    h, rotation = 1e-6, Rotation.from_rotvec(turn).as_matrix()
    for orientation in orientations(seed):
        wanted = rotation @ orientation.frames(CURVE, S)
        e, slope = orientation.error(CURVE, S, wanted)
        gradient = (slope.swapaxes(-1, -2) @ e[..., None])[..., 0]
        for axis, direction in enumerate(np.eye(3)):
            sides = [
                orientation.error(CURVE, S, Rotation.from_rotvec(sign * h * direction).as_matrix() @ wanted)[0]
                for sign in (1, -1)
            ]
            change = 0.5 * ((sides[0] ** 2).sum(-1) - (sides[1] ** 2).sum(-1)) / (2 * h)
            assert np.allclose(change, gradient[..., axis], atol=1e-7)


def test_half_a_turn_is_an_error_of_pi():
    wanted = FixedOrientation(np.eye(3))
    for rotation in (np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])):
        e, _ = wanted.error(CURVE, S[:1], rotation[None])
        assert np.linalg.norm(e) == pytest.approx(np.pi)
    e, _ = NormalOrientation([0, 0, -1.0]).error(CURVE, S[:1], np.diag([1.0, -1.0, -1.0])[None])
    assert np.linalg.norm(e) == pytest.approx(np.pi)


@given(vectors(3, 1.0), floats(0.5, 2.0))
def test_the_tangent_frame_has_x_along_the_curve_and_z_nearest_to_up(tilt, length):
    up = length * (np.array([0.0, 0.0, 2.0]) + tilt)
    frames = TangentOrientation(up).frames(CURVE, S)
    tangent = CURVE.at(S).dp / np.linalg.norm(CURVE.at(S).dp, axis=-1, keepdims=True)
    assert np.allclose(frames[..., 0], tangent)
    # of all unit vectors across the tangent, z has the largest part along up
    angle = np.linspace(0, 2 * np.pi, 101)
    z, y = frames[:, None, :, 2], frames[:, None, :, 1]
    others = np.cos(angle)[:, None] * z + np.sin(angle)[:, None] * y
    assert ((frames[..., 2] @ up)[:, None] >= others @ up - 1e-12).all()


def test_z_points_against_the_normals_and_x_along_the_reference():
    assert np.allclose(NormalOrientation([0, 0, 3.0]).frames(CURVE, S)[..., 2], [0, 0, -1])
    normals = wavy(S) / np.linalg.norm(wavy(S), axis=-1, keepdims=True)
    frames = NormalOrientation(wavy, reference=[1.0, 0.2, 0.0]).frames(CURVE, S)
    assert np.allclose(frames[..., 2], -normals)
    assert np.allclose(frames[..., 1] @ [1.0, 0.2, 0.0], 0)  # nothing of the reference is left across x
    assert (frames[..., 0] @ [1.0, 0.2, 0.0] > 0).all()


def test_normals_are_interpolated_through_those_given_and_smoothly():
    given_at = np.linspace(CURVE.s0, CURVE.s_end, 12)
    orientation = NormalOrientation(5 * wavy(given_at), at=given_at)
    unit = wavy(given_at) / np.linalg.norm(wavy(given_at), axis=-1, keepdims=True)
    assert np.allclose(orientation.frames(CURVE, given_at)[..., 2], -unit)
    h, z = 1e-4, lambda s: orientation.frames(CURVE, s)[..., 2]
    inside = given_at[1:-1]
    left, right = (z(inside + sign * 2 * h) - 2 * z(inside + sign * h) + z(inside) for sign in (-1, 1))
    scale = np.abs(z(S[2:]) - 2 * z(S[1:-1]) + z(S[:-2])).max() / (S[1] - S[0]) ** 2
    assert np.abs(left - right).max() / h**2 < 0.05 * scale


def test_normals_round_a_closed_curve_are_periodic():
    normals = np.stack([np.cos(CIRCLE.knots / 0.1), np.sin(CIRCLE.knots / 0.1), 2 + 0 * CIRCLE.knots], axis=-1)
    orientation = NormalOrientation(normals, at=CIRCLE.knots)
    h, end = 1e-5, CIRCLE.s_end
    z = orientation.frames(CIRCLE, np.array([0.0, h, 2 * h, end - 2 * h, end - h, end]))[..., 2]
    assert np.allclose(z[0], z[-1], atol=1e-12)
    assert np.allclose(z[1] - z[0], z[-1] - z[-2], rtol=0, atol=1e-2 * np.linalg.norm(z[1] - z[0]))


def test_a_quaternion_is_its_matrix():
    turn = Rotation.random(random_state=3)
    frames = [FixedOrientation(given).frames(CURVE, S) for given in (turn.as_quat(), turn.as_matrix())]
    assert np.allclose(frames[0], frames[1])
    assert FreeOrientation().error(CURVE, S, frames[0])[0].shape == (41, 0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: FixedOrientation(np.eye(2)), ["(2, 2)", "quaternion"]),
        (lambda: FixedOrientation(2 * np.eye(3)), ["orthonormal"]),
        (lambda: FixedOrientation(-np.eye(3)), ["right-handed"]),
        (lambda: FixedOrientation([1.0, 1.0, 0.0, 0.0]), ["norm 1.41421", "expected 1"]),
        (lambda: FixedOrientation([np.nan, 0.0, 0.0, 1.0]), ["rotation[0] is nan"]),
        (lambda: TangentOrientation([0.0, 0.0, 0.0]), ["up = [0.0, 0.0, 0.0]", "length"]),
        (
            lambda: TangentOrientation([1.0, 0.0, 0.0]).frames(ToolCurve.line([0, 0, 0], [1, 0, 0]), S),
            ["up", "s = 0 m"],
        ),
        (lambda: NormalOrientation(np.ones((4, 3))), ["no parameters at", "at=curve.knots"]),
        (lambda: NormalOrientation(np.ones((4, 3)), at=[0.0, 1.0]), ["(4, 3)", "(2,)"]),
        (lambda: NormalOrientation(np.ones((2, 3)), at=[1.0, 0.0]), ["do not increase"]),
        (lambda: NormalOrientation(np.zeros((2, 3)), at=[0.0, 1.0]), ["s = 0 m has no length"]),
        (lambda: NormalOrientation([0, 0, 1], reference=[0, 0, 0]), ["reference"]),
        (lambda: NormalOrientation([0, 0, 1], reference=[0, 0, 2]).frames(CURVE, S), ["parallel to reference"]),
        (lambda: NormalOrientation(np.ones((2, 3)), at=[0.0, 0.1]).frames(CURVE, S), ["from 0 to 0.1 m", "curve goes"]),
        (
            lambda: NormalOrientation([[0, 0, 1], [0, 0, -1]], at=[0, 0.6]).frames(CURVE, np.array([0.3])),
            ["0.3 m", "no"],
        ),
    ],
)
def test_bad_orientations(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


def compass(count: int = 4) -> np.ndarray:
    """Axes all over the sphere, along the coordinate axes and between them too, (k, 3)."""
    grid = np.stack(np.meshgrid(*[np.arange(-count, count + 1)] * 3), axis=-1).reshape(-1, 3)
    grid = grid[(grid != 0).any(-1)].astype(float)
    return grid / np.linalg.norm(grid, axis=-1, keepdims=True)


@pytest.mark.parametrize("short_of_half", [0.0, 1e-13, 1e-10, 1e-7, 1e-4, 0.1, 0.46, 1.0, np.pi / 2, 3.0])
def test_the_rotation_that_is_left_is_scipys_up_to_half_a_turn(short_of_half):
    """SciPy goes by quaternions; of half a turn both directions of the axis are right."""
    turns = (np.pi - short_of_half) * compass()
    matrices = Rotation.from_rotvec(turns).as_matrix()
    e, _ = FixedOrientation(np.eye(3)).error(CIRCLE, np.zeros(len(turns)), matrices)
    expected = Rotation.from_matrix(matrices).as_rotvec()
    same = np.linalg.norm(e - expected, axis=-1)
    if short_of_half < 1e-12:  # the matrix does not know on which side of π it is
        same = np.minimum(same, np.linalg.norm(e + expected, axis=-1))
    assert same.max() < 1e-11
    assert np.allclose(np.linalg.norm(e, axis=-1), np.pi - short_of_half, atol=1e-13)


@pytest.mark.parametrize("axis", range(3))
def test_half_a_turn_about_a_coordinate_axis_is_exact(axis):
    matrix = 2 * np.outer(np.eye(3)[axis], np.eye(3)[axis]) - np.eye(3)
    e, _ = FixedOrientation(np.eye(3)).error(CIRCLE, np.zeros(1), matrix[None])
    assert np.array_equal(e[0], np.pi * np.eye(3)[axis])


@settings(max_examples=10)
@given(seeds)
def test_a_tool_that_points_the_opposite_way_is_half_a_turn_off(seed):
    """Whichever way the normal points, along an axis of the base too: ‖e‖ = π, not less."""
    normals = np.concatenate([compass(1), Rotation.random(8, random_state=seed).as_matrix()[:, 0]])
    for normal in normals:
        orientation = NormalOrientation(normal)
        wanted = orientation.frames(CURVE, S[:1])
        e, _ = orientation.error(CURVE, S[:1], wanted @ np.diag([1.0, -1.0, -1.0]))
        assert np.linalg.norm(e) == pytest.approx(np.pi, abs=1e-9)
