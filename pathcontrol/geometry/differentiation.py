"""Derivatives of smooth functions of the path parameter, to nearly machine precision.

A function is sampled on Chebyshev points of a window around each s, and the interpolating polynomial is
differentiated. Near the ends of the domain the window moves inwards, so nothing is evaluated outside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from pathcontrol._arrays import Array

_DEGREE = 14
# Chebyshev points of [-1, 1] on which a function is sampled
_NODES = chebyshev.chebpts2(_DEGREE + 1)
_TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_NODES, _DEGREE))
_DERIVATIVES = {order: chebyshev.chebder(np.eye(_DEGREE + 1), order) for order in (1, 2)}


@dataclass(frozen=True)
class Differentiator:
    """Derivatives of ``function`` on the interval [lower, upper].

    Attributes:
        function: maps s of shape (*batch,) to values of shape (*batch,) or (*batch, n).
        lower: where the domain begins; -inf allowed.
        upper: where the domain ends; inf allowed.
        width: half the width of the window; see :func:`find_width`.
    """

    function: Callable[[Array], Array]
    lower: float
    upper: float
    width: float

    def __call__(self, s: Array, order: int) -> Array:
        """Return the derivative of ``order`` 1 or 2 at s (*batch,)."""
        s = np.asarray(s, dtype=np.float64)
        centre = np.clip(s, self.lower + self.width, self.upper - self.width)
        values = np.asarray(self.function(centre[..., None] + self.width * _NODES))
        weights = _weights((s - centre) / self.width, order) / self.width**order
        if values.ndim == weights.ndim:
            return np.einsum("...k,...k->...", weights, values)
        return np.einsum("...k,...ki->...i", weights, values)


def _weights(u: Array, order: int) -> Array:
    """Return the weights of the samples for the derivative at u in [-1, 1], the same for each u in any batch."""
    inside = (u == 0)[..., None]
    if inside.all():  # nearly everywhere
        return np.broadcast_to(_IN_THE_MIDDLE[order], (*np.shape(u), _DEGREE + 1))
    return np.where(inside, _IN_THE_MIDDLE[order], _compute_weights(u, order))


def _compute_weights(u: Array, order: int) -> Array:
    """Return the weights at u, computed one by one."""
    derivative = _DERIVATIVES[order]
    basis = chebyshev.chebvander(u, len(derivative) - 1).reshape(*np.shape(u), 1, len(derivative))
    # one product for each s, of numbers side by side: else a row would be rounded differently in another batch
    return (np.ascontiguousarray(basis) @ (derivative @ _TO_COEFFICIENTS))[..., 0, :]


_IN_THE_MIDDLE = {order: _compute_weights(np.array(0.0), order) for order in _DERIVATIVES}


def find_width(function: Callable[[Array], Array], lower: float, upper: float, samples: int = 33) -> float:
    """Find the window whose derivatives of ``function`` agree best with those of a window half as wide.

    Truncation shrinks and rounding grows as the window narrows; the smallest disagreement of the second derivative
    over ``samples`` places of [lower, upper] marks the balance.
    """
    s = np.linspace(lower, upper, samples)
    widths = 0.5 * (upper - lower) * 2.0 ** -np.arange(12)
    derivatives = [Differentiator(function, lower, upper, w)(s, 2) for w in widths]
    disagreement = [np.abs(a - b).max() for a, b in pairwise(derivatives)]
    # the narrower of the two that agree best
    return float(widths[int(np.argmin(disagreement)) + 1])
