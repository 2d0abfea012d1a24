"""Floquet multipliers: closed forms where they exist, decay in simulation, products of matrices far apart in size."""

import numpy as np
import pytest
from sliding_arm import sliding_arm

import pathcontrol as pc
from pathcontrol.analysis.stability.product_eigen import find_eigen
from pathcontrol.errors import InputError

ARM = pc.load_robot("cicese_2dof").with_friction(pc.Viscous(np.zeros(2)))
SPEED, RADIUS = 2.0, 1.0
CIRCLE = pc.Circle(RADIUS, SPEED)
OMEGA = SPEED / RADIUS
FAST = pc.Circle(RADIUS, 3 * SPEED)  # a lap of a third of the ticks


def arm_of(n):
    if n == 2:
        return ARM
    pytest.importorskip("example_robot_data")
    keep = None if n == 6 else [f"panda_joint{i}" for i in range(1, 8)]
    robot = pc.load_robot({6: "ur5", 7: "panda"}[n], keep=keep)
    return robot.with_friction(pc.Viscous(np.zeros(n)))


def path_of(n):
    if n == 2:
        return CIRCLE
    center = {6: [0.0, -1.2, 1.4, -0.2, 1.5, 0.0], 7: [0.0, -0.3, 0.0, -1.8, 0.0, 1.8, 0.0]}[n]
    return pc.Lissajous(np.full(n, 0.2), [1, 2, 1, 2, 1, 2, 1][:n], speed=0.5, center=center)


def assert_same(found, expected, lap, atol=1e-4):
    """The same exponents in any order, imaginary parts up to multiples of 2π/T."""
    turn = 2 * np.pi / lap

    def key(values):
        values = np.asarray(values, dtype=complex)
        imaginary = np.mod(values.imag, turn)
        folded = np.minimum(imaginary, turn - imaginary)
        order = np.lexsort([folded.round(3), values.real.round(3)])
        return np.stack([values.real, folded])[:, order]

    np.testing.assert_allclose(key(found), key(expected), rtol=1e-5, atol=atol)


# --- closed forms -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2, 7])
def test_computed_torque_has_the_roots_of_each_joint(n):
    """λ² + K_v λ + K_p = 0 joint by joint, and 0 along the orbit, in continuous time."""
    K_p, K_v = np.linspace(100.0, 150.0, n), np.linspace(25.0, 35.0, n)
    found = pc.floquet(pc.ComputedTorque(arm_of(n), path_of(n), K_p, K_v))
    roots = np.concatenate([np.roots([1, v, p]) for p, v in zip(K_p, K_v, strict=True)])
    assert abs(found.exponents[found.along]) < 1e-6
    assert_same(found.transverse, roots, found.period)
    assert found.stable
    assert found.decay_rate == pytest.approx(-roots.real.max(), rel=1e-6)


@pytest.mark.parametrize("k", [0.5, 20.0])
def test_the_extended_motion_plan_on_a_circle(k):
    """ė_p = e_v − k q_d'q_d'ᵀe_p and ė_v = −K_p e_p − K_v e_v, constant in axes that turn with the path."""
    found = pc.floquet(pc.ExtendedMotionPlan(ARM, CIRCLE, K_p=800.0, K_v=60.0, k=k))
    turn, one = OMEGA * np.array([[0.0, -1.0], [1.0, 0.0]]), np.eye(2)
    closed = np.block([[-k * RADIUS**2 * np.diag([1.0, 0.0]) - turn, one], [-800.0 * one, -60.0 * one - turn]])
    assert_same(found.transverse, np.linalg.eigvals(closed), found.period)


def test_projection_on_a_circle():
    """With the distance ν from the circle: ν̇ = −e_n, ė_t = −K_v e_t − ωe_n, ė_n = −K_v e_n + ωe_t + k_pν.

    The state of the law, which plays no part, comes back to σ within 10 ms.
    """
    found = pc.floquet(pc.Projection(ARM, CIRCLE, 800.0, 60.0))
    closed = np.array([[0.0, 0.0, -1.0], [0.0, -60.0, -OMEGA], [800.0, OMEGA, -60.0]])
    assert_same(found.transverse, [*np.linalg.eigvals(closed), -100.0], found.period, atol=2e-3)


def test_the_sum_of_exponents_is_the_mean_divergence():
    """Liouville: the sum of all exponents is −(ΣK_v + mean k‖q_d'‖²) for the plan, on any path."""
    task, K_v, k = path_of(6), np.linspace(25.0, 35.0, 6), 3.0
    found = pc.floquet(pc.ExtendedMotionPlan(arm_of(6), task, K_p=150.0, K_v=K_v, k=k))
    s = task.s0 + task.period * np.arange(4000) / 4000
    weight = 1 / task.theta(s)
    stretch = (np.square(task.dq_d(s)).sum(-1) * weight).sum() / weight.sum()
    assert found.exponents.real.sum() == pytest.approx(-(K_v.sum() + k * stretch), rel=1e-6)


def test_a_sampled_loop_has_the_multipliers_of_its_held_torque():
    """z² − (2 − K_v h − K_p h²/2)z + 1 − K_v h + K_p h²/2 = 0 for an arm of constant inertia without weight."""
    flat = sliding_arm()
    task, h, K_p, K_v = pc.Circle(0.1, 0.2), np.pi / 300, 300.0, 30.0  # 300 ticks a lap
    found = pc.floquet(pc.ComputedTorque(flat, task, K_p, K_v), pc.SampledLoop(period=h), settle=1)
    z = np.roots([1, -(2 - K_v * h - K_p * h**2 / 2), 1 - K_v * h + K_p * h**2 / 2])
    assert_same(found.transverse, np.repeat(np.log(z.astype(complex)) / h, 2), found.period, atol=1e-3)


def test_an_observer_adds_its_own_exponents_in_continuous_time():
    """Without a disturbance the estimate is 0, and both of its low passes decay at their corner frequency."""
    found = pc.floquet(pc.ComputedTorque(ARM, FAST, 200.0, 30.0, friction="observed", observer_hz=20.0))
    roots = [-10.0, -10.0, -20.0, -20.0, *[-40 * np.pi] * 4]
    # two low passes in a row have one mode, so that rounding takes their multipliers apart by its root
    np.testing.assert_allclose(np.sort(found.transverse.real)[::-1], roots, atol=0.02)


# --- simulation ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "loop"),
    [
        ("plan", pc.SampledLoop(5e-3)),
        ("projection", pc.SampledLoop(5e-3, velocity="difference", delay=2.5e-3)),
    ],
)
def test_errors_decay_in_simulation_as_the_slowest_mode(kind, loop):
    law = (
        pc.ExtendedMotionPlan(ARM, CIRCLE, K_p=200.0, K_v=40.0, k=20.0)
        if kind == "plan"
        else pc.Projection(ARM, CIRCLE, 200.0, 40.0)
    )
    found = pc.floquet(law, loop, settle=1)
    starts = np.array([1.0, 0.0]) + np.array([[0.0, 0.0], [1e-2, 0.0]])
    run = pc.simulate(law, starts, np.tile([0.0, 2.0], (2, 1)), duration=0.9, loop=loop, progress=False)
    radius = np.linalg.norm(run.array("q"), axis=-1)
    apart = np.abs(radius[1] - radius[0])
    late = (run.time > 0.35) & (run.time < 0.6)
    slope = np.polyfit(run.time[late], np.log(apart[late]), 1)[0]
    assert -slope == pytest.approx(found.decay_rate, rel=0.01)


def test_errors_of_a_law_with_an_observer_decay_as_the_slowest_mode():
    arm, task, loop = ARM.with_friction(pc.Viscous([1.0, 0.2])), pc.Circle(0.5, 2.0), pc.SampledLoop(period=0.01)
    law = pc.ComputedTorque(arm, task, 200.0, 30.0, friction="observed")
    starts = np.array([0.5, 0.0]) + np.array([[0.0, 0.0], [1e-4, 5e-5]])
    run = pc.simulate(law, starts, np.tile([0.0, 2.0], (2, 1)), duration=1.3, loop=loop, progress=False)
    apart = np.linalg.norm(np.diff(run.array("q"), axis=0)[0], axis=-1)
    late = (run.time > 0.6) & (run.time < 1.2)
    slope = np.polyfit(run.time[late], np.log(apart[late]), 1)[0]
    assert -slope == pytest.approx(pc.floquet(law, loop, settle=1).decay_rate, rel=0.01)


def test_gains_too_large_for_the_period_are_unstable():
    law = pc.ComputedTorque(ARM, FAST, 4000.0, 300.0)
    assert pc.floquet(law).stable
    assert pc.floquet(law, pc.SampledLoop(period=2e-3), settle=1).stable
    assert not pc.floquet(law, pc.SampledLoop(period=8e-3), settle=1).stable


def test_what_has_no_derivative_is_refused():
    law = pc.Projection(pc.load_robot("cicese_2dof"), FAST, 800.0, 60.0)
    with pytest.raises(InputError, match="dry friction"):
        pc.floquet(law)
    smooth = pc.Projection(ARM, FAST, 800.0, 60.0)
    with pytest.raises(InputError, match="encoders"):
        pc.floquet(smooth, pc.SampledLoop(encoders=True))
    with pytest.raises(InputError, match="closed"):
        pc.floquet(pc.Projection(ARM, pc.Line([0.0, 0.0], [1.0, 1.0], speed=0.5), 800.0, 60.0))
    with pytest.raises(InputError, match="several rollouts"):
        pc.floquet(pc.ComputedTorque(ARM, FAST, [[800.0, 800.0], [400.0, 400.0]], 60.0))
    held = pc.SpeedOverride(smooth, 0.0)
    with pytest.raises(InputError, match="no orbit"):
        pc.floquet(held)
    with pytest.raises(InputError, match="does not go round"):
        pc.floquet(held, pc.SampledLoop(period=0.03), settle=1)
    viscous = ARM.with_friction(pc.Viscous([1.0, 1.0]))
    with pytest.raises(InputError, match="no orbit"):
        pc.floquet(pc.Projection(viscous, FAST, 800.0, 60.0, friction="none"))
    assert pc.floquet(pc.Projection(viscous, FAST, 800.0, 60.0)).stable


# --- products -----------------------------------------------------------------------------------------------------


def test_products_of_equal_matrices_have_the_powers_of_their_eigenvalues():
    """Sizes from 1 to 1e-400, a complex pair among them, in a basis in general position."""
    rng = np.random.default_rng(3)
    pair = 0.5 * np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    inner = np.zeros((5, 5))
    inner[0, 0], inner[1:3, 1:3], inner[3, 3], inner[4, 4] = 1.0, pair, -0.1, 0.01
    basis = rng.standard_normal((5, 5))
    A = basis @ inner @ np.linalg.inv(basis)
    found = find_eigen([A] * 200)
    np.testing.assert_allclose(found.logarithms.real / 200, np.log([1.0, 0.5, 0.5, 0.1, 0.01]), atol=1e-10)
    assert np.mod(np.abs(found.logarithms.imag[1]), 2 * np.pi) == pytest.approx(
        min(np.mod(60.0, 2 * np.pi), 2 * np.pi - np.mod(60.0, 2 * np.pi)), abs=1e-6
    )
    for value, vector in zip([1.0, 0.01], found.vectors.T[[0, 4]], strict=True):
        np.testing.assert_allclose(A @ vector, value * vector, atol=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_products_of_random_matrices_that_are_similar_to_blocks(seed):
    """Real eigenvalues, complex pairs and equal sizes in a badly scaled basis, after any number of factors."""
    rng = np.random.default_rng(seed)
    angles, sizes = rng.uniform(0.01, 3.0, 2), np.array([1.0, 0.8, 0.8 if seed % 2 else 0.6])
    inner = np.zeros((6, 6))
    inner[0, 0], inner[5, 5] = sizes[0], 0.3
    for i, (angle, size) in enumerate(zip(angles, sizes[1:], strict=True)):
        rows = slice(1 + 2 * i, 3 + 2 * i)
        inner[rows, rows] = size * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    basis = rng.standard_normal((6, 6)) * np.geomspace(1.0, 100.0, 6)[:, None]
    A, count = basis @ inner @ np.linalg.inv(basis), int(rng.integers(50, 400))
    found = find_eigen([A] * count).logarithms
    np.testing.assert_allclose(found.real / count, np.log([1.0, *np.repeat(sizes[1:], 2), 0.3]), atol=1e-7)
    turned = np.mod(np.repeat(count * angles, 2) * [1, -1, 1, -1], 2 * np.pi)
    difference = np.exp(1j * found.imag[1:5])[:, None] - np.exp(1j * turned)
    assert (np.abs(difference).min(0) < 1e-5).all()


def test_eigenvalues_near_each_other_are_known_as_well_as_others():
    """Orthogonal iteration takes dozens of laps to tell 1e-4 from 0.6e-4 and would stop with an error of its own."""
    basis = np.random.default_rng(5).standard_normal((5, 5)) * np.geomspace(1.0, 100.0, 5)[:, None]
    over_lap = np.log([1.0, 1e-4, 0.6e-4, 0.6e-8, 1e-30])
    A = basis @ np.diag(np.exp(over_lap / 100)) @ np.linalg.inv(basis)
    np.testing.assert_allclose(find_eigen([A] * 100).logarithms.real, over_lap, atol=1e-9)


def test_an_adaptive_law_has_no_boundary_of_stability(ideal_arm):
    law = pc.AdaptiveSlotineLi(ideal_arm, pc.Circle(1.0, 2.0), 20.0, [100.0, 10.0], 0.001, k=20.0)
    for one in (law, pc.SpeedOverride(law, 0.5)):
        with pytest.raises(InputError, match="neither decay nor grow with any gain"):
            pc.largest_gain(one, "k")
        with pytest.raises(InputError, match="neither decay nor grow with any gain"):
            pc.stability_map(one, {"k": [1.0, 2.0]})
