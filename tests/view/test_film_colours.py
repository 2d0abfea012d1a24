"""Colours are seen on light and on dark, in the right order, and with any colour vision."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol.view.animation.scene.palette import PLAIN, RUNS, run_color, scale_colors

WHITE, BLACK = np.ones(3), np.array([0.07, 0.08, 0.1])
# linear RGB as people without one kind of cones see it (Machado, Oliveira and Fernandes, 2009, severity 1)
VISION = {
    "all cones": np.eye(3),
    "no L cones": np.array([[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]]),
    "no M cones": np.array([[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]]),
    "no S cones": np.array([[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]]),
}
SCALE = scale_colors(np.linspace(0, 1, 65))


def linear(colors: np.ndarray) -> np.ndarray:
    return np.where(colors <= 0.04045, colors / 12.92, ((np.maximum(colors, 0) + 0.055) / 1.055) ** 2.4)


def luminance(colors: np.ndarray) -> np.ndarray:
    return linear(colors) @ [0.2126, 0.7152, 0.0722]


def contrast(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Contrast ratio of WCAG 2, from 1 to 21."""
    bright, dim = np.maximum(luminance(a), luminance(b)), np.minimum(luminance(a), luminance(b))
    return (bright + 0.05) / (dim + 0.05)


def lab(colors: np.ndarray, vision: str) -> np.ndarray:
    """CIELAB, as seen with a kind of colour vision."""
    seen = np.clip(linear(colors) @ VISION[vision].T, 0, 1)
    xyz = seen @ np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]).T
    x, y, z = np.cbrt(np.maximum(xyz / [0.9505, 1.0, 1.089], 1e-6)).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def test_the_scale_stands_out_from_light_and_from_dark() -> None:
    assert contrast(SCALE, WHITE).min() > 3
    assert contrast(SCALE, BLACK).min() > 3


@pytest.mark.parametrize("vision", VISION)
def test_the_scale_rises_in_even_steps_for_every_eye(vision: str) -> None:
    seen = lab(SCALE, vision)
    steps = np.linalg.norm(np.diff(seen, axis=0), axis=-1)
    assert steps.min() > 0.2 * steps.mean()
    assert np.linalg.norm(seen[-1] - seen[0]) > 50
    far = np.linalg.norm(seen[:, None] - seen, axis=-1)
    i, j = np.indices(far.shape)
    assert far[np.abs(i - j) > 21].min() > 12  # colours a third of the scale apart are never taken for one another


def test_the_scale_gets_lighter_from_end_to_end() -> None:
    assert (np.diff(luminance(SCALE)) > 0).all()


@pytest.mark.parametrize("vision", VISION)
def test_the_first_runs_are_told_apart_by_every_eye(vision: str) -> None:
    seen = lab(np.array([color[:3] for color in RUNS[:4]]), vision)
    far = np.linalg.norm(seen[:, None] - seen, axis=-1) + 1e3 * np.eye(4)
    assert far.min() > 10


@given(st.floats(-5, 5) | st.just(np.nan))
def test_shares_beyond_the_scale_have_the_colours_of_its_ends(share: float) -> None:
    color = scale_colors(np.array(share))
    expected = PLAIN[:3] if np.isnan(share) else scale_colors(np.array(np.clip(share, 0, 1)))
    np.testing.assert_array_equal(color, expected)
    assert ((color >= 0) & (color <= 1)).all()


def test_there_is_a_colour_for_every_run() -> None:
    assert [run_color(i) for i in range(len(RUNS))] == list(RUNS)
    shown = np.array([run_color(i)[:3] for i in range(3 * len(RUNS))])
    apart = np.abs(shown[:, None] - shown).max(-1) + np.eye(len(shown))
    assert apart.min() > 0.05  # none comes twice
