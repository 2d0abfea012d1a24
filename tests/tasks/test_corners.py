"""Corners of paths that users write are told, bends are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.tasks.profile import ConstantSpeed
from pathcontrol.tasks.regularity import check_corners


class Straights(pc.PathTask):
    """Two straight lines under an angle, which meet at once or within a width."""

    s_end = 1.0

    def __init__(self, angle, at, width=0.0):
        self.angle, self.at_s, self.width = angle, at, width

    def q_d(self, s):
        x = s - self.at_s
        past = 0.5 * (x + np.sqrt(x**2 + self.width**2))  # max(x, 0) if the width is 0
        return np.stack([x - past + past * np.cos(self.angle), past * np.sin(self.angle)], axis=-1)

    def theta(self, s):
        return np.full_like(s, 0.5)


class Arches(pc.PathTask):
    """A closed path with a corner where it begins again."""

    period = 1.0

    def q_d(self, s):
        return np.stack([np.sin(2 * np.pi * s), np.abs(np.sin(np.pi * s))], axis=-1)

    def theta(self, s):
        return np.ones_like(s)


ANGLES, PLACES = st.floats(0.2, 2.5), st.floats(0.02, 0.98)


@given(ANGLES, PLACES)
def test_a_corner_is_told_with_its_place_and_angle(angle, place):
    with pytest.raises(pc.TaskError, match="has a corner at s = ") as told:
        pc.check_task(Straights(angle, place), 2)
    assert abs(told.value.s - place) < 1e-5
    assert float(str(told.value).split("turns by ")[1].split("°")[0]) == pytest.approx(np.rad2deg(angle), rel=5e-3)


@given(ANGLES, PLACES)
def test_a_bend_of_a_thousandth_of_the_path_is_no_corner(angle, place):
    check_corners(Straights(angle, place, width=1e-3))


def test_the_seam_of_a_closed_path_may_be_a_corner():
    with pytest.raises(pc.TaskError, match="corner at s = ") as told:
        pc.check_task(Arches(), 2)
    assert abs(told.value.s - 1.0) < 1e-5
    assert f"{np.rad2deg(2 * np.arctan(0.5)):.3g}°" in str(told.value)


def test_functions_and_own_derivatives_do_not_hide_a_corner():
    class Knowing(Straights):
        def dq_d(self, s):
            return np.where((s < self.at_s)[..., None], [1.0, 0.0], [np.cos(self.angle), np.sin(self.angle)])

    for path in (Knowing(1.0, 0.3), pc.FunctionPath(lambda s: [abs(s - 0.3), s], speed=1.0, s_end=1.0)):
        with pytest.raises(pc.TaskError, match="has a corner at s = ") as told:
            pc.check_task(path, 2)
        assert abs(told.value.s - 0.3) < 1e-5


@pytest.mark.parametrize("convert", [np.float32, np.float64])
def test_a_path_in_single_precision_is_told_as_such(convert):
    """Whether its values have the type float32, as JAX has by default, or were made float64 afterwards."""

    class Single(pc.Circle):
        def q_d(self, s):
            return super().q_d(np.asarray(s, np.float32)).astype(np.float32).astype(convert)

    with pytest.raises(pc.TaskError, match="of single precision, expected double"):
        pc.check_task(Single(1.0, 2.0), 2)


@given(st.floats(-5, 5), st.floats(0.1, 3))
def test_numbers_that_single_precision_holds_are_no_slip(start, slope):
    a, b = np.float32([start, slope]).astype(float)
    pc.check_task(pc.FunctionPath(lambda s: np.stack([a + 0 * s, b * s], -1), speed=1.0, s_end=128.0), 2)


@given(st.floats(-6, -3), st.integers(0, 99))
def test_a_rough_path_has_no_corner(exponent, seed):
    """Noise, as of a solver that stops early, turns a path everywhere."""

    def rough(s):
        noise = np.random.default_rng([seed, *np.atleast_1d(s).view(np.uint64)]).normal(size=(*np.shape(s), 2))
        return np.stack([s, s**2], -1) + 10**exponent * noise

    with pytest.raises(pc.TaskError, match=r"q_d is rough around s = .* everywhere"):
        check_corners(pc.FunctionPath(rough, speed=1.0, s_end=1.0))


def test_what_is_made_of_a_path_with_a_corner_has_it_too(arm):
    """The stretches up to the corner and from it on have none."""
    path, after = Straights(1.0, 0.3), Straights(1.0, 2.0)
    on = after.shifted(path.q_d(np.array(1.0)))
    for make in (
        lambda: pc.check_task(path.by_arc_length(), 2),
        lambda: pc.time_optimal(arm, path),
        lambda: pc.concatenated([path, on], blend=0.1),
        lambda: pc.PathSequence([path, on]),
        lambda: pc.check_task(path.with_profile(ConstantSpeed(1.0)), 2),
        lambda: pc.check_task(path.reversed(), 2),
        lambda: pc.check_task(path.between(0.1, 0.5).scaled(2.0), 2),
    ):
        with pytest.raises(pc.TaskError, match="has a corner at s = "):
            make()
    for a, b in ((0.0, 0.3), (0.3, 1.0)):
        pc.check_task(path.between(a, b).by_arc_length(), 2)


@pytest.mark.parametrize("off", [0.0, 0.3])
def test_a_projection_that_is_wrong_is_told_with_another_profile_too(off):
    class Turned(pc.Circle):
        def sigma_bar(self, q, near=None):
            return super().sigma_bar(q, near) + off

    path = Turned(1.0, 2.0)
    for task in (path, path.with_profile(ConstantSpeed(1.0)).with_profile(ConstantSpeed(0.5))):
        if off:
            with pytest.raises(
                pc.TaskError, match=r"Turned\.sigma_bar\(q_d\(s=.*\)\) = .*, where the path is 0\.\d+ away"
            ):
                pc.check_task(task, 2)
        else:
            pc.check_task(task, 2)
