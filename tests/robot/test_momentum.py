"""The momentum of an arm and its rate: Hamilton's and Lagrange's equations, without accelerations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from random_arms import random_arm

from pathcontrol import InputError, RobotModel, load_robot

ARMS = {
    "cicese_2dof": load_robot("cicese_2dof").with_armature([0.1, 0.02]),
    "six": random_arm(6, 6),
    "seven": random_arm(7, 7, branched=False).with_payload(1.3, "l7", [0.1, 0.0, 0.2]),
}
every_arm = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)


def states(arm: RobotModel, batch: tuple[int, ...] = (5, 3)):
    rng = np.random.default_rng(arm.n)
    return tuple(rng.normal(0, scale, (*batch, arm.n)) for scale in (1.0, 2.0, 20.0))


@every_arm
def test_momentum_is_inertia_times_velocity(arm):
    q, qd, _ = states(arm)
    assert_allclose(arm.momentum(q, qd), (arm.mass_matrix(q) @ qd[..., None])[..., 0], rtol=1e-12, atol=1e-12)


@every_arm
def test_its_rate_is_the_torque_and_the_gradient_of_the_lagrangian(arm):
    """ṗ = τ + ∂(T − U)/∂q, by central differences of the energies."""
    q, qd, tau = states(arm)
    h = 1e-6 * np.eye(arm.n)
    energies = [
        arm.kinetic_energy(x, qd[..., None, :]) - arm.potential_energy(x)
        for x in (q[..., None, :] + s * h for s in (1, -1))
    ]
    gradient = (energies[0] - energies[1]) / 2e-6
    assert_allclose(arm.momentum_rate(q, qd, tau), tau + gradient, rtol=1e-6, atol=1e-6)


@every_arm
def test_its_rate_is_that_of_the_moving_arm(arm):
    """d(M q̇)/dt along q̈ = M⁻¹(τ − Cq̇ − g), by central differences."""
    q, qd, tau = states(arm)
    qdd, h = arm.forward_dynamics(q, qd, tau), 1e-6
    later, before = (arm.momentum(q + s * h * qd, qd + s * h * qdd) for s in (1, -1))
    assert_allclose(arm.momentum_rate(q, qd, tau), (later - before) / (2 * h), rtol=1e-5, atol=1e-4)


def test_states_of_other_arms_are_refused():
    arm = ARMS["six"]
    for method in (arm.momentum, lambda q, qd: arm.momentum_rate(q, qd, np.zeros(6))):
        with pytest.raises(InputError, match="6 joints"):
            method(np.zeros(5), np.zeros(5))
