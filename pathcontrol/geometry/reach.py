"""The reach of a curve: the largest distance within which every point has one nearest point on it.

For a curve x(s) with the tangent t (H. Federer, Curvature measures, Trans. Amer. Math. Soc. 93, 1959, theorem 4.18)

    reach = inf over p ≠ q of F(p, q),   F = ‖q − p‖² / (2 dist(q − p, Tan(p))),

the radius of the circle that touches the curve at p and goes through q. For q → p it is the radius of curvature. Apart
from that the infimum is taken at a bottleneck: a chord that is normal to the curve at both ends, of which F is half the
length (E. Aamari et al., Estimating the reach of a manifold, Electron. J. Statist. 13, 2019). A chord shorter than the
least diameter of curvature, 2r, has its ends at least πr apart along the curve.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter
from scipy.optimize import least_squares, minimize, minimize_scalar

from pathcontrol._arrays import Array
from pathcontrol.geometry.arc_length import curvature_vector
from pathcontrol.geometry.closest_point.curve import Curve, Interval

_FIRST, _MOST_SAMPLES = 513, 1 << 16  # samples of the curvature
_TURN = 0.1  # rad, of the tangent from one sample to the next
_UNEVEN = 0.02  # of the largest curvature, by which it may differ from linear between samples
_SHORTEST = 1e-12  # of the interval, below which it is not cut
_PEAKS = 12  # largest peaks of the curvature that are refined
_FEWEST, _MOST = 256, 2048  # samples for chords
_ROWS = 128  # of the matrix of chords at once
_CHORDS = 8  # narrowest chords that are refined
_APART = 0.9  # of the least distance along the curve between the ends of a bottleneck
_ZERO = 1e-9  # share of the size of the curve
_TIGHT = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}


class LeastRadius(NamedTuple):
    """The least radius of curvature, inf for a straight curve, and its parameter."""

    radius: float
    s: float


class Bottleneck(NamedTuple):
    """Half the length of the narrowest chord that is normal at both ends, inf without one, and their parameters."""

    half: float
    s: float
    other: float


def least_radius(curve: Curve, interval: Interval, knots: Array | None = None) -> tuple[LeastRadius, Array]:
    """Return the least radius of curvature of a curve, and samples of s that resolve its curvature, (k,).

    Samples are added where the tangent turns much between two of them, or the curvature is far from linear; around its
    largest peaks it is maximised.
    """
    s, bend = _refined(curve, _begin(interval, knots))
    inner = np.r_[bend[1] if not interval.closed else bend[-2], bend, bend[1] if interval.closed else bend[-2]]
    peaks = np.flatnonzero((bend >= inner[:-2]) & (bend >= inner[2:]))
    best, at = float(bend.max()), float(s[bend.argmax()])
    for i in peaks[np.argsort(-bend[peaks])][:_PEAKS]:
        ends = interval.inside(s[i] + np.array([-1.0, 1.0]) * max(np.diff(s[max(i - 1, 0) : i + 2])))
        found = minimize_scalar(
            lambda x: -float(_curvature(curve, np.array([x]))[0]),
            bounds=tuple(ends),
            method="bounded",
            options={"xatol": 1e-10 * interval.length},
        )
        if -found.fun > best:
            best, at = float(-found.fun), float(found.x)
    size = np.ptp(curve.p(s), axis=0).max()
    radius = np.inf if best * size < _ZERO else 1 / best
    return LeastRadius(radius, at), s


def narrowest_bottleneck(curve: Curve, interval: Interval, radius: float, s: Array) -> Bottleneck:
    """Return the narrowest bottleneck of a curve, where it is narrower than its least ``radius`` of curvature allows.

    A curve that crosses itself has one of width 0. ``s`` (k,) are samples that resolve its curvature.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve.p(s), axis=0), axis=1))])
    found = Bottleneck(np.inf, np.nan, np.nan)
    for a, b, least in _candidates(curve, interval, s, length, radius):
        if least > found.half:
            break
        one = _refine(curve, interval, a, b, length[-1])
        ends = np.interp([one.s, one.other], s, length)
        apart = ends[1] - ends[0]
        apart = min(apart, length[-1] - apart) if interval.closed else apart
        if apart >= _least_distance(radius) and one.half < min(found.half, radius * (1 - _ZERO), length[-1]):
            found = one
    return found


def _begin(interval: Interval, knots: Array | None) -> Array:
    """Return the first samples of a curve, its knots among them."""
    even = np.linspace(interval.lower, interval.upper, _FIRST)
    return even if knots is None else np.union1d(even, knots[(knots > interval.lower) & (knots < interval.upper)])


def _refined(curve: Curve, s: Array) -> tuple[Array, Array]:
    """Return samples and the curvature there, more where the tangent turns much or the curvature is far from linear."""
    tangent, bend = _tangent(curve, s), _curvature(curve, s)
    found, bends, largest = [s], [bend], bend.max()
    a, b, t_a, t_b, k_a, k_b = s[:-1], s[1:], tangent[:-1], tangent[1:], bend[:-1], bend[1:]  # of cells to be cut
    while len(a) and sum(map(len, found)) < _MOST_SAMPLES:
        middle = 0.5 * (a + b)
        t, k = _tangent(curve, middle), _curvature(curve, middle)
        found, bends, largest = [*found, middle], [*bends, k], max(largest, k.max())
        uneven = np.abs(k - 0.5 * (k_a + k_b)) > _UNEVEN * largest
        cut = ((np.linalg.norm(t_b - t_a, axis=1) > _TURN) | uneven) & (b - a > _SHORTEST * (s[-1] - s[0]))
        halves = ((a, middle), (middle, b), (t_a, t), (t, t_b), (k_a, k), (k, k_b))
        a, b, t_a, t_b, k_a, k_b = (np.concatenate([first[cut], second[cut]]) for first, second in halves)
    order = np.argsort(np.concatenate(found), kind="stable")
    return np.concatenate(found)[order], np.concatenate(bends)[order]


def _spread(s: Array, length: Array, radius: float, interval: Interval) -> Array:
    """Return samples evenly along the length of a curve, a few for each radius of curvature."""
    count = int(min(max(8 * length[-1] / radius, _FEWEST), _MOST))
    return np.interp(np.linspace(0.0, length[-1], count, endpoint=not interval.closed), length, s)


def _least_distance(radius: float) -> float:
    """Return the least distance along a curve between the ends of a bottleneck, a little less for rounding."""
    return _APART * np.pi * radius if np.isfinite(radius) else 0.0


def _candidates(
    curve: Curve, interval: Interval, fine: Array, length: Array, radius: float
) -> list[tuple[float, float, float]]:
    """Return the ends of chords of samples with less F than their neighbours, and bounds of F, the narrowest first."""
    s, whole = _spread(fine, length, radius, interval), length[-1]
    points, tangents, least = curve.p(s), _tangent(curve, s), max(_least_distance(radius), 3 * whole / len(s))
    value, place = np.empty((len(s), len(s))), np.interp(s, fine, length)
    for first in range(0, len(s), _ROWS):
        rows = slice(first, first + _ROWS)
        value[rows] = _touching_radius(interval, s[rows, None], points[rows, None], tangents[rows, None], points)
        along = np.abs(place[rows, None] - place)
        along = np.minimum(along, whole - along) if interval.closed else along
        value[rows][along < least] = np.inf
    mode = "wrap" if interval.closed else "nearest"
    smallest = minimum_filter(value, size=3, mode=mode)
    slack = 2 * whole / len(s)  # F may be smaller between samples
    a, b = np.nonzero((value <= smallest) & (value < min(radius, whole) + slack))
    order = np.argsort(value[a, b], kind="stable")[:_CHORDS]
    ends = zip(a[order], b[order], strict=True)
    return [(float(s[i]), float(s[j]), float(value[i, j]) - slack) for i, j in ends]


def _refine(curve: Curve, interval: Interval, a: float, b: float, size: float) -> Bottleneck:
    """Return the bottleneck near a chord between two parameters."""

    def radius(ends: Array) -> float:
        points, tangent = curve.p(ends), _tangent(curve, ends[:1])
        return float(_touching_radius(interval, ends[:1], points[:1], tangent, points[1:])[0])

    bounds = None if interval.closed else [(interval.lower, interval.upper)] * 2
    step = interval.length / _MOST
    simplex = np.array([[a, b], [a + step, b], [a, b + step]])
    options = {"xatol": 1e-8 * interval.length, "fatol": 1e-14 * size, "initial_simplex": simplex, "maxfev": 300}
    found = minimize(radius, [a, b], method="Nelder-Mead", bounds=bounds, options=options)
    half, ends = min((float(found.fun), tuple(found.x)), (radius(np.array([a, b])), (a, b)))
    if half < 1e-4 * size:  # the curve may cross itself there
        crossing = least_squares(lambda x: np.subtract(*curve.p(interval.inside(x))), ends, **_TIGHT)
        if np.sqrt(2 * crossing.cost) < _ZERO * size:
            half, ends = 0.0, tuple(interval.inside(crossing.x))
    s, other = (interval.lower + (x - interval.lower) % interval.length if interval.closed else x for x in ends)
    return Bottleneck(half, float(min(s, other)), float(max(s, other)))


def _touching_radius(interval: Interval, s: Array, point: Array, tangent: Array, other: Array) -> Array:
    """Return F, the radius of the circle that touches a curve in its ``point`` at s and goes through the ``other``."""
    # one coordinate after another: sums over two or three of them take most of the time, and have the same bits
    directions = [tangent[..., i] for i in range(tangent.shape[-1])]
    chord = [np.ascontiguousarray(other[..., i]) - point[..., i] for i in range(other.shape[-1])]
    along = _sum(c * t for c, t in zip(chord, directions, strict=True))
    along = np.where(interval.at_lower(s), np.maximum(along, 0.0), along)  # at an end the tangent is a half-line
    along = np.where(interval.at_upper(s), np.minimum(along, 0.0), along)
    squared = _sum(c * c for c in chord)
    aside = (c - along * t for c, t in zip(chord, directions, strict=True))
    away = np.sqrt(_sum(a * a for a in aside))
    infinite = np.where(squared > 0, np.inf, 0.0)
    return np.divide(squared, 2 * away, out=infinite, where=away > 0)


def _sum(parts: Iterable[Array]) -> Array:
    """Return the sum of some arrays of one shape, in their order."""
    first, *others = parts
    for part in others:
        first = first + part
    return first


def _tangent(curve: Curve, s: Array) -> Array:
    """Return the unit tangents of a curve."""
    slope = curve.dp(s)
    return slope / np.linalg.norm(slope, axis=-1, keepdims=True)


def _curvature(curve: Curve, s: Array) -> Array:
    """Return the curvature of a curve, (*batch,)."""
    assert curve.ddp is not None
    return np.asarray(np.linalg.norm(curvature_vector(curve.dp(s), curve.ddp(s)), axis=-1))
