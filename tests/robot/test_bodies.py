"""Bodies whose numbers are right up to rounding, and numbers of bodies that are not right."""

from __future__ import annotations

import copy
import re

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import InputError, PathControlWarning
from pathcontrol.robot.recipe import recipe_of, robot_of

Q = np.array([0.3, -0.8])
TENSOR = np.diag([0.1, 0.2, 0.15])


@pytest.fixture(scope="module")
def arm():
    return pc.load_robot("cicese_2dof").with_friction(None)


@pytest.mark.parametrize("size", [1e-15, 1e-12, 1e-10, 5e-9])
@pytest.mark.parametrize("place", [(0, 1), (2, 0), (1, 2)])
def test_a_payload_that_is_symmetric_up_to_rounding_is_its_symmetric_part(arm, size, place):
    tilted = TENSOR.copy()
    tilted[place] += size
    loaded = arm.with_payload(1.0, "tool", inertia=tilted)
    even = arm.with_payload(1.0, "tool", inertia=(tilted + tilted.T) / 2)
    assert np.array_equal(loaded.mass_matrix(Q), even.mass_matrix(Q))
    assert np.array_equal(robot_of(recipe_of(loaded)).mass_matrix(Q), loaded.mass_matrix(Q))


@pytest.mark.parametrize("least", [-1e-13, -1e-16])
def test_a_principal_moment_below_zero_by_rounding_is_none(arm, least):
    loaded = arm.with_payload(1.0, "tool", inertia=np.diag([least, 0.1, 0.1]))
    plain = arm.with_payload(1.0, "tool", inertia=np.diag([0.0, 0.1, 0.1]))
    np.testing.assert_allclose(loaded.mass_matrix(Q), plain.mass_matrix(Q), atol=1e-12)


@pytest.mark.parametrize(
    "inertia", [np.diag([-1e-6, 0.1, 0.1]), TENSOR + np.diag([1e-3], 2) * np.ones((3, 3)), np.full((3, 3), np.nan)]
)
def test_an_inertia_that_is_none_is_refused(arm, inertia):
    with pytest.raises(InputError, match="inertia"):
        arm.with_payload(1.0, "tool", inertia=inertia)


def test_a_recorded_payload_may_have_lost_its_last_digits(arm):
    recipe = copy.deepcopy(recipe_of(arm.with_payload(1.0, "tool", inertia=TENSOR)))
    recipe["steps"][0][1]["inertia"][0][1] = 1e-10
    assert np.isfinite(robot_of(recipe).mass_matrix(Q)).all()
    recipe["steps"][0][1]["inertia"][0][1] = 0.1
    with pytest.raises(InputError, match="symmetric"):
        robot_of(recipe)


def test_what_pinocchio_refuses_is_no_recipe(arm, monkeypatch):
    def refuse(*_):
        raise RuntimeError("no such body")

    monkeypatch.setattr("pathcontrol.robot.model.payload_of", refuse)
    recipe = recipe_of(arm) | {"steps": [["with_payload", {"mass": 1.0, "frame": "tool"}]]}
    with pytest.raises(InputError, match="no such body"):
        robot_of(recipe)


def test_bodies_with_a_moment_a_little_below_zero_become_heavier_too(arm):
    text = re.sub(r'(<inertia [^>]*ixx=")[^"]*"', r'\1-1e-9"', arm.source.text)
    with pytest.warns(PathControlWarning, match="principal moments"):
        thin = pc.load_robot(text)
    np.testing.assert_allclose(thin.with_masses(scale=[3.0, 3.0]).mass_matrix(Q), 3 * thin.mass_matrix(Q), rtol=1e-12)


def test_one_joint_has_a_scale_or_a_mass(arm):
    with pytest.raises(InputError, match=r"joint_1 has a scale and a mass"):
        arm.with_masses(scale={"joint_1": 2.0}, kg={"joint_1": 3.0})
    one = arm.with_masses(scale={"joint_1": 2.0}, kg={"joint_2": 3.0})
    two = arm.with_masses(scale={"joint_1": 2.0}).with_masses(kg={"joint_2": 3.0})
    assert np.array_equal(one.mass_matrix(Q), two.mass_matrix(Q))


def test_masses_that_overflow_are_refused(arm):
    with pytest.raises(InputError, match=r"1e\+308, expected SI units"):
        arm.with_masses(scale={"joint_1": 1e308})


@pytest.mark.parametrize("turn", [2 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.ones((3, 3)), np.zeros((3, 3))])
def test_a_frame_is_turned_and_neither_mirrored_nor_stretched(arm, turn):
    pose = np.eye(4)
    pose[:3, :3] = turn
    with pytest.raises(InputError, match="rigid motion"):
        arm.with_frame("tip", "tool", pose)
