"""The inverse dynamics as an expression of CasADi is that of Pinocchio."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_arms import random_arm

import pathcontrol as pc
from pathcontrol.robot.symbolic_dynamics import load_casadi, symbolic_inverse_dynamics


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_it_is_that_of_pinocchio(seed, joints):
    pytest.importorskip("casadi")
    rng = np.random.default_rng(seed)
    robot = random_arm(seed, joints).with_armature(rng.uniform(0, 0.1, joints))
    q, qd, qdd = rng.normal(size=(3, joints)) * [[3.0], [2.0], [5.0]]
    tau = np.array(symbolic_inverse_dynamics(robot)(q, qd, qdd))[:, 0]
    exact = robot.inverse_dynamics(q, qd, qdd)
    assert tau == pytest.approx(exact, rel=1e-10, abs=1e-12 * np.abs(exact).max())


def test_the_extra_is_named_where_casadi_lacks(monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(pc.errors.MissingExtraError, match=r"casadi.*pip install 'pathcontrol\[mpc\]'"):
        load_casadi()
    with pytest.raises(ImportError, match=r"pathcontrol\[mpc\]"):
        pc.PathMPC(pc.load_robot("two_link"), pc.Circle(0.3, 1.0, center=[1.5, 1.0]))
