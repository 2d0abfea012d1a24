"""Knots that rounding alone tells apart, and cusps whose derivatives are computed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pathcontrol.errors import TaskError
from pathcontrol.profiles.limited.limited import limited
from pathcontrol.tasks.function import FunctionPath
from pathcontrol.tasks.joined.concatenation import concatenated
from pathcontrol.tasks.waypoints import WaypointPath


@pytest.fixture(scope="module", params=[8, 15])
def oval(request):
    angle = 2 * np.pi * np.arange(request.param) / request.param
    return WaypointPath(np.stack([np.cos(angle), 0.5 * np.sin(angle)], -1), speed=0.5, closed=True)


@pytest.mark.parametrize("ulps", [-1, 0, 1])
def test_a_closed_spline_cut_beside_a_knot_and_put_together_again_is_the_same_path(oval, ulps):
    cut = oval.knots[len(oval.knots) // 2]
    cut = cut if not ulps else np.nextafter(cut, ulps * np.inf)
    whole = concatenated([oval.between(0, cut), oval.between(cut, oval.period)])
    assert np.diff(whole.knots).min() > 1e-9
    assert whole.arc_length() == pytest.approx(oval.arc_length(), rel=1e-12)
    even = whole.by_arc_length()
    assert np.diff(even.knots).min() > 1e-9
    s = np.linspace(0, even.s_end, 41)
    same = oval.sigma_bar(even.q_d(s))
    assert_allclose(even.curvature(s), oval.curvature(same), rtol=1e-6, atol=1e-7)
    assert_allclose(whole.curvature(whole.knots[1:-1]), oval.curvature(whole.knots[1:-1]), rtol=1e-6, atol=1e-7)
    speeds = np.linalg.norm(even.with_profile(limited(even, velocity=[1.0, 1.0], points=200)).at(s).velocity, axis=-1)
    assert np.isfinite(speeds).all()


def semicubical(**derivatives):
    """A tip at s = 0.313, of length ((4 + 9s²)^1.5 − 8)/27 from there on."""
    return FunctionPath(
        lambda s: np.stack([(s - 0.313) ** 2, (s - 0.313) ** 3], -1), theta=1.0, s0=-1.0, s_end=1.0, **derivatives
    )


def test_the_length_of_a_path_with_a_cusp_has_its_closed_form():
    pieces = [((4 + 9 * s**2) ** 1.5 - 8) / 27 for s in (1.313, 0.687)]
    assert semicubical().arc_length() == pytest.approx(sum(pieces), rel=1e-11)
    exact = semicubical(derivative=lambda s: np.stack([2 * (s - 0.313), 3 * (s - 0.313) ** 2], -1))
    assert exact.arc_length() == pytest.approx(sum(pieces), rel=1e-12)


@pytest.mark.parametrize(
    ("function", "domain", "reason"),
    [
        (lambda s: [(s - 0.313) ** 2, (s - 0.313) ** 3], {"s0": -1.0, "s_end": 1.0}, r"turns back at s = 0\.313"),
        (lambda s: [s - np.sin(s), 1 - np.cos(s)], {"s0": -4.0, "s_end": 5.0}, "turns back at s = "),
        (lambda s: [np.cos(s) ** 3, np.sin(s) ** 3], {"period": 2 * np.pi}, "cusp or a standstill"),
    ],
    ids=["semicubical parabola", "cycloid", "astroid"],
)
def test_a_cusp_whose_derivatives_are_computed_has_no_arc_length_as_parameter(function, domain, reason):
    path = FunctionPath(lambda s: np.stack(function(s), -1), theta=1.0, **domain)
    with pytest.raises(TaskError, match=reason):
        path.by_arc_length()


@given(st.floats(-0.95, 0.95), st.floats(-2, 2), st.sampled_from(["semicubical", "cycloid"]))
def test_no_cusp_is_passed_over_wherever_it_is(tip, exponent, kind):
    size = 10.0**exponent

    def q_d(s):
        r = s - tip
        return np.stack([size * r**2, size * r**3] if kind == "semicubical" else [r - np.sin(r), 1 - np.cos(r)], -1)

    with pytest.raises(TaskError, match=r"turns back|cusp or a standstill"):
        FunctionPath(q_d, theta=1.0, s0=-1.0, s_end=1.0).by_arc_length()


@given(st.floats(-0.9, 0.9), st.floats(-6, -1), st.floats(-1.5, 0))
def test_a_tip_that_is_rounded_however_little_is_none(tip, rounding, opening):
    def q_d(s):
        return np.stack([10**opening * (s - tip), np.hypot(s - tip, 10**rounding)], -1)

    FunctionPath(q_d, theta=1.0, s0=-1.0, s_end=1.0).by_arc_length()
