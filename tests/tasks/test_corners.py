"""Corners of paths that users write are told, bends are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pathcontrol as pc
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
