"""Random tasks, states and gains for hypothesis."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from pathcontrol import Circle, ConstantRate, Ellipse, Lissajous, PathTask


class Wobble(PathTask):
    """A closed trigonometric path with a velocity profile that varies; derivatives are left to the library."""

    period = 2 * np.pi

    def __init__(self, cosines: np.ndarray, sines: np.ndarray) -> None:
        self.cosines, self.sines = cosines, sines  # (harmonics, n)

    def _terms(self, s, cos, sin, order):
        # one term after the other: a matrix product would be rounded differently in another batch
        terms = [np.zeros((*np.shape(s), self.cosines.shape[1]))]
        for k, (a, b) in enumerate(zip(self.cosines, self.sines, strict=True), 1):
            angle = k * np.asarray(s)[..., None]
            terms.append(k**order * (cos(angle) * a + sin(angle) * b))
        return sum(terms)

    def q_d(self, s):
        return self._terms(s, np.cos, np.sin, 0)

    def exact_dq_d(self, s):
        return self._terms(s, lambda x: -np.sin(x), np.cos, 1)

    def exact_ddq_d(self, s):
        return self._terms(s, lambda x: -np.cos(x), lambda x: -np.sin(x), 2)

    def theta(self, s):
        return 1.5 + np.sin(s) * np.cos(2 * s) / 2

    def exact_dtheta(self, s):
        return (np.cos(s) * np.cos(2 * s) - 2 * np.sin(s) * np.sin(2 * s)) / 2


def floats(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


def vectors(n: int, bound: float) -> st.SearchStrategy[np.ndarray]:
    return st.lists(floats(-bound, bound), min_size=n, max_size=n).map(np.array)


def gains(n: int, low: float, high: float) -> st.SearchStrategy[np.ndarray]:
    return st.lists(floats(low, high), min_size=n, max_size=n).map(np.array)


@st.composite
def wobbles(draw: st.DrawFn, n: int = 2, harmonics: int = 3) -> Wobble:
    coefficients = draw(st.lists(vectors(n, 0.5), min_size=2 * harmonics, max_size=2 * harmonics))
    cosines, sines = np.array(coefficients[:harmonics]), np.array(coefficients[harmonics:])
    # a first harmonic that dominates keeps the path regular: q_d' never vanishes
    cosines[0, 0] += 3.0
    sines[0, 1] += 3.0
    return Wobble(cosines, sines)


@st.composite
def tasks(draw: st.DrawFn) -> PathTask:
    """A regular closed path for two joints."""
    speed = draw(floats(0.2, 3.0))
    kind = draw(st.sampled_from(["circle", "ellipse", "eight", "rate", "wobble"]))
    a, b = draw(floats(0.3, 2.0)), draw(floats(0.3, 2.0))
    center = draw(vectors(2, 1.0))
    if kind == "circle":
        return Circle(a, speed, center=center, clockwise=draw(st.booleans()))
    if kind == "ellipse":
        return Ellipse((a, b), speed, center=center, clockwise=draw(st.booleans()))
    if kind == "eight":
        return Lissajous([a, b], [1, 2], speed, center=center)
    if kind == "rate":
        return Lissajous([a, b], [1, 2], speed, phases=[0.3, 0.1]).with_profile(ConstantRate(speed))
    return draw(wobbles())
