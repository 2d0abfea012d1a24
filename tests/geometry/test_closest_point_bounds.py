"""The search of the closest point takes bounded memory on curves of any kind, and refuses those it does not resolve."""

from __future__ import annotations

import numpy as np
import pytest

from pathcontrol.errors import TaskError
from pathcontrol.geometry.closest_point import ClosestPoint, Curve, cells, global_search

TURN = 2 * np.pi


def _helix(w: float, radius: float = 1.0) -> Curve:
    """Return a helix of ``w`` rad about the third axis, whose points are nearly equally far from that axis."""

    def p(s: np.ndarray) -> np.ndarray:
        return radius * np.stack([np.cos(w * s), np.sin(w * s), 0.1 * s], -1)

    def dp(s: np.ndarray) -> np.ndarray:
        return radius * np.stack([-w * np.sin(w * s), w * np.cos(w * s), 0.1 + 0 * s], -1)

    return Curve(p, dp)


def test_blocks_find_what_one_block_finds(monkeypatch):
    """The distance is the least of a dense sampling, the same to the bit however few pieces are searched at once."""
    curve = _helix(40.0)
    x = np.random.default_rng(3).normal(size=(30, 3)) * [0.3, 0.3, 0.1]
    s = np.linspace(0, 1, 5_001)
    brute = np.linalg.norm(curve.p(s) - x[:, None], axis=-1).min(1)
    whole = ClosestPoint(curve, 0.0, 1.0, False)(x)
    for pieces in (7, 100, 1000):
        monkeypatch.setattr(global_search, "_PIECES", pieces)
        found = ClosestPoint(curve, 0.0, 1.0, False)(x)
        np.testing.assert_array_equal(found, whole)
    distance = np.linalg.norm(curve.p(whole) - x, axis=-1)
    assert (distance <= brute + 1e-15).all()
    # a sample is within h = 40 / 5000 / 2 of the nearest point; the curvature is 1 and d is less: d² + 2 h² at most
    assert (brute**2 - distance**2 <= 2 * 0.004**2).all()


def test_one_point_as_near_to_all_cells_is_searched_in_blocks(monkeypatch):
    """No more than a block of pieces is evaluated at once, for a single point too, however many cells are near."""
    sizes, most, helix = [], 256, _helix(2000.0)

    def p(s: np.ndarray) -> np.ndarray:
        sizes.append(s.size)
        return helix.p(s)

    monkeypatch.setattr(global_search, "_PIECES", most)
    closest = ClosestPoint(Curve(p, helix.dp), 0.0, 1.0, False)
    closest(np.array([5.0, 0.0, 0.0]))  # cuts the curve
    sizes.clear()
    assert closest(np.array([0.0, 0.0, 0.05])) == pytest.approx(0.5, abs=1e-6)
    of_a_cell = np.ceil(2 * TURN / global_search._TURN)
    assert max(sizes) <= 2 * (most + of_a_cell)


@pytest.mark.parametrize("radius", [1e-145, 1e-165, 1e-250, 1e150 / 2])
def test_a_curve_is_cut_alike_at_any_size(radius):
    """Turns of the tangent do not depend on the unit, also where squares of the derivatives underflow or overflow."""
    turn = [cells.Cells.cut(_helix(TURN, r), cells.Interval(0.0, 1.0, False)).turn for r in (1.0, radius)]
    np.testing.assert_allclose(turn[1], turn[0], rtol=1e-6)


@pytest.mark.parametrize("kind", ["noise", "frequency"])
def test_a_curve_that_no_cells_follow_is_refused(monkeypatch, kind):
    """A curve whose tangent is another one in each of the most cells has no closest point that can be trusted."""
    monkeypatch.setattr(cells, "_MAX_CELLS", 1 << 12)

    def noise(s: np.ndarray) -> np.ndarray:
        return np.modf(np.stack([np.sin(12.9898e6 * s), np.cos(78.233e6 * s)], -1) * 43758.5453)[0]

    noisy = Curve(noise, lambda s: (noise(s + 1e-6) - noise(s - 1e-6)) / 2e-6)
    with pytest.raises(TaskError, match=r"turns by more than .* rad .* 4096 cells do not follow it.*frequency"):
        ClosestPoint(noisy if kind == "noise" else _helix(1e6), 0.0, 1.0, False)(np.zeros(3 if kind != "noise" else 2))


def test_a_curve_with_one_wild_place_is_searched(monkeypatch):
    """A curve that is not resolved in one place is still searched: the nearest point elsewhere is right."""
    monkeypatch.setattr(cells, "_MAX_CELLS", 1 << 12)

    def p(s: np.ndarray) -> np.ndarray:
        return np.stack([s, s**2 * np.sin(1e-3 / np.maximum(s, 1e-9) ** 3)], -1)

    closest = ClosestPoint(Curve(p, lambda s: (p(s + 1e-7) - p(s - 1e-7)) / 2e-7), 0.0, 1.0, False)
    s = np.linspace(0.6, 1, 100_001)
    x = np.array([0.8, 0.3])
    assert closest(x) == pytest.approx(s[np.linalg.norm(p(s) - x, axis=-1).argmin()], abs=1e-5)


def test_rounding_errors_are_no_turns():
    """The tangent of a curve that is a point but for rounding errors is noise, and does not multiply its pieces."""

    def p(s: np.ndarray) -> np.ndarray:
        return 1.0 + 1e-15 * np.stack([np.sin(s), np.cos(s)], -1)

    curve = Curve(p, lambda s: (p(s + 1e-6) - p(s - 1e-6)) / 2e-6)
    closest = ClosestPoint(curve, 0.0, 1.0, False)
    assert 0.0 <= closest(np.zeros(2)) <= 1.0
    assert (closest._everywhere._pieces == 1).all()
