"""The balance of V̇: an identity, each share alone in closed form, orders of what is numerical, logs like their runs."""

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.analysis.power.power_balance import SHARES
from pathcontrol.analysis.power.power_balance_table import power_balance_table, relative_rates
from pathcontrol.errors import InputError

FULL = pc.load_robot("cicese_2dof")
FREE = FULL.with_friction(None)
CIRCLE = pc.Circle(1.0, 2.0)
START = np.array([0.7, 1.2])
LAWS = {
    "plan": lambda arm, **o: pc.ExtendedMotionPlan(arm, CIRCLE, [400.0, 500.0], [30.0, 40.0], k=20.0, **o),
    "projection": lambda arm, **o: pc.Projection(arm, CIRCLE, 400.0, [30.0, 40.0], **o),
    "maneuver": lambda arm, **o: pc.ManeuverRegulation(arm, CIRCLE, [400.0, 500.0], [30.0, 40.0], **o),
    "computed torque": lambda arm, **o: pc.ComputedTorque(arm, CIRCLE, [400.0, 500.0], [30.0, 40.0], **o),
    "pd": lambda arm, **o: pc.PDPlus(arm, CIRCLE, [400.0, 60.0], [45.0, 4.0], **o),
    "sliding": lambda arm, **o: pc.SlotineLi(arm, CIRCLE, [10.0, 12.0], [45.0, 4.0], **o),
}
EVERY = pytest.mark.parametrize("name", LAWS)


def run_of(law, duration=0.2, loop=None, **options):
    loop = pc.SampledLoop(period=1e-3) if loop is None else loop
    return pc.simulate(law, START, duration=duration, loop=loop, progress=False, **options)


def pull(name, run, law, arm):
    """−∂V/∂q̇ through M⁻¹ at each sample of a run with exact sensors, from the definition of V."""
    e_p, e_v, q = run.array("e_p")[0], run.array("e_v")[0], run.array("q")[0]
    if name == "pd":
        return (
            e_v
            if arm is law.robot
            else np.linalg.solve(arm.mass_matrix(q), law.robot.momentum(q, e_v)[..., None])[..., 0]
        )
    if name == "sliding":
        return e_v + law.Lambda * e_p
    if name == "maneuver":
        weighed = 2 * law.metric.apply(e_p, e_v)[1]
        return np.linalg.solve(arm.mass_matrix(q), weighed[..., None])[..., 0]
    weight = {"projection": 1.0}.get(name, 1 / np.asarray(getattr(law, "K_p", 1.0)))
    return np.linalg.solve(arm.mass_matrix(q), (weight * e_v)[..., None])[..., 0]


def between(values):
    return 0.5 * (values[1:] + values[:-1])


def only(balance, *names):
    return all(not balance.shares[name].any() for name in SHARES if name not in names)


# --- the identity ---------------------------------------------------------------------------------------------------


@EVERY
def test_the_rates_sum_up_and_v_is_that_of_lyapunov(name):
    law = LAWS[name](FULL)
    real = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True, delay=1e-3)
    heavier = FULL.with_payload(0.5, "tool")
    balance = pc.power_balance(run_of(law, loop=real, plant=heavier, disturbance=pc.Push([5.0, 2.0], 0.1, 0.05)))
    total = balance.predicted + sum(balance.shares.values()) + balance.residual
    np.testing.assert_allclose(total, balance.measured, rtol=1e-9, atol=1e-9 * np.abs(balance.measured).max())
    assert all(np.abs(share).max() > 0 for share in balance.shares.values())
    # the integral of the measured rate is the change of V, to rounding
    change = balance.measured @ np.diff(balance.time)
    np.testing.assert_allclose(change, balance.V[:, -1] - balance.V[:, 0], rtol=1e-9)
    if name in ("plan", "projection"):
        exact = run_of(law)
        V, Vdot = pc.lyapunov(law, exact)
        found = pc.power_balance(exact, law)
        np.testing.assert_allclose(found.V, V, rtol=1e-9)
        np.testing.assert_allclose(found.predicted[0], between(Vdot[0]), rtol=1e-9)


@EVERY
def test_sampling_is_of_first_order_and_the_residual_of_second(name):
    found = []
    for period in (2e-3, 1e-3):
        balance = pc.power_balance(run_of(LAWS[name](FREE), loop=pc.SampledLoop(period=period)))
        assert only(balance, "sampling")
        found.append([np.abs(rate).mean() for rate in (balance.sampling, balance.residual)])
    order = np.log2(np.divide(*found))
    assert order[0] == pytest.approx(1.0, abs=0.15)
    assert order[1] == pytest.approx(2.0, abs=0.3)
    assert found[1][1] < 0.2 * found[1][0]


@EVERY
def test_in_continuous_time_nothing_parts_them(name):
    found = []
    for period in (2e-3, 1e-3):
        balance = pc.power_balance(run_of(LAWS[name](FREE), 0.1, loop=pc.ContinuousTime(output_period=period)))
        for share in balance.shares.values():
            assert np.abs(share).max() < 1e-12 * np.abs(balance.measured).max()
        found.append(np.abs(balance.residual).mean())
    assert np.log2(found[0] / found[1]) == pytest.approx(2.0, abs=0.3)


# --- each share alone -----------------------------------------------------------------------------------------------


@EVERY
def test_only_friction(name):
    """The share of friction is velocity error times friction torque: as it stands for PD+, else through M⁻¹."""
    arm = FULL.with_friction(pc.Viscous([2.0, 0.4]))
    law = LAWS[name](arm, friction="none")
    run = run_of(law, loop=pc.ContinuousTime(output_period=1e-3))
    balance = pc.power_balance(run)
    closed = (pull(name, run, law, arm) * (np.array([2.0, 0.4]) * run.array("qd")[0])).sum(-1)
    np.testing.assert_allclose(balance.friction[0], between(closed), rtol=1e-9, atol=1e-12)
    others = [share for name, share in balance.shares.items() if name != "friction"]
    assert max(np.abs(share).max() for share in others) < 1e-9 * np.abs(balance.friction).max()


def test_compensated_friction_has_no_share():
    arm = FULL.with_friction(pc.Viscous([2.0, 0.4]))
    assert np.abs(pc.power_balance(run_of(LAWS["projection"](arm))).friction).max() < 1e-12


def test_an_observer_takes_over_what_friction_would_supply():
    late = [
        np.abs(pc.power_balance(run_of(LAWS["projection"](FULL, friction=f), 0.6)).means(begin=0.3)["friction"][0])
        for f in ("none", "observed")
    ]
    assert late[1] < 0.1 * late[0]


@EVERY
def test_only_saturation(name):
    law = LAWS[name](FREE)
    run = run_of(law, loop=pc.SampledLoop(period=1e-3, torque_limits=[40.0, 3.0]))
    balance = pc.power_balance(run)
    assert only(balance, "saturation", "sampling")
    lost = (run.array("tau_demand") - run.array("tau"))[0, :-1]
    closed = (between(pull(name, run, law, FREE)) * lost).sum(-1)
    assert np.abs(lost).max() > 1.0
    np.testing.assert_allclose(balance.saturation[0], closed, rtol=1e-6, atol=1e-9 * np.abs(closed).max())


@EVERY
def test_only_a_payload(name):
    """The share of the model is that of ΔM q̈* + Δ(Cq̇ + g), from the matrices of both arms."""
    law, heavy = LAWS[name](FREE), FREE.with_payload(1.0, "tool")
    run = run_of(law, loop=pc.ContinuousTime(output_period=1e-3), plant=heavy)
    balance = pc.power_balance(run)
    assert np.abs(balance.model).max() > 1e3 * np.abs(balance.sampling).max()
    if name in ("pd", "sliding"):
        return  # the acceleration of their theorem is not in the record
    q, qd, e_p, e_v, s = (run.array(part)[0] for part in ("q", "qd", "e_p", "e_v", "s"))
    point, sdot = CIRCLE.at(s), run.array("sdot")[0][:, None]
    K_p = law.k_p if name == "projection" else law.K_p
    sdot = point.theta[:, None] if name == "maneuver" else sdot
    acceleration = point.velocity_slope * sdot + law.K_v * e_v + K_p * e_p
    matrices = heavy.mass_matrix(q) - FREE.mass_matrix(q), heavy.coriolis_matrix(q, qd) - FREE.coriolis_matrix(q, qd)
    more = sum((m @ v[..., None])[..., 0] for m, v in zip(matrices, (acceleration, qd), strict=True))
    more = more + heavy.gravity(q) - FREE.gravity(q)
    closed = (pull(name, run, law, heavy) * more).sum(-1)
    np.testing.assert_allclose(balance.model[0], between(closed), rtol=1e-5, atol=1e-6 * np.abs(closed).max())


@EVERY
def test_only_a_push(name):
    """The share of a disturbance d is −y·d, with an error of second order in the period."""
    law, push = LAWS[name](FREE), np.array([20.0, 5.0])
    run = run_of(law, disturbance=pc.Push(push, start=0.1, duration=0.05))
    balance = pc.power_balance(run)
    pushed = (balance.middle > 0.1) & (balance.middle < 0.15)
    closed = -between(pull(name, run, law, FREE)) @ push
    scale = np.abs(closed[pushed]).max()
    np.testing.assert_allclose(balance.disturbance[0, pushed], closed[pushed], atol=2e-2 * scale)
    # what is numerical of it falls with the state, and is of second order
    assert np.abs(balance.disturbance[0, balance.middle > 0.16]).max() < 2e-2 * scale
    assert only(balance, "disturbance", "sampling")


def test_dry_friction_that_holds_explains_a_rest():
    """Dry friction holds an arm: V does not change, and friction supplies what the theorem takes."""
    arm = FULL.with_friction(pc.Coulomb([500.0, 500.0]))
    run = pc.simulate(LAWS["projection"](arm), START, duration=0.05, progress=False)
    balance = pc.power_balance(run)
    assert np.abs(balance.measured).max() < 1e-9
    np.testing.assert_allclose(balance.friction + balance.sampling, -balance.predicted, rtol=1e-6)


def test_seven_joints_and_a_payload():
    """An arm of 7 joints with a payload that its law does not know: the model supplies what is predicted to go."""
    pytest.importorskip("example_robot_data")
    arm = pc.load_robot("panda", keep=[f"panda_joint{i}" for i in range(1, 8)]).with_friction(None)
    center = [0.0, -0.3, 0.0, -1.8, 0.0, 1.8, 0.0]
    path = pc.Lissajous(np.full(7, 0.2), [1, 2, 1, 2, 1, 2, 1], speed=0.5, center=center)
    law, start = pc.ExtendedMotionPlan(arm, path, 400.0, 40.0, k=5.0), path.q_d(np.array(0.0))
    run = pc.simulate(law, start, duration=0.6, plant=arm.with_payload(1.0, "panda_hand"), progress=False)
    balance = pc.power_balance(run)
    late = {name: rate[0] for name, rate in balance.means(begin=0.4).items()}
    assert only(balance, "model", "sampling")
    assert late["model"] + late["sampling"] + late["predicted"] == pytest.approx(late["measured"], rel=1e-3)
    assert late["model"] > 20 * abs(late["sampling"])


# --- any run --------------------------------------------------------------------------------------------------------


@EVERY
def test_a_log_equals_the_run_it_came_from(name):
    law = LAWS[name](FULL)
    run = run_of(law, loop=pc.SampledLoop(period=2e-3, torque_limits=True))
    log = pc.Run.from_log(run.time, *(run.array(part)[0] for part in ("q", "qd", "tau")), robot=FULL, task=CIRCLE)
    here, there = pc.power_balance(run), pc.power_balance(log, law)
    scale = np.abs(here.measured).max()
    for part in ("V", "predicted", "measured", "friction", "saturation", "sampling", "model"):
        np.testing.assert_allclose(getattr(there, part), getattr(here, part), rtol=1e-6, atol=1e-8 * scale)
    # what the motion of a log does not explain is called a disturbance: here the numerical part of the residual
    np.testing.assert_allclose(there.disturbance + there.residual, here.residual, atol=1e-8 * scale)
    assert np.abs(there.saturation).max() > 0


def test_a_run_without_its_demands_is_limited_as_each_rollout_was():
    law, drop = LAWS["projection"](FULL), pc.TorqueLimitDrop([[0.05, 0.1], [1.0, 0.05]], start=0.1, duration=0.1)
    run = run_of(law, loop=pc.SampledLoop(period=2e-3, torque_limits=True), disturbance=drop)
    arrays = {name: run.array(name) for name in run.data.data_vars if name != "tau_demand"}
    joints = dict.fromkeys(FULL.joint_names, "rad")
    log = pc.Run.from_arrays(run.time, joints, arrays, run.config, {}, robot=FULL, task=CIRCLE)
    here, there = pc.power_balance(run), pc.power_balance(log, law)
    np.testing.assert_allclose(there.saturation, here.saturation, rtol=1e-6, atol=1e-9)
    assert (np.abs(here.saturation).max(-1) > 0.1).all()


@pytest.mark.parametrize("suffix", ["nc", "mcap"])
def test_a_loaded_run_knows_its_law(suffix, tmp_path):
    if suffix == "mcap":
        pytest.importorskip("mcap")
    run = run_of(pc.SpeedOverride(LAWS["projection"](FULL, branch="nearest"), 0.5), loop=pc.SampledLoop(encoders=True))
    loaded = pc.Run.load(run.save(tmp_path / f"run.{suffix}"))
    here, there = pc.power_balance(run), pc.power_balance(loaded)
    for part in ("V", "measured", *SHARES):
        np.testing.assert_allclose(getattr(there, part), getattr(here, part), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["plan", "projection"])
def test_a_speed_override_changes_nothing(name):
    law = pc.SpeedOverride(LAWS[name](FREE), [[0.0, 1.0], [0.1, 0.3], [0.2, -0.5]])
    balance = pc.power_balance(run_of(law, 0.4))
    assert only(balance, "sampling")
    assert np.abs(balance.residual).max() < 5e-3 * np.abs(balance.measured).max()


@pytest.mark.parametrize("name", ["plan", "projection"])
def test_the_end_of_an_open_path(name):
    law = LAWS[name](FREE)
    law = type(law)(FREE, pc.Line([0.7, 0.4], [0.8, 0.5], 0.5), **{g: getattr(law, g) for g in law.gains})
    run = pc.simulate(law, [0.72, 0.38], duration=1.5, until="duration", progress=False)
    balance = pc.power_balance(run)
    assert only(balance, "sampling")
    assert np.isfinite(balance.measured).all()
    assert np.abs(balance.residual).max() < 2e-2 * np.abs(balance.measured).max()


def test_rollouts_are_what_they_are_alone():
    K_p = np.array([[400.0, 500.0], [300.0, 200.0]])
    arms = [FREE, FREE.with_payload(1.0, "tool")]
    law = pc.ExtendedMotionPlan(FREE, CIRCLE, K_p, 30.0, k=[20.0, 5.0])
    run = pc.simulate(law, [START, START], duration=0.1, plant=arms, progress=False)
    together = pc.power_balance(run)
    for i in range(2):
        one = pc.ExtendedMotionPlan(FREE, CIRCLE, K_p[i], 30.0, k=[20.0, 5.0][i])
        alone = pc.power_balance(run.rollout(i), one)
        for part in ("V", "measured", "predicted", *SHARES):
            np.testing.assert_allclose(getattr(together, part)[i], getattr(alone, part)[0], rtol=1e-9, atol=1e-12)


def test_friction_with_a_row_for_each_rollout_is_that_of_each():
    rows = np.array([[1.0, 0.2], [4.0, 0.8], [2.0, 0.1]])
    law = LAWS["pd"](FREE)
    run = pc.simulate(law, START, duration=0.05, plant=FREE.with_friction(pc.Viscous(rows)), progress=False)
    together, seen = (
        pc.power_balance(run),
        pc.momentum_observer(run, FREE.with_friction(pc.Viscous(rows)), friction="full"),
    )
    for i, row in enumerate(rows):
        alone = pc.simulate(law, START, duration=0.05, plant=FREE.with_friction(pc.Viscous(row)), progress=False)
        np.testing.assert_allclose(together.friction[i], pc.power_balance(alone).friction[0], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(run.rollout(i).robot.friction.viscous, row)
        np.testing.assert_allclose(seen[i], pc.momentum_observer(alone, alone.robot, friction="full")[0], atol=1e-9)


def test_a_rollout_that_diverges_has_a_balance_until_then():
    run = pc.simulate(LAWS["pd"](FREE), [START, [0.9, 1.0]], qd=[[0.0, 0.0], [1e6, 0.0]], duration=0.02, progress=False)
    assert list(run.status) == ["running", "diverged"]
    balance = pc.power_balance(run)
    assert np.isfinite(balance.measured[0]).all()
    assert np.isnan(balance.measured[1][-1])
    assert np.isfinite(balance.means()["measured"][0])


# --- for readers ----------------------------------------------------------------------------------------------------


def test_means_tables_and_json():
    balance = pc.power_balance(run_of(LAWS["projection"](FULL)))
    whole = balance.means()
    assert whole["measured"][0] == pytest.approx((balance.V[0, -1] - balance.V[0, 0]) / balance.time[-1])
    said = balance.to_dict()
    assert said["whole"]["friction"] == [pytest.approx(whole["friction"][0])]
    assert said["rate_unit"] == "rad^2/s^3"
    times, rates = relative_rates(balance, windows=10)
    assert len(times) == 10
    np.testing.assert_allclose(rates["predicted"] + sum(rates[n] for n in (*SHARES, "residual")), rates["measured"])
    with pytest.raises(InputError, match="no sample"):
        balance.means(begin=99.0)
    assert power_balance_table(run_of(LAWS["pd"](FULL)))[2][1].endswith("W")


def test_the_log_of_a_control_loop():
    """A loop that drives a simulated arm writes a log, of which the balance leaves no more than of a simulation."""
    law, arm = LAWS["plan"](FULL), pc.Plant(FULL, 2.5e-3)
    loop = pc.ControlLoop(law, 2.5e-3)
    q, qd = np.array([[1.0, 0.0]]), np.array([[0.0, 2.0]])
    loop.start(q[0], qd[0])
    with loop.record() as log:
        for k in range(80):
            q, qd = arm.advance(q, qd, loop.step(q[0], qd[0], k * 2.5e-3)[None])
    means = pc.power_balance(log.run()).means()
    assert abs(means["residual"][0]) + abs(means["disturbance"][0]) < 1e-2 * means["friction"][0]
    assert means["friction"][0] > 0


def test_what_has_no_balance_says_why():
    run = run_of(LAWS["projection"](FULL), 0.01)
    log = pc.Run.from_log(run.time, run.array("q")[0], run.array("qd")[0], robot=FULL, task=CIRCLE)
    with pytest.raises(InputError, match="no tau"):
        pc.power_balance(log, LAWS["projection"](FULL))
    log = pc.Run.from_log(run.time, *(run.array(part)[0] for part in ("q", "qd", "tau")), robot=FULL, task=CIRCLE)
    with pytest.raises(InputError, match="controller="):
        pc.power_balance(log)
    assert power_balance_table(log) == []
    with pytest.raises(InputError, match=r"run\.path"):
        pc.power_balance(pc.simulate_sequence([LAWS["projection"](FREE)], START, duration=0.02, laps=1, progress=False))
