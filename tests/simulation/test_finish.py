"""How open paths end and closed ones count laps: the last stretch of the plan, and when a run is finished."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import floats, gains, vectors

from pathcontrol import (
    ComputedTorque,
    ConstantRate,
    ContinuousTime,
    Coulomb,
    ExtendedMotionPlan,
    InputError,
    Line,
    PathTask,
    Projection,
    Run,
    SampledLoop,
    SpeedOverride,
    TaskError,
    UnknownNameError,
    VelocityProfile,
    Viscous,
    WaypointPath,
    metrics,
    simulate,
)
from pathcontrol.analysis.lyapunov_functions import projection_lyapunov
from pathcontrol.analysis.run_metrics import UNITS, end_error
from pathcontrol.control.ending import Ending

T = 0.1  # s, the time constant of the end
REMAINING, AT_REST = 1e-4, 1e-2  # rad, rad/s


@st.composite
def open_paths(draw: st.DrawFn, least: float = 0.8, most: float = 1.5) -> PathTask:
    """A line, or a curve through a few postures, of two joints."""
    speed, steps = draw(floats(least, most)), draw(st.lists(floats(-0.3, 0.3), min_size=3, max_size=3))
    if draw(st.booleans()):
        return Line([0.2, -0.3], [1.0, -0.2 + steps[0]], speed)
    return WaypointPath([[0.2, -0.3], [0.6, steps[0]], [1.0, 0.3 + steps[1]], [1.5, steps[2]]], speed)


class Slower(VelocityProfile):
    """A rate that falls towards s_end, as ``share`` of what it was at the start."""

    def __init__(self, rate: float, share: float, s_end: float) -> None:
        self.rate, self.slope = rate, rate * (share - 1) / s_end

    def theta(self, path, s):
        return self.rate + self.slope * np.asarray(s)

    def dtheta(self, path, s):
        return self.slope + np.zeros_like(s, dtype=float)


def laws(arm, task, k_p=800.0, K_v=100.0, k=20.0, **options):
    return {
        "tracking": ComputedTorque(arm, task, k_p, K_v, **options),
        "plan": ExtendedMotionPlan(arm, task, k_p, K_v, k, **options),
        "projection": Projection(arm, task, k_p, K_v, **options),
    }


def path_time(task: PathTask) -> float:
    """∫ds/ϑ [s]."""
    s = np.linspace(task.s0, task.s_end, 2001)
    return float(np.trapezoid(1 / (task.theta(s) + 0 * s), s))


# --- the last stretch of the plan -----------------------------------------------------------------------------------


@given(open_paths(), floats(0.05, 1.0), floats(0, 1))
def test_the_plan_comes_to_rest_at_the_end(path, share, u):
    task = path.with_profile(Slower(1.0, share, path.s_end))
    ending, rate = Ending.of(task), Slower(1.0, share, path.s_end)
    assert ending.braking == pytest.approx(T * rate.theta(path, path.s_end))
    assert ending.begin <= path.s_end - ending.braking
    s, h = path.s_end - u * ending.braking * 0.99 - 1e-6, 1e-7
    low, here, high = (ending.brake(task.at(np.array(x)), np.array(x)) for x in (s - h, s, s + h))
    left = path.s_end - s
    assert here.theta == pytest.approx(rate.theta(path, s) * left / ending.braking)
    assert (high.theta - low.theta) / (2 * h) == pytest.approx(here.dtheta, rel=1e-5, abs=1e-6)
    assert 0 < here.theta <= rate.theta(path, s)
    before, at_end = (np.array(x) for x in (path.s_end - ending.braking * 1.01, path.s_end))
    assert ending.brake(task.at(before), before).theta == rate.theta(path, before)
    assert ending.brake(task.at(at_end), at_end).theta == 0


@given(floats(0.5, 3.0), floats(0.3, 2.0))
@settings(max_examples=10)
def test_the_end_of_a_timed_plan_in_closed_form(ideal_arm, length, speed):
    """At a constant rate v the path takes (L − vT)/v + T ln(vT/r) until r is left."""
    task = Line([0.0, 0.0], [length, 0.0], speed)
    assume(length > 2 * speed * T)
    run = simulate(ComputedTorque(ideal_arm, task, 400.0, 40.0), task.start, duration=30.0, progress=False)
    exact = (length - speed * T) / speed + T * np.log(speed * T / REMAINING)
    arrival = run.time[np.argmax(run.array("s")[0] >= length - REMAINING)]
    assert arrival == pytest.approx(exact, abs=2 * 2.5e-3)
    # an arm on the plan moves with 1e-4/T by then: at rest
    assert run.finish_time[0] == pytest.approx(arrival)
    assert run.time[-1] == pytest.approx(arrival + 0.05)


@given(
    open_paths(), vectors(2, 0.5), vectors(2, 3.0), floats(0, 1), gains(2, 1, 900), gains(2, 0.5, 100), floats(0, 50)
)
def test_vdot_at_the_end_with_the_gain_of_the_plan(ideal_arm, task, e, qd, u, K_p, K_v, k):
    """V̇ = −e_vᵀK_p⁻¹K_v e_v − k(σ)(e_pᵀq_d')² before and after the plan stops listening, for both path laws."""
    for law in (ExtendedMotionPlan(ideal_arm, task, K_p, K_v, k), Projection(ideal_arm, task, K_p[0], K_v)):
        begin = law.ending.begin
        s = np.array(begin + (u - 0.5) * 2 * (task.s_end - begin))
        assume(isinstance(law, ExtendedMotionPlan) or s >= begin)
        q = task.q_d(s) - e
        out = law.law(0.0, q, qd, s[None])
        assert out.s == s
        point, stiffness = law.point(s), law.K_p if isinstance(law, ExtendedMotionPlan) else np.full(2, law.k_p)
        qdd = ideal_arm.forward_dynamics(q, qd, out.tau - ideal_arm.friction.viscous * qd)
        rate = e @ (point.dq_d * out.sdot - qd) + out.e_v / stiffness @ (point.velocity_slope * out.sdot - qdd)
        gain = law.plan_gain(s) if isinstance(law, ExtendedMotionPlan) else 0.0
        assert gain == (k if s < begin and isinstance(law, ExtendedMotionPlan) else 0.0)
        Vdot = -out.e_v @ (law.K_v / stiffness * out.e_v) - gain * (e @ point.dq_d) ** 2
        scale = 1 + np.abs(out.e_v / stiffness * qdd).sum() + np.abs(e).sum() * (np.abs(qd).sum() + abs(out.sdot))
        assert rate == pytest.approx(Vdot, abs=1e-7 * scale)
        assert Vdot <= 0


@given(open_paths(), vectors(2, 0.3), floats(0.01, 0.99))
def test_the_slope_of_the_plan_is_its_derivative(ideal_arm, task, e, u):
    """∂ṡ/∂s with the arm held still, before the last stretch and in it: what the sampled plan is advanced with."""
    for name, law in laws(ideal_arm, task).items():
        low = law.ending.begin if name == "projection" else task.s0
        s, h = low + u * (task.s_end - low), 1e-6
        assume(min(abs(s - law.ending.begin), abs(s - task.s_end + law.ending.braking)) > 2 * h)
        q = task.q_d(np.array(s)) - e
        behind, here, ahead = (law.law(0.0, q, np.zeros(2), np.array([x])) for x in (s - h, s, s + h))
        assert (ahead.sdot - behind.sdot) / (2 * h) == pytest.approx(here.slope, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("kind", ["plan", "projection"])
@given(open_paths())
@settings(max_examples=20)
def test_an_arm_on_the_plan_feels_nothing_but_the_braking(ideal_arm, kind, task):
    """Where the plan stops listening the torque changes by M q_d' ϑ ϑ' at most: nothing where ϑ' does not jump."""
    law = laws(ideal_arm, task)[kind]
    begin = law.ending.begin
    point = task.at(np.array(begin))
    sides = [np.array(begin + side * 1e-7) for side in (-1, 1)]
    before, after = (law.law(0.0, task.q_d(s), point.velocity, s[None]) for s in sides)
    assert np.allclose(before.s, sides[0], rtol=0, atol=1e-12)
    jump = law.point(sides[1]).dtheta - law.point(sides[0]).dtheta
    braking = ideal_arm.mass_matrix(point.q_d) @ point.dq_d * point.theta * jump
    assert np.allclose(after.tau - before.tau, braking, atol=1e-3)


@pytest.mark.parametrize("kind", ["plan", "projection"])
def test_v_falls_through_the_end(ideal_arm, kind):
    task = WaypointPath([[0.2, -0.3], [0.6, 0.2], [1.0, 0.1], [1.5, 0.4]], 1.5)
    law = laws(ideal_arm, task, 100.0, 15.0)[kind]
    loop = ContinuousTime(output_period=1e-2, rtol=1e-10, atol=1e-13)
    run = simulate(law, [0.1, -0.1], duration=9.0, loop=loop, progress=False)
    e_p, e_v = run.array("e_p")[0], run.array("e_v")[0]
    V = projection_lyapunov(Projection(ideal_arm, task, 100.0, 15.0), e_p, e_v).V  # of the other law 100 times its V
    assert run.status[0] == "finished"
    assert (np.diff(V) < 1e-12).all()
    assert V[run.array("s")[0] > law.ending.begin].size > 50


# --- finished -------------------------------------------------------------------------------------------------------


@given(open_paths(), floats(0, 1.2), floats(500, 1500), floats(80, 120), floats(0, 30), st.integers(0, 999))
@settings(max_examples=8)
def test_every_open_path_is_finished_within_what_friction_holds(arm, path, dry, k_p, K_v, k, seed):
    """Dry friction of level F slows a path law by ‖M⁻¹F‖/K_v at most, and leaves |e_i| ≤ Σ_j |M⁻¹_ij| F_j/k_p."""
    rough = arm.with_friction(Viscous(arm.friction.viscous) + Coulomb(dry * np.array([7.6, 1.7])))
    s = np.linspace(path.s0, path.s_end, 30)
    compliance = np.abs(np.linalg.inv(rough.mass_matrix(path.q_d(s)))) @ (dry * np.array([7.6, 1.7]))
    slowdown = 1 - np.linalg.norm(compliance, axis=-1).max() / K_v / path.speed
    assume(slowdown > 0.5)
    longest = path_time(path) / slowdown + T * np.log(path.speed * T / REMAINING) + 10 * K_v / k_p
    start = path.q_d(np.array(path.s0)) + 0.1 * np.random.default_rng(seed).normal(size=(2, 2))
    for law in laws(rough, path, k_p, K_v, k).values():
        run = simulate(law, start, duration=longest, loop=SampledLoop(torque_limits=True), progress=False)
        assert (run.status == "finished").all(), (type(law).__name__, longest)
        left = np.linalg.norm(path.dq_d(np.array(path.s_end))) * (path.s_end - run.array("s")[:, -1])
        assert (np.linalg.norm(run.array("qd")[:, -1], axis=-1) <= AT_REST).all()
        assert (left <= REMAINING).all()
        # what moves still: 1e-4 of path, e_v of two speeds at rest, and what changes AT_REST within the rest of 50 ms
        moving = REMAINING + (K_v * (AT_REST + REMAINING / T) + 2 * AT_REST / 0.05) / k_p
        error = np.abs(path.q_d(np.array(path.s_end)) - run.array("q")[:, -1])
        held = np.abs(np.linalg.inv(rough.mass_matrix(run.array("q")[:, -1]))) @ (dry * np.array([7.6, 1.7])) / k_p
        assert (error <= held + moving).all()


@pytest.mark.parametrize(
    ("kind", "loop"),
    [
        ("tracking", SampledLoop(torque_limits=True)),
        ("plan", ContinuousTime(output_period=0.01, rtol=1e-6, atol=1e-8)),
        ("projection", SampledLoop(torque_limits=True)),
    ],
)
def test_the_bundled_arm_finishes_with_its_own_friction(arm, kind, loop):
    task = Line([0.2, -0.3], [0.9, 0.6], 1.0)
    law = laws(arm, task, 800.0, [45.0, 100.0])[kind]
    run = simulate(law, [0.1, -0.2], duration=4.0, until="duration", loop=loop, progress=False)
    assert run.status[0] == "finished"
    after = run.time >= run.finish_time[0]
    assert (np.linalg.norm(run.array("qd")[0, after], axis=-1) <= AT_REST).all()
    if isinstance(loop, SampledLoop):  # smoothed friction lets the arm creep on
        assert np.ptp(run.array("q")[0, after], axis=0).max() < 1e-3  # held there
    assert np.abs(np.diff(run.array("tau")[0, after], axis=0)).max() < 0.1  # and no chatter
    full = simulate(laws(arm, task, friction="full")[kind], [0.1, -0.2], duration=4.0, progress=False)
    assert end_error(full, task)[0] < 2e-4
    assert end_error(run, task)[0] < 0.03


@pytest.mark.parametrize("kind", ["plan", "projection"])
def test_the_torque_steps_at_the_handover_by_no_more_than_the_braking(arm, kind):
    task = WaypointPath([[0.2, -0.3], [0.6, 0.2], [1.0, 0.1], [1.5, 0.4]], 1.0)
    law = laws(arm, task, 800.0, [45.0, 100.0])[kind]
    run = simulate(law, task.points[0], duration=6.0, progress=False)
    tau, s = run.array("tau")[0], run.array("s")[0]
    at = int(np.argmax(s >= law.ending.begin))
    assert run.array("qd")[0, at - 20 : at].any(-1).all()  # a moving arm
    steps = np.abs(np.diff(tau, axis=0))
    point = task.at(np.array(s[at]))
    braking = np.abs(arm.mass_matrix(run.array("q")[0, at]) @ point.dq_d) * point.theta**2 / law.ending.braking
    assert (steps[at - 1 : at + 1] <= braking + 2 * steps[at - 20 : at - 1].max(0) + 0.5).all()


def test_the_turning_point_of_an_oscillation_is_no_end(ideal_arm):
    task = Line([0.2, -0.3], [0.9, 0.6], 1.0)
    law = ComputedTorque(ideal_arm, task, 200.0, 2.0)
    run = simulate(law, [0.4, -0.3], duration=15.0, until="duration", progress=False)
    swinging = np.linalg.norm(run.array("qd")[0], axis=-1)
    at_end = run.array("s")[0] >= task.s_end - REMAINING
    first = run.time[np.argmax(at_end & (swinging <= AT_REST))]
    assert run.finish_time[0] > first  # which was a turning point
    assert (swinging[run.time >= run.finish_time[0]] < 2 * AT_REST).all()


def test_finished_rollouts_are_held_while_others_go_on(arm):
    task = Line([0.2, -0.3], [0.9, 0.6], 1.0)
    starts = task.q_d(task.s_end * np.array([0.0, 0.2, 0.5, 0.8]))
    law = ExtendedMotionPlan(arm, task, 800.0, [45.0, 100.0], 20.0)
    together = simulate(law, starts, duration=6.0, progress=False)
    assert (np.diff(together.finish_time) < 0).all()
    assert together.time[-1] == pytest.approx(together.finish_time.max() + 0.05)
    for i, start in enumerate(starts):
        alone = simulate(law, start, duration=6.0, progress=False)
        assert alone.finish_time[0] == together.finish_time[i]
        assert np.array_equal(alone.array("q")[0], together.array("q")[i, : len(alone.time)])
        held = together.array("q")[i, together.time >= together.finish_time[i]]
        assert np.ptp(held, axis=0).max() < 1e-3


@pytest.mark.parametrize("loop", [SampledLoop(), ContinuousTime(output_period=0.01, rtol=1e-6, atol=1e-8)])
@pytest.mark.parametrize("closed", [False, True])
def test_a_run_that_ends_is_the_beginning_of_one_that_does_not(ideal_arm, circle, closed, loop):
    task = circle.with_profile(ConstantRate(6.0)) if closed else Line([0.2, -0.3], [0.9, 0.6], 1.0)
    law, laps = ExtendedMotionPlan(ideal_arm, task, 400.0, 40.0, 20.0), 1 if closed else None
    options = {"duration": 2.3, "laps": laps, "loop": loop, "progress": False}
    ended, whole = (simulate(law, [0.2, -0.3], until=until, **options) for until in ("end", "duration"))
    assert ended.time[-1] < whole.time[-1] == pytest.approx(2.3)
    assert ended.finish_time[0] == whole.finish_time[0]
    for name in ended.data.data_vars:
        assert np.array_equal(ended.array(name), whole.array(name)[:, : len(ended.time)]), name


def test_a_slow_start_needs_dry_friction_compensated_at_rest(arm):
    """Where r is so small that M K_v r does not break the friction, only its compensation lets the arm go."""
    task = Line([0.2, -0.3], [0.9, 0.6], 1.0)

    class Rising(VelocityProfile):
        def theta(self, path, s):
            return np.sqrt(0.02**2 + 2.0 * np.minimum(np.asarray(s), path.s_end - np.asarray(s)))

        def dtheta(self, path, s):
            return np.where(np.asarray(s) < path.s_end / 2, 1.0, -1.0) / self.theta(path, s)

    slow = task.with_profile(Rising())
    stuck, free = (
        simulate(Projection(arm, slow, 800.0, [45.0, 100.0], friction=f), task.start, duration=4.0, progress=False)
        for f in ("viscous", "full")
    )
    assert not stuck.array("qd").any()
    assert stuck.status[0] == "running"
    assert free.status[0] == "finished"
    law = Projection(arm, slow, 800.0, [45.0, 100.0], friction="full")
    plus, minus = arm.friction.levels(np.zeros(2))
    assert np.array_equal(law.friction_torque(np.zeros(2), np.array([1.0, -1.0])), [plus[0], -minus[1]])
    moving = np.array([0.3, -0.2])
    assert np.array_equal(law.friction_torque(moving, -moving), arm.friction.torque(moving))
    assert not np.any(law.friction_torque(np.zeros(2)))


# --- what a run says about it ---------------------------------------------------------------------------------------


def test_how_it_went_is_part_of_the_run(ideal_arm, circle, tmp_path):
    line = Line([0.2, -0.3], [0.9, 0.6], 1.0)
    law = Projection(ideal_arm, line, 400.0, 40.0)
    ended = simulate(law, [line.end, line.start], duration=1.0, progress=False)
    assert list(ended.status) == ["finished", "running"]
    assert repr(ended).endswith("1 of 2 finished)")
    assert ended.config["duration"] == 1.0
    assert ended["finish_time"].attrs["units"] == "s"
    rounds = simulate(Projection(ideal_arm, circle, 400.0, 40.0), [1.0, 0.0], laps=1, duration=9.0, progress=False)
    assert repr(rounds).endswith(f"; finished after {rounds.finish_time[0]:.4g} s)")
    for run in (ended, rounds):
        again = Run.load(run.save(tmp_path / "run.nc"))
        assert again.data.identical(run.data)
        assert list(again.status) == list(run.status)
        assert np.array_equal(again.finish_time, run.finish_time, equal_nan=True)
    assert Run.load(tmp_path / "run.nc").laps[0] == 1
    assert list(ended.rollout(1).status) == ["running"]


def test_metrics_of_an_open_path(arm, circle):
    line = Line([0.2, -0.3], [0.9, 0.6], 1.0)
    law = Projection(arm, line, 800.0, [45.0, 100.0])
    run = simulate(law, [line.end - 0.1, line.start], duration=1.0, progress=False)
    values = metrics(run, line)
    assert {"path_time", "end_error"} < set(values) <= set(UNITS)
    assert values["path_time"][0] == run.finish_time[0]
    at = int(np.searchsorted(run.time, run.finish_time[0]))
    assert values["end_error"][0] == pytest.approx(np.linalg.norm(line.end - run.array("q")[0, at]))
    assert np.isnan([values["path_time"][1], values["end_error"][1]]).all()
    with pytest.raises(TaskError, match="Circle has no end"):
        end_error(run, circle)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"laps": 1}, InputError, ["laps = 1", "Line", "no closed path"]),
        ({"laps": 0, "closed": True}, InputError, ["laps = 0", "whole number from 1"]),
        ({"laps": 1.5, "closed": True}, InputError, ["laps = 1.5", "whole number"]),
        ({"laps": True, "closed": True}, InputError, ["laps = True"]),
        ({"until": "finish"}, UnknownNameError, ["until = 'finish'", "'end', 'duration'"]),
    ],
)
def test_bad_ends(arm, circle, options, error, words):
    task = circle if options.pop("closed", False) else Line([0.2, -0.3], [0.9, 0.6], 1.0)
    with pytest.raises(error) as raised:
        simulate(Projection(arm, task, 100.0, 20.0), [0.0, 0.0], duration=1.0, **options)
    assert all(word in str(raised.value) for word in words), str(raised.value)


@pytest.mark.parametrize("engine", ["pinocchio", "compiled"])
def test_a_rest_at_the_end_that_is_too_short_does_not_count_when_the_arm_comes_back(arm, engine):
    """The arm is at the end for less than 50 ms, goes back, and returns a second later."""
    law = ComputedTorque(arm.with_friction(None), Line([0.9, 0.1], [0.5, 0.6], speed=1.0), 800.0, 60.0)
    there_and_back = SpeedOverride(law, [[1.1125, -1.0], [1.3125, 1.0]], acceleration=10.0)
    run = simulate(there_and_back, [0.9, 0.1], duration=5.0, engine=engine, progress=False)
    assert run.finish_time[0] > 1.3125  # when it is let go forward again
