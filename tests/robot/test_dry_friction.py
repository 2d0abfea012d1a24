"""Set-valued dry friction over a step: the velocity is the solution of a convex problem."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear
from test_friction import EPS, examples

from pathcontrol.simulation.arm import dry_friction
from pathcontrol.simulation.arm.dry_friction import stick_slip


def inertia(rng, n, condition):
    """A random symmetric positive definite matrix of the given condition number."""
    axes, _ = np.linalg.qr(rng.normal(size=(n, n)))
    moments = condition ** -rng.uniform(size=n)
    moments[0], moments[-1] = 1.0, 1.0 / condition
    M = (axes * moments) @ axes.T
    return 0.5 * (M + M.T)


@st.composite
def problems(draw, max_n=8, max_condition=1e6):
    """M, p, low, high of mechanisms of the same size; a fifth of the bounds are zero, on one side or both."""
    n, rng = draw(st.integers(1, max_n)), np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    condition = 10 ** draw(st.floats(0, np.log10(max_condition)))
    count = 16
    M = np.array([inertia(rng, n, condition) for _ in range(count)])
    plus, minus = rng.exponential(size=(2, count, n)) * (rng.random((2, count, n)) < 0.8)
    p = draw(st.sampled_from([0.3, 1.0, 3.0])) * rng.normal(size=(count, n))
    return M, p, -minus, plus


def assert_optimal(M, p, low, high, v):
    """The conditions M v + λ = p, λ in the set of sign v, to rounding.

    λ is taken from the first of them. Linear solves are backward stable: their residual is of the order
    n ε ‖M‖‖v‖, and a joint that close to slipping, or within 1e-12 max|p|, may stick.
    """
    n = p.shape[-1]
    impulse = p - (M @ v[..., None])[..., 0]
    size = np.abs(M).sum((-1, -2)) * np.abs(v).max(-1) + np.abs(p).max(-1)
    slack = (16 * n * EPS * size + 1e-12 * np.abs(p).max(-1))[:, None]
    assert (impulse <= high + slack).all()
    assert (impulse >= low - slack).all()
    assert (np.abs(impulse - high) <= slack)[v > 0].all()
    assert (np.abs(impulse - low) <= slack)[v < 0].all()


def by_enumeration(M, p, low, high):
    """v⁺ of one mechanism: of all 3^n ways to stick and slip, the one that contradicts itself least."""
    n, best, least = len(p), None, np.inf
    for states in product((-1, 0, 1), repeat=n):
        state = np.array(states)
        slip = state != 0
        impulse = np.where(state > 0, high, low)
        v = np.zeros(n)
        v[slip] = np.linalg.solve(M[np.ix_(slip, slip)], (p - impulse)[slip])
        needed = p - M @ v
        wrong_way = np.maximum(-v * state, 0)
        beyond = np.where(slip, 0.0, np.maximum(needed - high, low - needed))
        contradiction = max(wrong_way.max(), beyond.max())
        if contradiction < least:
            best, least = v, contradiction
    return best


def by_least_squares(M, p, low, high):
    """v⁺ of one mechanism from the dual, min ½(p − λ)ᵀM⁻¹(p − λ) over low ≤ λ ≤ high."""
    L = cholesky(M, lower=True)
    dry = low < high
    columns = solve_triangular(L, np.eye(len(p))[:, dry], lower=True)
    target = solve_triangular(L, p, lower=True)
    impulse = np.zeros(len(p))
    if dry.any():
        fit = lsq_linear(columns, target, (low[dry], high[dry]), method="bvls", tol=1e-15, max_iter=500)
        impulse[dry] = fit.x
    return np.linalg.solve(M, p - impulse)


@settings(examples, max_examples=60)
@given(problem=problems())
def test_the_velocity_satisfies_the_optimality_conditions(problem):
    M, p, low, high = problem
    v = stick_slip(M, p, low, high)
    assert v.shape == p.shape
    assert_optimal(M, p, low, high, v)


@settings(examples, max_examples=60)
@given(problem=problems())
def test_a_joint_well_inside_its_bounds_does_not_move_at_all(problem):
    M, p, low, high = problem
    v = stick_slip(M, p, low, high)
    impulse = p - (M @ v[..., None])[..., 0]
    # 1e-6 is far above the rounding error of the impulse, 1e6 · 1e-16 at most
    inside = (impulse < high - 1e-6) & (impulse > low + 1e-6)
    assert_array_equal(v[inside], 0.0)


def test_the_problems_above_stick_and_slip_both_ways():
    rng = np.random.default_rng(3)
    M = np.array([inertia(rng, 8, 1e6) for _ in range(50)])
    p, bound = rng.normal(size=(50, 8)), rng.exponential(size=(50, 8))
    v = stick_slip(M, p, -bound, bound)
    assert (v > 0).mean() > 0.1
    assert (v < 0).mean() > 0.1
    assert (v == 0).mean() > 0.1


@settings(examples, max_examples=10)
@given(problem=problems(max_n=4, max_condition=1e3))
def test_it_is_the_best_of_all_partitions(problem):
    v = stick_slip(*problem)
    for k, row in enumerate(zip(*problem, strict=True)):
        # v is determined to ε times the condition number of M, at most 1e3 here, and its own size
        assert_allclose(v[k], by_enumeration(*row), rtol=1e-11, atol=1e-11 * (1 + np.abs(v[k]).max()))


@settings(examples, max_examples=10)
@given(problem=problems(max_condition=1e3))
def test_it_solves_the_box_constrained_dual(problem):
    v = stick_slip(*problem)
    for k, row in enumerate(zip(*problem, strict=True)):
        # BVLS stops at a relative optimality of 1e-15 or at rounding, which M⁻¹ magnifies up to 1e3 times
        assert_allclose(v[k], by_least_squares(*row), rtol=1e-9, atol=1e-9 * (1 + np.abs(v[k]).max()))


@settings(examples, max_examples=40)
@given(problem=problems())
def test_the_step_loses_kinetic_energy(problem):
    M, p, low, high = problem
    v = stick_slip(M, p, low, high)
    # λᵀv ≥ 0 at every joint: friction opposes motion
    impulse = p - (M @ v[..., None])[..., 0]
    size = np.abs(M).sum((-1, -2)) * np.abs(v).max(-1) + np.abs(p).max(-1)
    assert (impulse * v >= -(32 * EPS * size * np.abs(v).max(-1))[:, None]).all()


@settings(examples, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), condition=st.sampled_from([1e1, 1e6]))
def test_momentum_exactly_at_the_bound(seed, condition):
    """Built from a known answer in which joints at rest sit at the very edge of slipping."""
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(1, 9)), 16
    M = np.array([inertia(rng, n, condition) for _ in range(count)])
    plus, minus = rng.exponential(size=(2, count, n))
    # at rest, just about to move, or well under way
    answer = rng.normal(size=(count, n)) * rng.choice([0.0, 1e-9, 1.0], size=(count, n))
    edge = np.where(rng.random((count, n)) < 0.5, plus, -minus)
    impulse = np.where(answer > 0, plus, np.where(answer < 0, -minus, edge))
    p = (M @ answer[..., None])[..., 0] + impulse
    v = stick_slip(M, p, -minus, plus)
    assert_optimal(M, p, -minus, plus, v)
    # the margin of 1e-12 max|p| in the impulse is worth that many times ‖M⁻¹‖ = condition in the velocity
    assert_allclose(v, answer, rtol=0, atol=20 * n * 1e-12 * condition * np.abs(p).max())


def test_momentum_exactly_at_the_bound_of_a_soft_mechanism():
    """The same where the slipping joints move fast along a direction of hardly any inertia.

    Their momentum is a small difference of large terms, so that rounding alone may call for sticking and for
    slipping in turn.
    """
    rng = np.random.default_rng(7)
    n, count, condition = 3, 2000, 1e6
    M = np.array([inertia(rng, n, condition) for _ in range(count)])
    plus, minus = rng.exponential(size=(2, count, n))
    answer = np.zeros((count, n))
    for k in range(count):
        slip = rng.permutation(n)[:2]
        moments, axes = np.linalg.eigh(M[k][np.ix_(slip, slip)])
        answer[k, slip] = axes[:, 0] / moments[0]
    edge = np.where(rng.random((count, n)) < 0.5, plus, -minus)
    impulse = np.where(answer > 0, plus, np.where(answer < 0, -minus, edge))
    p = (M @ answer[..., None])[..., 0] + impulse
    assert_optimal(M, p, -minus, plus, stick_slip(M, p, -minus, plus))


def test_integers_exactly_at_the_bound_stick():
    M = np.array([[[2.0, 1.0], [1.0, 2.0]]])
    bound = np.array([[1.0, 1.0]])
    for signs in product((-1.0, 1.0), repeat=2):
        assert_array_equal(stick_slip(M, np.array([signs]), -bound, bound), [[0.0, 0.0]])


def test_no_momentum_no_motion():
    rng = np.random.default_rng(4)
    M = np.array([inertia(rng, 5, 1e6) for _ in range(10)])
    plus, minus = rng.exponential(size=(2, 10, 5)) * (rng.random((2, 10, 5)) < 0.7)
    assert_array_equal(stick_slip(M, np.zeros((10, 5)), -minus, plus), np.zeros((10, 5)))


def test_without_friction_it_is_the_plain_velocity():
    rng = np.random.default_rng(5)
    M, p = np.array([inertia(rng, 6, 1e3) for _ in range(10)]), rng.normal(size=(10, 6))
    zero = np.zeros((10, 6))
    assert_allclose(stick_slip(M, p, zero, zero), np.linalg.solve(M, p[..., None])[..., 0], rtol=1e-12)


def test_a_frictionless_joint_without_momentum_of_its_own_is_carried_along():
    M, p = np.array([[[2.0, 1.0], [1.0, 2.0]]]), np.array([[3.0, 0.0]])
    bound = np.array([[1.0, 0.0]])
    # joint 1 slips, p − λ = (2, 0), v = M⁻¹ (2, 0)
    assert_allclose(stick_slip(M, p, -bound, bound), [[4 / 3, -2 / 3]], rtol=1e-15)


def test_joints_that_do_not_feel_each_other_are_shrunk_one_by_one():
    rng = np.random.default_rng(6)
    moments, p = rng.uniform(0.1, 5, (20, 4)), 2 * rng.normal(size=(20, 4))
    plus, minus = rng.exponential(size=(2, 20, 4))
    M = moments[:, :, None] * np.eye(4)
    expected = (np.maximum(p - plus, 0) + np.minimum(p + minus, 0)) / moments
    assert_allclose(stick_slip(M, p, -minus, plus), expected, rtol=1e-14)


def test_one_way_friction_holds_one_way_only():
    M, p = np.full((2, 1, 1), 2.0), np.array([[1.0], [-1.0]])
    v = stick_slip(M, p, np.zeros((2, 1)), np.full((2, 1), 3.0))
    assert_array_equal(v, [[0.0], [-0.5]])


def assert_same_bits(a, b):
    """Equal, the sign of 0 included."""
    assert_array_equal(a.view(np.int64), b.view(np.int64))


def alone(M, p, low, high, guess=None):
    """What is said of each of the same mechanisms alone, (N, n)."""
    guess = np.sign(p) if guess is None else guess
    low, high = (np.broadcast_to(level, p.shape) for level in (low, high))
    return np.array([stick_slip(*(a[k : k + 1] for a in (M, p, low, high, guess)))[0] for k in range(len(p))])


@settings(examples, max_examples=30)
@given(problem=problems())
def test_a_batch_of_mechanisms_is_a_loop(problem):
    assert_same_bits(stick_slip(*problem), alone(*problem))


@pytest.mark.parametrize("patience", [3, -1], ids=["blocks", "single"])
@settings(examples, max_examples=30)
@given(problem=problems(), seed=st.integers(0, 2**32 - 1), whole=st.booleans(), shared=st.booleans())
def test_a_batch_is_a_loop_after_many_exchanges(patience, problem, seed, whole, shared):
    M, p, low, high = problem
    if whole:  # zeros of either sign, and momenta exactly at the bounds
        n = p.shape[-1]
        M, p, low, high = np.round(4 * M) / 4 + n * np.eye(n), np.round(p), np.round(low), np.round(high)
    if shared:
        low, high = low[:1], high[:1]
    guess = np.random.default_rng(seed).choice([-1.0, 0.0, 1.0], size=p.shape)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dry_friction, "_PATIENCE", patience)
        v = stick_slip(M, p, low, high, guess)
        assert_same_bits(v, alone(M, p, low, high, guess))
    assert_optimal(M, p, low, high, v)


@pytest.mark.parametrize("M", [[[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]], [[2.0, 0.0], [0.0, 0.0]]])
def test_a_singular_mass_matrix_gives_no_numbers_in_any_number_of_rows(M):
    p, bound = np.array([[3.0, -5.0], [-2.0, 2.0]]), np.array([[1.0, 0.5]])
    for solve in (stick_slip, alone):
        assert not np.isfinite(solve(np.tile(M, (2, 1, 1)), p, -bound, bound)).all(-1).any()


def test_a_singular_mass_matrix_disturbs_no_other_row():
    p, bound = np.array([[3.0, -5.0], [-2.0, 2.0]]), np.array([[1.0, 0.5]])
    M = np.array([np.ones((2, 2)), 2 * np.eye(2)])
    assert_same_bits(stick_slip(M, p, -bound, bound)[1:], stick_slip(M[1:], p[1:], -bound, bound))


def test_a_batch_agrees_with_each_alone_on_which_side_of_the_edge_a_joint_is():
    """Bounds a few roundings around the momentum that just holds a joint: only sums in the same order agree there."""
    rng = np.random.default_rng(0)
    n, around = 4, np.arange(-8, 9)
    sticks = []
    for _ in range(80):
        M, p, bound = inertia(rng, n, 10.0), 2 * rng.normal(size=n), 2 * rng.exponential(size=n)
        (v,) = stick_slip(M[None], p[None], -bound[None], bound[None])
        held = np.flatnonzero((v == 0) & (np.abs(p - M @ v) > 1e-3))
        if not held.size:
            continue
        rounding = 8 * n * EPS * np.abs(M * v).sum(1).max()
        edge = np.abs(p - M @ v)[held[0]] - 1e-12 * np.abs(p).max() - rounding
        high = np.tile(bound, (len(around), 1))
        high[:, held[0]] = edge + around * np.spacing(edge)
        M, p = (np.broadcast_to(a, (len(around), *a.shape)) for a in (M, p))
        v = stick_slip(M, p, -high, high)
        assert_same_bits(v, alone(M, p, -high, high))
        sticks.append(v[:, held[0]] == 0)
    assert 0.1 < np.mean(sticks) < 0.9  # the edge is among them


def test_an_empty_batch_is_empty():
    empty = np.zeros((0, 3))
    assert stick_slip(np.zeros((0, 3, 3)), empty, empty, empty).shape == (0, 3)
