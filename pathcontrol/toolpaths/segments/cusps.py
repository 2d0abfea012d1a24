"""Points where the derivative of a Bézier curve vanishes: turning points of straight ones, cusps of curved ones.

With the curve written as A(u)/w(u), its derivative vanishes where the polynomials A' w − A w' all do.
"""

from __future__ import annotations

import numpy as np
from scipy.special import comb

from pathcontrol._arrays import Array

_STILL = 1e-8  # share of the largest coefficient that counts as zero
_NEARLY_STILL, _TINY = 1e-4, 1e-300  # share of the largest step below which the derivative is examined closely
_INSIDE = 1e-6  # how far from 0 and 1 a parameter lies inside


def straight_turns(points: Array, weights: Array | None, tolerance: float) -> Array | None:
    """Return the ends and turning points (m, 3), in order, of a straight curve; None if it is not straight.

    Args:
        points: control points, (degree + 1, 3).
        weights: (degree + 1,), greater than 0, or None.
        tolerance: largest distance of a control point from the line.
    """
    legs = points - points[0]
    farthest = legs[np.argmax((legs * legs).sum(-1))]
    size = np.linalg.norm(farthest)
    if size <= tolerance:
        return points[[0, -1]]
    along = legs @ farthest / size
    if np.linalg.norm(legs - np.outer(along, farthest / size), axis=-1).max() > tolerance:
        return None
    turns = _roots(_hodograph(along[:, None], weights)[0])
    return np.stack([points[0], *(_split(_homogeneous(points, weights), u)[0][-1, :3] for u in turns), points[-1]])


def is_plain(points: Array, tolerance: float) -> Array:
    """Return which polynomial curves (k, degree + 1, 3) surely are neither straight nor have a cusp, (k,).

    Those of a degree above 3 are not looked at.
    """
    degree = points.shape[1] - 1
    if not 2 <= degree <= 3:
        return np.zeros(len(points), dtype=bool)
    row = np.arange(len(points))
    legs = points - points[:, :1]
    squares = (legs * legs).sum(-1)
    farthest = np.argmax(squares, axis=1)
    size = np.sqrt(squares[row, farthest])
    along = legs[row, farthest] / np.maximum(size, _TINY)[:, None]
    off = legs - (legs * along[:, None]).sum(-1, keepdims=True) * along[:, None]
    curved = (size > tolerance) & ((off * off).sum(-1).max(1) > (2 * tolerance) ** 2)
    return curved & ~_may_stand_still(np.diff(points, axis=1))


def _may_stand_still(steps: Array) -> Array:
    """Return whether derivatives with Bernstein coefficients ``steps`` (k, 2 or 3, 3) may vanish in (0, 1), (k,)."""
    row, size = np.arange(len(steps)), np.abs(steps).max(1)
    of = steps[row, :, np.argmax(size, axis=1)]  # the coordinate that changes most
    a = of[:, 0] - 2 * of[:, 1] + of[:, 2] if of.shape[1] == 3 else np.zeros(len(of))
    b, c = (of[:, 1] - of[:, 0]) * (of.shape[1] - 1), of[:, 0]
    with np.errstate(all="ignore"):
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4 * a * c, 0.0)), b))
        turns = np.nan_to_num(np.stack([q / a, c / q], axis=1), nan=0.0, posinf=0.0, neginf=0.0).clip(0.0, 1.0)
    rest = 1 - turns
    basis = [rest, turns] if steps.shape[1] == 2 else [rest * rest, 2 * rest * turns, turns * turns]
    left = sum(share[..., None] * steps[:, None, i] for i, share in enumerate(basis))
    return (np.abs(left).max(-1) <= _NEARLY_STILL * size.max(1)[:, None]).any(1)


def without_cusps(points: Array, weights: Array | None) -> list[tuple[Array, Array | None]]:
    """Cut the curve at its cusps; return control points and weights of its parts."""
    legs = points[1:] - points[:-1]
    sizes = np.sqrt((legs * legs).sum(-1))
    ahead = legs @ (legs / np.maximum(sizes, 1e-300)[:, None]).sum(0)
    if (ahead >= 0).all() and ahead.any():  # the curve is monotonic in this direction
        return [(points, weights)]
    parts, rest, begin = [], _homogeneous(points, weights), 0.0
    for u in _standstills(points, weights):
        first, rest = _split(rest, (u - begin) / (1 - begin))
        first[-2, :3], rest[1, :3] = first[-1, :3], rest[0, :3]  # exact up to rounding
        parts.append(first)
        begin = u
    return [(part[:, :3], None if weights is None else part[:, 3]) for part in [*parts, rest]]


def _standstills(points: Array, weights: Array | None) -> list[float]:
    """Return the parameters in (0, 1) where the derivative vanishes, increasing."""
    hodograph = _hodograph(points - points[0], weights)
    sizes = np.abs(hodograph).max(1)
    candidates = _roots(hodograph[np.argmax(sizes)])
    return [u for u in candidates if np.abs(np.polyval(hodograph.T, u)).max() <= _STILL * sizes.max()]


def _hodograph(values: Array, weights: Array | None) -> Array:
    """Return A' w − A w' for each column of values (degree + 1, k), in powers of u, the highest first, (k, m)."""
    if weights is None:
        return _powers(np.diff(values, axis=0)).T
    w, columns = _powers(weights[:, None])[:, 0], _powers(values * weights[:, None]).T
    return np.array([np.convolve(np.polyder(a), w) - np.convolve(a, np.polyder(w)) for a in columns])


def _powers(coefficients: Array) -> Array:
    """Convert Bernstein coefficients (n + 1, k) to powers of u, the highest first: Δʲb₀ (n over j) uʲ."""
    n = len(coefficients) - 1
    differences = [coefficients]
    for _ in range(n):
        differences.append(differences[-1][1:] - differences[-1][:-1])
    return np.stack([comb(n, j) * differences[j][0] for j in range(n, -1, -1)])


def _roots(coefficients: Array) -> list[float]:
    """Return the real roots inside (0, 1), increasing; double ones, which rounding makes complex, once."""
    size = np.abs(coefficients).max()
    if size == 0:
        return []
    roots = np.roots(np.where(np.abs(coefficients) > 1e-14 * size, coefficients, 0.0))
    real = np.sort(roots.real[np.abs(roots.imag) < _INSIDE])
    real = real[(real > _INSIDE) & (real < 1 - _INSIDE)]
    return [float(u) for u in real[np.append(np.diff(real) > _INSIDE, True)]] if real.size else []


def _homogeneous(points: Array, weights: Array | None) -> Array:
    """Return points and weights in one array (degree + 1, 4)."""
    return np.column_stack([points, np.ones(len(points)) if weights is None else weights])


def _split(curve: Array, u: float) -> tuple[Array, Array]:
    """Split a curve at u by de Casteljau's algorithm; return the parts (degree + 1, 4), points and weights."""
    rows = [np.column_stack([curve[:, :3] * curve[:, 3:], curve[:, 3]])]
    while len(rows[-1]) > 1:
        rows.append((1 - u) * rows[-1][:-1] + u * rows[-1][1:])
    before, after = np.array([row[0] for row in rows]), np.array([row[-1] for row in rows[::-1]])
    return (
        np.column_stack([before[:, :3] / before[:, 3:], before[:, 3]]),
        np.column_stack([after[:, :3] / after[:, 3:], after[:, 3]]),
    )
