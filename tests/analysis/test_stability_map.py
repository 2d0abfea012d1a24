"""Gain maps and largest gains: the boundary is that of discrete maps written by hand, and of simulations beside it."""

import warnings

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve
from sliding_arm import sliding_arm

import pathcontrol as pc
from pathcontrol.control.law_gains import gains_of_law, with_gains
from pathcontrol.errors import InputError, UnknownNameError

FLAT = sliding_arm()
ARM = pc.load_robot("cicese_2dof").with_friction(pc.Viscous(np.zeros(2)))
CIRCLE = pc.Circle(1.0, 2.0)
FAST = pc.Circle(1.0, 4.0)  # a lap of half the ticks
H = np.pi / 60  # s: 60 ticks in a lap of the circle
K_P, K_V = 100.0, 15.0  # of the plan, 1/s² and 1/s
QUIET = {"settle": 1, "progress": False}


def held_map(K_p, K_v, kind):
    """One tick of ë = −u with u held, for the state (e, ė, what the loop keeps): by hand, for each kind of loop."""
    travel = np.array([[1.0, H], [0.0, 1.0]])
    push = np.array([-(H**2) / 2, -H])
    if kind == "hold":
        return travel + np.outer(push, [K_p, K_v])
    if kind == "difference":  # keeps e of the tick before
        u = np.array([K_p + K_v / H, 0.0, -K_v / H])
        return np.vstack([np.pad(travel, ((0, 0), (0, 1))) + np.outer(push, u), [1.0, 0.0, 0.0]])
    if kind == "late":  # keeps u, which acts a period later
        return np.vstack([np.column_stack([travel, push]), [K_p, K_v, 0.0]])
    if kind == "half":  # u of the tick before for half a period, then u
        first = np.array([-3 * H**2 / 8, -H / 2])
        second = np.array([-(H**2) / 8, -H / 2])
        return np.vstack([np.column_stack([travel + np.outer(second, [K_p, K_v]), first]), [K_p, K_v, 0.0]])
    keep = np.exp(-2 * np.pi * 3.0 * H)  # keeps the filtered velocity and e of the tick before
    now = np.array([0.0, 0.0, 1.0])
    arm = np.pad(travel, ((0, 0), (0, 1))) + np.outer(push, K_p * np.array([1.0, 0.0, 0.0]) + K_v * now)
    return np.vstack([arm, keep * now + (1 - keep) * arm[1]])


LOOPS = {
    "hold": pc.SampledLoop(period=H),
    "difference": pc.SampledLoop(period=H, velocity="difference"),
    "late": pc.SampledLoop(period=H, delay=H),
    "half": pc.SampledLoop(period=H, delay=H / 2),
    "filter": pc.SampledLoop(period=H, filter_hz=3.0),
}


def hand_growth(K_p, K_v, kind):
    return np.log(np.abs(np.linalg.eigvals(held_map(K_p, K_v, kind))).max()) / H


@pytest.mark.parametrize("kind", LOOPS)
def test_the_map_of_a_linear_arm_is_that_of_the_held_double_integrator(kind):
    law = pc.ComputedTorque(FLAT, FAST, 40.0, 8.0)
    found = pc.stability_map(law, {"K_p": [400.0, 40.0, 20.0], "K_v": [4.0, 60.0]}, LOOPS[kind], **QUIET)
    assert found.names == ("K_p", "K_v")
    assert found.own == (40.0, 8.0)
    np.testing.assert_array_equal(found.grids[0], [20.0, 40.0, 400.0])
    by_hand = np.array([[hand_growth(p, v, kind) for v in found.grids[1]] for p in found.grids[0]])
    np.testing.assert_allclose(found.growth, by_hand, rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(found.multiplier, np.exp(by_hand * np.pi / 2), rtol=1e-3)
    assert (found.stable == (by_hand < 0)).all()
    assert found.stable.any()
    assert not found.stable.all()
    changes = sum(np.diff(found.stable, axis=axis).sum() for axis in (0, 1))
    assert len(found.boundary) == changes > 0
    for K_p, K_v in found.boundary:
        assert abs(hand_growth(K_p, K_v, kind)) < 1e-3
        along_p = K_v in found.grids[1]
        exact = (
            brentq(hand_growth, 0.98 * K_p, 1.02 * K_p, (K_v, kind))
            if along_p
            else brentq(lambda v, p=K_p: hand_growth(p, v, kind), 0.98 * K_v, 1.02 * K_v)
        )
        assert (K_p if along_p else K_v) == pytest.approx(exact, rel=1e-4)


def test_the_jury_conditions_of_a_held_torque():
    """K_v h < 2 and K_p h < 2 K_v."""
    law = pc.ComputedTorque(FLAT, FAST, 40.0, 8.0)
    assert pc.largest_gain(law, "K_v", LOOPS["hold"], settle=1) == pytest.approx(2 / H, rel=1e-5)
    assert pc.largest_gain(law, "K_p", LOOPS["hold"], settle=1) == pytest.approx(16 / H, rel=1e-5)
    wild = pc.ComputedTorque(FLAT, FAST, 3000.0, 8.0)  # from above, where the law's own gain is unstable
    assert pc.largest_gain(wild, "K_p", LOOPS["hold"], settle=1) == pytest.approx(16 / H, rel=1e-5)
    with pytest.raises(InputError, match="unstable with any K_p"):
        pc.largest_gain(pc.ComputedTorque(FLAT, FAST, 40.0, 50.0), "K_p", LOOPS["hold"], settle=1)


def plan_tick(x, k, by_difference, h):
    """One tick of the plan on a point of unit mass, on the circle of radius 1 at 2 rad/s, written by hand."""
    q, v, s, before = x[:2], x[2:4], x[4], x[5:7]
    seen = (q - before) / h if by_difference else v
    tangent, inward = np.array([-np.sin(s), np.cos(s)]), -np.array([np.cos(s), np.sin(s)])
    e_p, e_v = -inward - q, 2.0 * tangent - seen
    rate = 2.0 - k * e_p @ tangent
    a = 2.0 * inward * rate + K_V * e_v + K_P * e_p
    slope = -k * (1.0 + e_p @ inward)
    phi_1 = np.expm1(h * slope) / (h * slope)
    s = s + h * phi_1 * rate + h * (phi_1 - 1) / slope * k * (seen @ tangent)
    return np.concatenate([q + h * v + h**2 / 2 * a, v + h * a, [s], q])


def turn_back(x, angle):
    """The state (q, v, s, the q before) seen from axes that have turned by an angle."""
    back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.concatenate([back @ x[:2], back @ x[2:4], [x[4] - angle], back @ x[5:]])


def hand_growth_of_plan(k, by_difference, period=H):
    """The slowest growth beside the motion that turns on by the same angle each tick: one Jacobian, no lap."""

    def residual(x):  # the steady motion may run at another rate than ϑ, and the angle at which it begins is free
        y = plan_tick(np.insert(x, 4, 0.0), k, by_difference, period)
        return np.delete(turn_back(y, y[4]), 4) - x

    guess = np.array([1.0, 0.0, 0.0, 2.0, np.cos(2 * period), -np.sin(2 * period)])
    steady, _, done, _ = fsolve(residual, guess, xtol=1e-13, full_output=True)
    assert done == 1
    x = np.insert(steady, 4, 0.0)
    step = plan_tick(x, k, by_difference, period)[4]
    ends = [[turn_back(plan_tick(x + d, k, by_difference, period), step) for d in (e, -e)] for e in 1e-6 * np.eye(7)]
    values = np.linalg.eigvals(np.stack([(high - low) / 2e-6 for high, low in ends], axis=1))
    return np.log(np.abs(np.delete(values, np.abs(values - 1).argmin())).max()) / period


@pytest.mark.parametrize("velocity", ["exact", "difference"])
def test_the_largest_gain_of_the_plan_is_that_of_a_map_by_hand(velocity):
    loop, late = pc.SampledLoop(period=H, velocity=velocity), velocity == "difference"
    law = pc.ExtendedMotionPlan(FLAT, CIRCLE, K_P, K_V, 20.0)
    for k in (20.0, 300.0):
        found = pc.floquet(with_gains(law, {"k": k}), loop, settle=1).decay_rate
        # a lap is no whole number of these long ticks: half a tick turns the modes by H, in a lap of π seconds
        assert found == pytest.approx(-hand_growth_of_plan(k, late), abs=H)
    largest = pc.largest_gain(law, "k", loop, settle=1)
    exact = brentq(hand_growth_of_plan, 0.5 * largest, 2 * largest, (late,))
    assert largest == pytest.approx(exact, rel=0.01)


def test_the_error_of_ticks_that_do_not_fit_into_a_lap_falls_with_the_period():
    """Per second it is at most the turn of half a tick in a lap, so that it is of first order in the period."""
    law = pc.ExtendedMotionPlan(FLAT, CIRCLE, K_P, K_V, 20.0)
    fine = pc.floquet(law, pc.SampledLoop(period=H / 8), settle=1).decay_rate
    assert fine == pytest.approx(-hand_growth_of_plan(20.0, False, period=H / 8), abs=H / 8)


def test_simulations_on_either_side_of_the_boundary():
    """The distance of two runs from the same circle shrinks below the largest gain and grows beyond it."""
    loop = pc.SampledLoop(period=H / 2, velocity="difference", delay=H / 4)
    law = pc.ComputedTorque(ARM, CIRCLE, 60.0, 10.0)
    largest = pc.largest_gain(law, "K_p", loop, settle=1)
    for share in (0.97, 1.03):
        near = with_gains(law, {"K_p": share * largest})
        starts = CIRCLE.q_d(np.zeros(())) + np.array([[0.0, 0.0], [1e-6, -1e-6]])
        run = pc.simulate(near, starts, np.tile([0.0, 2.0], (2, 1)), duration=5 * np.pi, loop=loop, progress=False)
        apart = np.linalg.norm(np.diff(run.array("q"), axis=0)[0], axis=-1)
        second, last = (apart[(run.time > begin) & (run.time < begin + np.pi)].max() for begin in (np.pi, 4 * np.pi))
        assert (last > 1.2 * second) == (share > 1)
        assert (last < second / 1.2) == (share < 1)


def test_each_point_is_what_floquet_says_of_the_law_with_these_gains():
    loop = LOOPS["hold"]
    law = pc.Projection(ARM, CIRCLE, 100.0, [12.0, 15.0])
    found = pc.stability_map(law, {"k_p": [60.0, 120.0]}, loop, **QUIET)
    for k_p, rate in zip(found.grids[0], found.decay_rate, strict=True):
        one = pc.floquet(pc.Projection(ARM, CIRCLE, k_p, [12.0, 15.0]), loop, settle=1)
        assert rate == pytest.approx(one.decay_rate, rel=1e-6)
    assert found.boundary.shape == (0, 1)
    law = pc.ManeuverRegulation(ARM, CIRCLE, 100.0, 12.0)  # whose start depends on its gains
    found = pc.stability_map(law, {"K_p": [60.0, 100.0]}, loop, **QUIET)
    assert found.decay_rate[1] == pytest.approx(pc.floquet(law, loop, settle=1).decay_rate, rel=1e-6)


def test_the_mode_along_the_orbit_is_never_a_transverse_one():
    """Where two joints have the same gains a pair of slow modes becomes unstable, and the rate has no jump."""
    loop = pc.SampledLoop(period=H, velocity="difference", delay=H / 2)
    law = pc.ComputedTorque(ARM, CIRCLE, 40.0, 6.0)
    edge = pc.largest_gain(law, "K_p", loop, settle=1)
    grid = edge * np.linspace(0.99, 1.01, 5)
    rates = pc.stability_map(law, {"K_p": grid}, loop, **QUIET).decay_rate
    assert (np.diff(rates) < 0).all()
    assert np.ptp(np.diff(rates)) < 0.1 * np.abs(np.diff(rates)).max()


def test_multipliers_that_are_0_are_no_numbers_that_are_none():
    """A reading that is replaced at each tick, and the state of the projection, are forgotten at once."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = pc.floquet(pc.Projection(FLAT, CIRCLE, 100.0, 12.0), LOOPS["difference"], settle=1)
    assert np.isfinite(found.multipliers).all()
    assert (found.exponents.real < -100).sum() >= 3
    assert not np.isnan(found.exponents).any()
    assert found.stable
    assert abs(found.multipliers[found.along] - 1) < 1e-3


def test_continuous_time_has_no_boundary():
    law = pc.ComputedTorque(ARM, CIRCLE, 100.0, 25.0)
    found = pc.stability_map(law, {"K_p": [100.0, 400.0]}, progress=False)
    assert found.loop is None
    np.testing.assert_allclose(found.growth, [np.roots([1, 25, p]).real.max() for p in (100.0, 400.0)], rtol=1e-6)
    assert found.stable.all()


def test_what_is_no_map_is_refused():
    law = pc.ExtendedMotionPlan(ARM, CIRCLE, 800.0, 60.0, 20.0)
    with pytest.raises(UnknownNameError, match="did you mean 'K_p'"):
        pc.stability_map(law, {"k_p": [1.0]})
    with pytest.raises(UnknownNameError, match="expected one of K_p, K_v, k"):
        pc.largest_gain(law, "gain")
    for gains in ({}, {"k": [1], "K_p": [1], "K_v": [1]}, ["k"], {"k": 20.0}, {"k": [1.0, 1.0]}, {"k": []}):
        with pytest.raises(InputError, match="expected"):
            pc.stability_map(law, gains)
    for gains, said in (({"k": [-1.0, 2.0]}, "k ≥ 0"), ({"K_v": [0.0, 2.0]}, "K_v"), ({"k": [np.nan]}, "k")):
        with pytest.raises(InputError, match=said):
            pc.stability_map(law, gains)
    with pytest.raises(InputError, match="loop"):
        pc.stability_map(law, {"k": [1.0]}, 2.5e-3)
    with pytest.raises(InputError, match="law"):
        pc.stability_map(ARM, {"k": [1.0]})


class OwnLaw(pc.ComputedTorque):
    """A law with an argument of its own, which it keeps, or does not."""

    def __init__(self, robot, task, K_p, K_v, softness, kept=True):
        super().__init__(robot, task, np.asarray(K_p) * softness, K_v)
        self.K_p = np.asarray(K_p)
        self.kept = kept
        if kept:
            self.softness = softness


def test_a_law_with_other_gains_is_otherwise_the_same():
    laws = [
        pc.Projection(ARM, CIRCLE, 800.0, [45.0, 60.0], branch="local", capture=0.2, friction="none"),
        pc.ComputedTorque(ARM, CIRCLE, 800.0, 60.0, friction="observed", observer_hz=20.0, start="nearest"),
        pc.SlotineLi(ARM, CIRCLE, 20.0, [30.0, 3.0]),
        pc.SpeedOverride(pc.ExtendedMotionPlan(ARM, CIRCLE, 800.0, 45.0, 20.0), 0.5, acceleration=3.0),
        pc.EventPlan(pc.ExtendedMotionPlan(ARM, CIRCLE, 800.0, 45.0, 20.0), observer_hz=12.0),
        pc.ManeuverRegulation(ARM, CIRCLE, 800.0, [45.0, 60.0]),
        pc.TransverseLinearization(ARM, CIRCLE, 800.0, 60.0, 20.0),
        pc.AdaptiveSlotineLi(ARM, CIRCLE, 20.0, [30.0, 3.0], 0.1, k=5.0),
        OwnLaw(ARM, CIRCLE, 100.0, 20.0, 0.5),
    ]
    q, qd = np.array([[0.9, 0.1]]), np.array([[0.1, 1.8]])
    for law in laws:
        for name, value in gains_of_law(law).items():
            other = with_gains(law, {name: 2 * value})
            assert type(other) is type(law)
            before, after = law.describe(), other.describe()
            inside = [one.pop("law", {}) for one in (before, after)]  # of a wrapper the law inside, once more
            assert {key for key, each in before.items() if after[key] != each} == {name}
            assert {key for key, each in inside[0].items() if inside[1][key] != each} <= {name}
            again = with_gains(other, {name: value})
            z = law.start(q, qd)
            np.testing.assert_array_equal(again.law(0.0, q, qd, z).tau, law.law(0.0, q, qd, z).tau)
    with pytest.raises(InputError, match="does not keep its argument 'softness'"):
        with_gains(OwnLaw(ARM, CIRCLE, 100.0, 20.0, 0.5, kept=False), {"K_p": 3.0})
