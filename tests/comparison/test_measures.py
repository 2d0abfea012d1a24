"""The measures of a comparison have closed forms on motions that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from sliding_arm import sliding_arm

import pathcontrol as pc
from pathcontrol.comparison.comparison_table import describe_comparison, tabulate
from pathcontrol.comparison.measures import MEASURES, RECOVERED, energy, measure, recovery_time
from pathcontrol.simulation.acting_limits import acting_limits
from pathcontrol.simulation.variables import VARIABLES

TIME = np.linspace(0.0, 4.0, 4001)
TASK = pc.Circle(1.0, 2.0)


class Uneven(pc.PathTask):
    """A circle with ϑ = 1/(1 + cos(s)/2), along which ∫ds/ϑ = s + sin(s)/2."""

    period = 2 * np.pi

    def q_d(self, s):
        return np.stack([np.cos(s), np.sin(s)], axis=-1)

    def theta(self, s):
        return 1 / (1 + 0.5 * np.cos(s))


def made(arm, task=TASK, *, s=None, behind=0.0, away=0.0, tau=(0.0, 0.0), outcome=None, time=TIME):
    """A run of one rollout whose arm is ``away`` from the circle and ``behind`` s."""
    s = 2.0 * time if s is None else np.broadcast_to(s, time.shape)
    arrays = {
        name: np.zeros((1, len(time), 2) if "joint" in dims else (1, len(time)))
        for name, (dims, *_) in VARIABLES.items()
    }
    angle = s - behind
    arrays["s"] = s[None]
    arrays["q"] = ((1 + away) * np.stack([np.cos(angle), np.sin(angle)]))[None].swapaxes(1, 2)
    arrays["qd"] = np.gradient(arrays["q"], time, axis=1)
    arrays["tau"] = np.broadcast_to(tau, (1, len(time), 2)).copy()
    joints = dict.fromkeys(arm.joint_names, "rad")
    return pc.Run.from_arrays(time, joints, arrays, {}, outcome or {}, robot=arm, task=task)


def test_contour_and_lag_are_told_apart(arm):
    away = 0.2 * np.sin(TIME)
    values = measure(made(arm, away=away, behind=0.3), made(arm), (1.0, 4.0), None)
    assert set(values) == set(MEASURES)
    late = TIME >= 1.0
    assert_allclose(values["contour_peak"], np.abs(away[late]).max(), rtol=1e-9)
    assert_allclose(values["contour_rms"], np.sqrt((away[late] ** 2).mean()), rtol=1e-9)
    # the arm at radius ρ and angle s − α is ρ sin α behind along the tangent
    assert_allclose(values["lag_peak"], (1 + away[late]).max() * np.sin(0.3), rtol=1e-9)


def test_peaks_are_of_the_event_and_after(arm):
    early = np.where(TIME < 1.0, 0.5, 0.1)
    values = measure(made(arm, away=early), made(arm), (1.0, 4.0), None)
    assert_allclose(values["contour_peak"], 0.1)
    assert_allclose(measure(made(arm, away=early), made(arm), (0.0, 4.0), None)["contour_peak"], 0.5)


def test_energy_and_torque_of_a_constant_power(arm):
    turning = made(arm, tau=(3.0, -4.0))
    turning.array("qd")[...] = (2.0, 1.0)
    values = measure(turning, made(arm), (1.0, 4.0), None)
    assert_allclose(values["energy_j"], abs(3.0 * 2.0 - 4.0) * 3.0, rtol=1e-12)
    assert_allclose(values["torque_peak"], 4.0)
    assert_allclose(values["speed_peak"], np.hypot(2.0, 1.0))
    turning.array("tau")[...] = (0.0, -4.0)  # power that flows back counts as well
    assert_allclose(measure(turning, made(arm), (0.0, 4.0), None)["energy_j"], 16.0, rtol=1e-12)


def test_energy_is_of_the_torque_that_is_held_in_each_period(arm):
    """∫|τ q̇| dt of a torque that jumps at each tick and a speed that rises evenly is a sum over the periods."""
    torque = np.random.default_rng(0).normal(0.0, 9.0, TIME.shape)
    turning = made(arm, tau=np.stack([torque, 0 * torque], axis=-1))
    turning.array("qd")[..., 0] = TIME
    exact = (np.abs(torque[:-1]) * np.diff(TIME**2 / 2))[TIME[:-1] >= 1.0].sum()
    assert_allclose(measure(turning, made(arm), (1.0, 4.0), None)["energy_j"], exact, rtol=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.001])
def test_energy_of_an_arm_without_friction_is_the_change_of_its_kinetic_energy(delay):
    """Slides in a plane, T = ½Σmq̇², with noise so that torques jump at each tick."""
    slides, mass = sliding_arm(), np.array([5.0, 3.0])
    law = pc.ComputedTorque(slides, pc.Circle(0.3, 0.6), 400.0, 40.0)
    loop = pc.SampledLoop(0.005, delay=delay, noise=pc.SensorNoise(position=1e-3, seed=1))
    run = pc.simulate(law, [0.35, 0.0], duration=1.0, loop=loop, progress=False)
    kinetic = 0.5 * (mass * run.array("qd") ** 2).sum(-1)
    assert_allclose(energy(run, 0, len(run.time)), np.abs(np.diff(kinetic)).sum(-1), rtol=1e-3)  # turns within a period


def test_saturated_is_the_time_at_the_limit_of_any_joint(arm):
    limits = arm.limits.effort
    torque = np.zeros((len(TIME), 2))
    torque[(TIME >= 1.0) & (TIME < 1.5), 0] = limits[0]
    torque[(TIME >= 1.25) & (TIME < 2.0), 1] = -limits[1]
    torque[TIME >= 3.0, 1] = 0.99 * limits[1]
    run, whole = made(arm, tau=torque), made(arm, tau=limits)
    assert_allclose(measure(run, made(arm), (0.0, 4.0), None, limits)["saturated_s"], 1.0, atol=2e-3)
    assert measure(whole, made(arm), (1.0, 4.0), None, limits)["saturated_s"] == pytest.approx(3.0, rel=1e-12)
    assert measure(whole, made(arm), (1.0, 4.0), None)["saturated_s"] == 0.0  # nothing limits it


def test_saturated_has_the_same_bits_for_a_rollout_alone(arm):
    limits = arm.limits.effort
    torque = np.random.default_rng(0).choice([0.0, 1.0], (5, len(TIME), 1)) * limits
    alone = [made(arm, tau=tau) for tau in torque]
    arrays = {name: np.concatenate([run.array(name) for run in alone]) for name in VARIABLES if name in alone[0]}
    joints = dict.fromkeys(arm.joint_names, "rad")
    together = pc.Run.from_arrays(TIME, joints, arrays, {}, {}, robot=arm, task=TASK)
    of_all = measure(together, together, (0.0, 4.0), None, limits)["saturated_s"]
    assert [measure(run, run, (0.0, 4.0), None, limits)["saturated_s"][0] for run in alone] == of_all.tolist()


@pytest.mark.parametrize("factor", [0.25, [0.5, 0.25], [[0.25, 0.5]]])
def test_saturated_is_at_the_limits_that_a_drop_leaves(arm, factor):
    limits = arm.limits.effort
    drop = pc.TorqueLimitDrop(factor, start=1.0, duration=2.0) + pc.TorqueLimitDrop(0.5, start=2.0, duration=1.0)
    run = made(arm, tau=0.125 * limits)
    left = acting_limits(limits, drop, run.time)
    for time, share in ((0.5, 1.0), (1.5, np.asarray(factor)), (2.5, 0.5 * np.asarray(factor)), (3.5, 1.0)):
        assert_allclose(left[0, TIME.searchsorted(time)], np.ravel(share * limits))
    assert_allclose(measure(run, made(arm), (0.0, 4.0), None, left)["saturated_s"], 1.0, atol=1e-9)
    assert acting_limits(None, drop, run.time) is None
    assert_allclose(acting_limits(limits, None, run.time), limits[None, None])


@given(st.floats(1e-3, 0.1), st.floats(0.5, 5.0))
def test_recovery_of_an_error_that_decays(normal, rate):
    contour = np.exp(-rate * (TIME - 1.0))[None]
    found = recovery_time(contour, np.array([normal]), TIME, 1.0)[0]
    exact = -np.log(RECOVERED * normal) / rate
    assert found == pytest.approx(exact, abs=1.1e-3) if exact < 2.999 else (found == np.inf or found > 2.99)


def test_recovery_of_what_never_leaves_comes_back_or_ends():
    contour = np.array([np.full(len(TIME), 0.1), np.full(len(TIME), 0.2), np.where(TIME < 3.0, 0.1, 0.2)])
    found = recovery_time(contour, np.full(3, 0.1), TIME, 2.0)
    assert found.tolist() == [0.0, np.inf, np.inf]
    assert np.isnan(recovery_time(contour, np.full(3, 0.1), TIME, None)).all()


@given(st.floats(-3.0, 3.0), st.floats(0.0, 20.0))
def test_time_lost_is_the_planned_time_between_both(arm, lost, end):
    task = Uneven()
    time = np.linspace(0.0, 4.0, 9)
    here, there = made(arm, task, s=end - lost, time=time), made(arm, task, s=end, time=time)
    exact = lost + 0.5 * (np.sin(end) - np.sin(end - lost))
    assert_allclose(measure(here, there, (0.0, 4.0), None)["time_lost_s"], exact, atol=1e-9)


class Slowing(pc.Line):
    """A line along which ϑ = (s_end − s)/T falls to 0 at the end, or to the square root of that."""

    power = 1.0

    def theta(self, s):
        return ((self.s_end - s) / 0.1) ** self.power


@pytest.mark.parametrize("share", [0.5, 0.99, 0.99999])
def test_time_lost_is_exact_where_the_profile_is_slow(arm, share):
    """∫ds/ϑ = T ln((s_end − a)/(s_end − b)): the last hundredth of the path takes as long as all before."""
    task = Slowing([0.0, 0.0], [1.0, 1.0], 1.0)
    begin, end = 0.2 * task.s_end, share * task.s_end
    lost = measure(made(arm, task, s=begin), made(arm, task, s=end), (0.0, 4.0), None)["time_lost_s"]
    assert_allclose(lost, 0.1 * np.log((task.s_end - begin) / (task.s_end - end)), rtol=1e-8)


@pytest.mark.parametrize(("power", "expected"), [(0.5, 2.0 * 0.1**0.5), (1.0, np.inf), (2.0, np.inf)])
def test_time_lost_to_an_end_at_rest_is_what_it_takes(arm, power, expected):
    """∫ds/√((s_end − s)/T) = 2√(T s_end), and the others have no value."""
    task = Slowing([0.0, 0.0], [1.0, 1.0], 1.0)
    task.power = power
    lost = measure(made(arm, task, s=0.0), made(arm, task, s=task.s_end), (0.0, 4.0), None)["time_lost_s"]
    assert_allclose(lost, expected * task.s_end**0.5, rtol=1e-6)


LOST = {"diverged_time": np.array([2.0]), "reason": np.array(["too fast"])}


@pytest.mark.parametrize("end", [len(TIME), 500])
def test_a_rollout_that_diverged_has_no_numbers(arm, end):
    """Also where all have, and the run ends before the time that counts."""
    lost = made(arm, outcome=LOST, time=TIME[:end])
    assert all(np.isnan(value).all() for value in measure(lost, made(arm), (1.0, 4.0), 2.0).values())


@pytest.mark.parametrize("end", [len(TIME), 500])
def test_beside_an_undisturbed_run_that_diverged_nothing_is_recovered_or_lost(arm, end):
    values = measure(made(arm, away=0.1), made(arm, outcome=LOST, time=TIME[:end]), (1.0, 4.0), 2.0)
    assert {name for name, value in values.items() if np.isnan(value).all()} == {"recovery_s", "time_lost_s"}


def test_an_arm_that_stands_still_is_never_the_best_of_a_comparison():
    arm = pc.load_robot("cicese_2dof")  # with dry friction, of which the laws know nothing
    circle, gains = pc.Circle(1.0, 0.3), {"K_p": 40.0, "K_v": 12.0, "k": 20.0}
    scenario = pc.Scenario("soft", "Soft gains.", arm, circle, [1.0, 0.0], duration=1.0, gains=gains)
    compared = pc.compare(["computed_torque", "projection"], scenario, rollouts=2, progress=False)
    assert compared.stuck == {"projection": 2}
    assert compared.mean("projection", "speed_peak") < compared.mean("computed_torque", "speed_peak")
    assert all(compared.best(name) == ["computed_torque"] for name in ("contour_peak", "speed_peak", "energy_j"))
    said = " ".join(describe_comparison(compared))
    assert "projection: 2 of 2 did not get along the path even undisturbed" in said
    assert 'friction="full"' in said
    assert "Motion control" not in said
    assert "*" not in "".join(row[1] + row[2] for row in tabulate(compared)[1:])
    assert compared.to_dict()["controllers"]["projection"]["stuck"] == 2
    assert repr(compared).startswith("Comparison(soft; rollout: 2; contour_peak [rad]: computed_torque ")
