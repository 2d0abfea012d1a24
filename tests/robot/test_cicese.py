"""The bundled arm against what is published about it."""

from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from pathcontrol.robot.loading import load_robot

# Reyes and Kelly, Mechatronics 11 (2001) and Robotica 15 (1997)
MASS = 23.902, 3.880
LENGTH = 0.45, 0.45
COM = 0.091, 0.048
INERTIA = 1.266, 0.093
GRAVITY = 9.81

BASE_HEIGHT, SECOND_LINK_OFFSET = 1.20, 0.05  # of our drawing, not of the papers

# what those numbers lump into
COUPLING = MASS[1] * LENGTH[0] * COM[1]
M22 = INERTIA[1] + MASS[1] * COM[1] ** 2
M11 = INERTIA[0] + MASS[0] * COM[0] ** 2 + MASS[1] * LENGTH[0] ** 2 + M22
MOMENT_1 = MASS[0] * COM[0] + MASS[1] * LENGTH[0]
MOMENT_2 = MASS[1] * COM[1]

# Printed with three decimals, some cut and not rounded (2.3516 as 2.351): below one unit of the last.
LAST_DIGIT = 1e-3
# Our numbers and Pinocchio's differ by rounding only: some hundred operations on terms of up to 60 N m.
ROUNDING = 1e-12

examples = settings(deadline=None)
angles = st.floats(-2 * np.pi, 2 * np.pi)
velocities = st.floats(-10, 10)
pairs_of_angles, pairs_of_velocities = st.tuples(angles, angles), st.tuples(velocities, velocities)


@pytest.fixture(scope="module")
def arm():
    return load_robot("cicese_2dof")


def mass_matrix(q, m11=M11, m12=M22, m22=M22, coupling=COUPLING):
    c = coupling * np.cos(q[1])
    return np.array([[m11 + 2 * c, m12 + c], [m12 + c, m22]])


def coriolis_matrix(q, qd, coupling=COUPLING):
    h = coupling * np.sin(q[1])
    return np.array([[-2 * h * qd[1], -h * qd[1]], [h * qd[0], 0.0]])


def gravity(q, first=MOMENT_1, second=MOMENT_2):
    outer = second * np.sin(q[0] + q[1])
    return GRAVITY * np.array([first * np.sin(q[0]) + outer, outer])


def christoffel(q, qd):
    """C of Christoffel symbols: ``coriolis_matrix`` has the same product C q̇, not the same matrix."""
    h = COUPLING * np.sin(q[1])
    return np.array([[-h * qd[1], -h * (qd[0] + qd[1])], [h * qd[0], 0.0]])


@pytest.mark.parametrize(
    ("lumped", "printed"),
    [
        (M11, 2.351),
        (2 * COUPLING, 0.168),
        (M22, 0.102),
        (COUPLING, 0.084),
        (MOMENT_1, 3.921),
        (MOMENT_2, 0.186),
    ],
)
def test_the_published_masses_lump_into_the_printed_coefficients(lumped, printed):
    assert abs(lumped - printed) < LAST_DIGIT


@examples
@given(q=pairs_of_angles, qd=pairs_of_velocities)
def test_the_arm_is_the_printed_one_to_its_last_digit(arm, q, qd):
    # each bound is one last digit of each coefficient, times what the coefficient is multiplied with
    c2, s2 = abs(np.cos(q[1])), abs(np.sin(q[1]))
    M_error = LAST_DIGIT * np.array([[1 + c2, 1 + c2], [1 + c2, 1]])
    printed_M = np.array(
        [
            [2.351 + 0.168 * np.cos(q[1]), 0.102 + 0.084 * np.cos(q[1])],
            [0.102 + 0.084 * np.cos(q[1]), 0.102],
        ]
    )
    assert (np.abs(arm.mass_matrix(q) - printed_M) <= M_error).all()

    s1, s12 = abs(np.sin(q[0])), abs(np.sin(q[0] + q[1]))
    g_error = GRAVITY * LAST_DIGIT * np.array([s1 + s12, s12]) + ROUNDING
    assert (np.abs(arm.gravity(q) - gravity(q, 3.921, 0.186)) <= g_error).all()

    printed_C = np.sin(q[1]) * np.array([[-0.168 * qd[1], -0.084 * qd[1]], [0.084 * qd[0], 0.0]])
    v1, v2 = np.abs(qd)
    C_error = LAST_DIGIT * s2 * np.array([v2 * (v1 + v2), v1 * v1]) + ROUNDING
    assert (np.abs(arm.coriolis(q, qd, qd) - printed_C @ qd) <= C_error).all()


@examples
@given(q=pairs_of_angles, qd=pairs_of_velocities)
def test_the_arm_is_the_exact_two_link_closed_form(arm, q, qd):
    assert_allclose(arm.mass_matrix(q), mass_matrix(q), rtol=0, atol=ROUNDING)
    assert_allclose(arm.gravity(q), gravity(q), rtol=0, atol=ROUNDING)
    assert_allclose(arm.coriolis_matrix(q, qd), christoffel(q, qd), rtol=0, atol=ROUNDING)
    assert_allclose(arm.coriolis(q, qd, qd), coriolis_matrix(q, qd) @ qd, rtol=0, atol=ROUNDING)
    whole = coriolis_matrix(q, qd) @ qd + gravity(q)
    assert_allclose(arm.nonlinear_effects(q, qd), whole, rtol=0, atol=ROUNDING)


@examples
@given(q=pairs_of_angles, qd=pairs_of_velocities)
def test_energies_are_those_of_two_links(arm, q, qd):
    kinetic = 0.5 * np.asarray(qd) @ mass_matrix(q) @ qd
    hanging = (MASS[0] + MASS[1]) * BASE_HEIGHT
    potential = GRAVITY * (hanging - MOMENT_1 * np.cos(q[0]) - MOMENT_2 * np.cos(q[0] + q[1]))
    assert_allclose(arm.kinetic_energy(q, qd), kinetic, rtol=1e-13, atol=ROUNDING)
    assert_allclose(arm.potential_energy(q), potential, rtol=1e-13, atol=ROUNDING)


def test_it_hangs_straight_down_at_zero_and_needs_no_torque_there(arm):
    assert_allclose(arm.gravity([0.0, 0.0]), 0.0, atol=ROUNDING)
    energy = arm.potential_energy([0.0, 0.0])
    raised = arm.potential_energy([[0.1, 0.0], [-0.1, 0.0], [0.0, 0.1], [0.0, -0.1]])
    assert (raised > energy).all()


@examples
@given(q=pairs_of_angles)
def test_the_tool_is_where_trigonometry_puts_it(arm, q):
    inner, outer = q[0], q[0] + q[1]
    x = LENGTH[0] * np.sin(inner) + LENGTH[1] * np.sin(outer)
    z = BASE_HEIGHT - LENGTH[0] * np.cos(inner) - LENGTH[1] * np.cos(outer)
    c, s = np.cos(outer), np.sin(outer)
    # turned by `outer` about −y, so that positive angles swing towards +x
    pose = [[c, 0, -s, x], [0, 1, 0, -SECOND_LINK_OFFSET], [s, 0, c, z], [0, 0, 0, 1]]
    assert_allclose(arm.frame_pose(q, "tool"), pose, rtol=0, atol=1e-14)


def test_friction_limits_and_encoders_are_the_published_ones(arm):
    plus, minus = arm.friction.levels(np.zeros(2))
    assert_array_equal(arm.friction.viscous, [2.288, 0.175])
    assert_array_equal(plus, [7.17, 1.734])
    assert_array_equal(minus, [8.049, 1.734])
    assert_array_equal(arm.limits.effort, [150.0, 15.0])
    assert_array_equal(arm.limits.lower, [-np.inf, -np.inf])
    assert_array_equal(arm.limits.upper, [np.inf, np.inf])
    assert_array_equal(arm.actuation.encoder_counts, [1_024_000, 655_360])


def test_plain_urdf_readers_see_the_mean_coulomb_level(arm):
    plus, minus = arm.friction.levels(np.zeros(2))
    root = ElementTree.fromstring(arm.source.text)
    for name, mean in zip(arm.joint_names, 0.5 * (plus + minus), strict=True):
        written = float(root.find(f"joint[@name='{name}']/dynamics").get("friction"))
        assert written == pytest.approx(mean, rel=1e-12)


def test_without_the_extension_friction_is_symmetric_and_encoders_are_unknown(arm):
    root = ElementTree.fromstring(arm.source.text)
    root.remove(root.find("pathcontrol"))
    plain = load_robot(ElementTree.tostring(root, encoding="unicode"))
    plus, minus = plain.friction.levels(np.zeros(2))
    assert_array_equal(plus, minus)
    assert_array_equal(plus, [7.6095, 1.734])
    assert plain.actuation.encoder_counts is None
    assert_array_equal(plain.mass_matrix([0.3, 0.4]), arm.mass_matrix([0.3, 0.4]))
