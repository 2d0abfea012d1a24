"""A cubic spline with few knots through many samples, within a tolerance.

Knots are samples. Least squares on few of them is refined where a sample is too far away, by a knot at the middle
sample of its span; with a knot at every sample but the two next to the ends the spline interpolates, so the refinement
ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite
from pathcontrol.errors import InputError

_DEGREE = 3
_ROUNDS = 64  # of refinement; halving 10^5 samples takes 17
_WORST = 0.25  # spans this near to the worst are divided together: where a step is not yet resolved, all others ring


def fit_samples(q: ArrayLike, s: ArrayLike | None, tolerance: float, closed: bool) -> tuple[BSpline, Array, Array]:
    """Fit a cubic spline; return it, the samples (m, n) and their parameters (m,); see ``SplinePath.from_samples``."""
    tolerance = as_scalar("tolerance", tolerance, least=0.0)
    samples = _check_samples(q)
    if s is None:
        samples, parameters = _parametrize_by_length(samples, closed)
    else:
        parameters = _check_parameters(s, samples, closed)
    least = 3 if closed else 2
    if len(samples) < least:
        raise InputError(
            f"q has {len(samples)} different postures, expected at least {least} for this path",
            argument="q",
            value=q,
            limit=least,
        )
    spline = _refine(samples, parameters, tolerance, closed) if tolerance else None
    return spline or _interpolant(samples, parameters, closed), samples, parameters[: len(samples)]


def _check_samples(q: ArrayLike) -> Array:
    """Check that ``q`` is a finite array (m, n)."""
    samples = check_finite("q", as_array("q", q))
    if samples.ndim != 2 or not samples.shape[1]:
        raise InputError(f"q has shape {samples.shape}, expected (m, n): one sample a row", argument="q", value=q)
    return samples


def _check_parameters(s: ArrayLike, samples: Array, closed: bool) -> Array:
    """Check that ``s`` increases and has a value for each sample."""
    parameters = check_finite("s", as_array("s", s))
    if parameters.shape != (len(samples) + closed,):
        more = ", one of them for the return to the first sample" if closed else ""
        raise InputError(
            f"s has shape {parameters.shape}, expected ({len(samples) + closed},) for {len(samples)} samples{more}",
            argument="s",
            value=s,
        )
    falls = np.flatnonzero(np.diff(parameters) <= 0)
    if falls.size:
        i = int(falls[0])
        pair = f"s[{i}] = {parameters[i]:g} and s[{i + 1}] = {parameters[i + 1]:g}"
        raise InputError(f"{pair}, expected parameters that increase", argument="s", value=parameters[i + 1])
    return parameters


def _parametrize_by_length(samples: Array, closed: bool) -> tuple[Array, Array]:
    """Return the samples without repetitions, and the length of the polygon up to each."""
    ring = np.concatenate([samples, samples[:1]]) if closed else samples
    steps = _distances(ring[1:], ring[:-1])
    moves = steps > np.finfo(float).eps * steps.sum()
    kept = moves if closed else np.concatenate([[True], moves])
    return samples[kept], np.concatenate([[0.0], np.cumsum(steps[moves])])


def _interpolant(samples: Array, s: Array, closed: bool) -> BSpline:
    """Return the spline through every sample: periodic, or natural at the ends."""
    ring = np.concatenate([samples, samples[:1]]) if closed else samples
    return make_interp_spline(s, ring, k=_DEGREE, bc_type="periodic" if closed else "natural")


def _refine(samples: Array, s: Array, tolerance: float, closed: bool) -> BSpline | None:
    """Fit with more and more knots until the tolerance is kept; ``None`` if nothing but interpolation does."""
    m = len(samples)
    if m <= _DEGREE:
        return None
    first, last = (1, m - 1) if closed else (2, m - 3)  # where a knot may be
    knots = np.unique(np.linspace(0, m, 5).astype(int)) if closed else np.array([0, m - 1])
    for turn in range(_ROUNDS):
        spline = _least_squares(samples, s, s[knots], closed)
        distance = _distances(spline(s[:m]), samples)
        if distance.max() <= tolerance:
            return spline
        worst = _WORST * distance.max() if turn < _ROUNDS // 2 else 0.0
        added = _middles(knots, distance > max(tolerance, worst), first, last)
        if not added.size:
            return None
        knots = np.union1d(knots, added)
    return None


def _middles(knots: Array, far: Array, first: int, last: int) -> Array:
    """Return the middle samples of the spans of ``knots`` that have a far sample, or of those next to them."""
    left, right = knots[:-1], knots[1:]
    middle = np.clip((left + right) // 2, first, last)
    divisible = (left < middle) & (middle < right)
    # a span has the samples at both of its ends
    before = np.concatenate([[0], np.cumsum(far)])
    wanted = before[np.minimum(right + 1, len(far))] > before[left]
    while divisible.any() and not (wanted & divisible).any():
        wanted = wanted | np.roll(wanted, 1) | np.roll(wanted, -1)
    return middle[wanted & divisible]


def _least_squares(samples: Array, s: Array, breaks: Array, closed: bool) -> BSpline:
    """Fit a spline with the knots ``breaks``, first and last included, by least squares."""
    k, spans = _DEGREE, len(breaks) - 1
    if closed:
        period = breaks[-1] - breaks[0]
        t = np.concatenate([breaks[-k - 1 : -1] - period, breaks, breaks[1 : k + 1] + period])
    else:
        t = np.concatenate([np.repeat(breaks[0], k), breaks, np.repeat(breaks[-1], k)])
    basis = BSpline.design_matrix(s[: len(samples)], t, k)
    if closed:  # the last k functions are the first ones, a period later
        basis = csr_array((basis.data, basis.indices % spans, basis.indptr), shape=(len(samples), spans))
    coefficients = splu(csc_array(basis.T @ basis)).solve(basis.T @ samples)
    return BSpline(t, np.concatenate([coefficients, coefficients[:k]]) if closed else coefficients, k)


def _distances(a: Array, b: Array) -> Array:
    """Return the distances ‖a − b‖ of rows."""
    return np.linalg.norm(a - b, axis=-1)
