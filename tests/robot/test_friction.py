"""Friction laws, and the exact solver of set-valued dry friction."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from pathcontrol.errors import InputError
from pathcontrol.robot.friction import Coulomb, FrictionSum, Stribeck, Viscous, no_friction

EPS = np.finfo(float).eps

examples = settings(deadline=None)

VISCOUS = Viscous([2.288, 0.175, 0.0])
COULOMB = Coulomb([7.17, 1.734, 0.5], [8.049, 1.734, 0.0])
STRIBECK = Stribeck([2.0, 0.0, 1.0], [3.0, 0.5, 1.0], [0.1, 0.2, 0.3])
LAWS = {
    "none": no_friction(3),
    "viscous": VISCOUS,
    "coulomb": COULOMB,
    "stribeck": STRIBECK,
    "sum": VISCOUS + COULOMB,
    "three": VISCOUS + COULOMB + STRIBECK,
}
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
velocities = st.lists(st.floats(-20, 20), min_size=3, max_size=3).map(np.array)


# --- laws ---------------------------------------------------------------------------------------------------


@every_law
@examples
@given(qd=velocities)
def test_friction_takes_energy_out_at_every_joint(law, qd):
    assert (qd * law.torque(qd) >= 0).all()
    # smoothing with a width must not turn it into a motor either; tanh(x)(a + b tanh x) with |b| ≤ a
    assert (qd * law.smoothed(qd, 0.3) >= 0).all()


@every_law
@examples
@given(qd=velocities)
def test_torque_is_the_viscous_and_the_dry_part_of_the_definition(law, qd):
    plus, minus = (np.broadcast_to(level, 3) for level in law.levels(qd))
    assert (plus >= 0).all()
    assert (minus >= 0).all()
    for i, v in enumerate(qd):
        dry = plus[i] if v > 0 else -minus[i] if v < 0 else 0.0
        assert law.torque(qd)[i] == pytest.approx(law.viscous[i] * v + dry, rel=1e-15)


def test_coulomb_friction_keeps_its_direction_apart():
    assert_array_equal(COULOMB.torque(np.array([1e-9, 1.0, 20.0])), [7.17, 1.734, 0.5])
    assert_array_equal(COULOMB.torque(-np.array([1e-9, 1.0, 20.0])), [-8.049, -1.734, 0.0])
    assert_array_equal(COULOMB.torque(np.zeros(3)), np.zeros(3))


def test_coulomb_friction_is_symmetric_unless_told_otherwise():
    qd = np.array([0.3, -2.0])
    assert_array_equal(Coulomb([1.0, 2.0]).torque(qd), -Coulomb([1.0, 2.0]).torque(-qd))


def test_stribeck_friction_falls_from_static_to_coulomb():
    at_rest, _ = STRIBECK.levels(np.zeros(3))
    assert_array_equal(at_rest, STRIBECK.static)
    fast, _ = STRIBECK.levels(np.full(3, 100.0))
    assert_array_equal(fast, STRIBECK.coulomb)
    at_v_s, backward = STRIBECK.levels(STRIBECK.velocity)
    assert_allclose(at_v_s, STRIBECK.coulomb + (STRIBECK.static - STRIBECK.coulomb) / np.e, rtol=1e-14)
    assert_array_equal(at_v_s, backward)
    speeds = np.linspace(0, 1, 50)[:, None] * np.ones(3)
    levels, _ = STRIBECK.levels(speeds)
    assert (np.diff(levels, axis=0) <= 0).all()


@examples
@given(qd=velocities)
def test_a_sum_is_the_sum_of_its_terms(qd):
    more = Viscous([0.0, 1.0, 0.5])
    total = VISCOUS + COULOMB + STRIBECK + more
    expected = VISCOUS.torque(qd) + COULOMB.torque(qd) + STRIBECK.torque(qd) + more.torque(qd)
    assert isinstance(total, FrictionSum)
    assert_allclose(total.torque(qd), expected, rtol=1e-13)
    smooth = sum(law.smoothed(qd, 0.1) for law in (VISCOUS, COULOMB, STRIBECK, more))
    assert_allclose(total.smoothed(qd, 0.1), smooth, rtol=1e-13, atol=1e-300)


@every_law
@pytest.mark.parametrize("joints", [[0], [2, 0], [1, 2], [0, 1, 2]])
def test_selecting_joints_selects_their_torques(law, joints):
    qd = np.array([[0.2, -0.5, 0.7], [-3.0, 0.05, 0.0]])
    few = law.select(joints)
    assert few.n == len(joints)
    assert type(few) is type(law)
    assert_array_equal(few.torque(qd[:, joints]), law.torque(qd)[:, joints])


@every_law
def test_a_batch_is_a_loop(law):
    qd = np.random.default_rng(0).normal(size=(2, 4, 3))
    qd[0, 1] = 0.0
    for function in (law.torque, lambda v: law.smoothed(v, 0.1)):
        assert_array_equal(function(qd), [[function(v) for v in row] for row in qd])


@every_law
def test_smoothed_friction_tends_to_the_torque(law):
    qd = np.array([[0.3, -0.3, 0.5], [-0.4, 0.6, -0.2], [-0.3, 0.0, 0.0]])
    plus, minus = law.levels(qd)
    for width in (0.1, 0.03, 0.01):
        # |tanh x − sign x| and |tanh² x − 1| are at most 2 e^{−2|x|} and 4 e^{−2|x|}
        gap = 4 * (plus + minus) * np.exp(-2 * np.abs(qd) / width)
        gap = np.where(qd == 0, 0.0, gap) + 4 * EPS * (plus + minus + law.viscous)
        assert (np.abs(law.smoothed(qd, width) - law.torque(qd)) <= gap).all()


@every_law
def test_smoothed_friction_is_continuous_at_rest(law):
    tiny = np.full(3, 1e-9)
    plus, minus = law.levels(np.zeros(3))
    bound = (law.viscous + (plus + minus) / 0.1) * tiny  # the slope at zero is b + (F⁺ + F⁻)/2w
    assert (np.abs(law.smoothed(tiny, 0.1)) <= bound).all()
    assert_array_equal(law.smoothed(np.zeros(3), 0.1), np.zeros(3))


@every_law
def test_a_law_describes_itself_in_plain_values(law):
    import json

    assert json.loads(json.dumps(law.describe()))["law"] == type(law).__name__


def test_no_friction_is_none():
    qd = np.array([[-1.0, 2.0]])
    assert_array_equal(no_friction(2).torque(qd), np.zeros((1, 2)))


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: Viscous([1.0, -2.0]), r"viscous.*-2\.0"),
        (lambda: Viscous([np.nan]), r"viscous.*\[0\] is nan"),
        (lambda: Viscous(["soap"]), "viscous.*soap"),
        (lambda: Coulomb([1.0], [-1.0]), r"negative velocity.*-1\.0"),
        (lambda: Coulomb([1.0, 2.0], [1.0]), "2 joints forward and 1 backward"),
        (lambda: Stribeck([2.0], [1.0], [0.1]), "expected static ≥ Coulomb"),
        (lambda: Stribeck([1.0], [2.0], [0.0]), "velocity > 0"),
        (lambda: Viscous([1.0, 2.0]) + Coulomb([1.0]), r"\[1, 2\] joints"),
    ],
)
def test_bad_coefficients_are_refused_by_value(build, said):
    with pytest.raises(InputError, match=said):
        build()


def test_coefficients_cannot_be_changed_afterwards():
    given_values = np.array([1.0, 2.0])
    law = Viscous(given_values)
    given_values[0] = 99.0
    assert_array_equal(law.viscous, [1.0, 2.0])
    with pytest.raises(ValueError, match="read-only"):
        law.viscous[0] = 99.0
