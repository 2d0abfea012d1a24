"""The sampled loop part by part, the paper's peaks converged in the step, and how fast Γ is reached."""

from __future__ import annotations

import numpy as np
import pytest

from pathcontrol import (
    Circle,
    ComputedTorque,
    ContinuousTime,
    ExtendedMotionPlan,
    InputError,
    Line,
    Lissajous,
    PathTask,
    Projection,
    SampledLoop,
    SimulationError,
    distance_to_gamma,
    load_robot,
    simulate,
)
from pathcontrol.comparison.paper import paper_controllers
from pathcontrol.simulation.arm.sensors import Sensors
from pathcontrol.simulation.sampled import split_delay

START = np.deg2rad([40.0, 70.0])


def paper_law(arm, circle, **options):
    return ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0, **options)


# --- accuracy -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["extended_motion_plan", "projection"])
def test_one_step_per_tick_gives_the_converged_peaks(arm, name):
    law = paper_controllers(arm)[name]
    peaks = []
    for substeps in (1, 8):
        loop = SampledLoop(torque_limits=True, substeps=substeps)
        run = simulate(law, START, duration=10.0, loop=loop, progress=False)
        late = run.time >= 5
        peaks.append([run.norm(error)[0, late].max() for error in ("e_p", "e_v")])
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-3)


@pytest.mark.parametrize(("kind", "clockwise"), [(ExtendedMotionPlan, False), (Projection, True)])
def test_gamma_is_reached_exponentially_from_anywhere(ideal_arm, kind, clockwise):
    """50 random states; without Coulomb friction the distance falls like e^{−αt}."""
    rng = np.random.default_rng(7)
    task = Circle(1.0, 2.0, clockwise=clockwise)
    angle, radius = rng.uniform(-np.pi, np.pi, 50), rng.uniform(0.4, 2.0, 50)
    q = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    qd = rng.uniform(-3, 3, (50, 2))
    gain = {"k": 20.0} if kind is ExtendedMotionPlan else {}
    law = kind(ideal_arm, task, 800.0, [45.0, 100.0], **gain)
    loop = ContinuousTime(output_period=0.05, rtol=1e-11, atol=1e-13)
    run = simulate(law, q, qd, duration=2.0, loop=loop, progress=False)
    distance = distance_to_gamma(task, run.array("q"), run.array("qd"))
    assert (distance[:, -1] < 1e-5 * distance[:, 0]).all()
    # the slowest pole of s² + 100 s + 800, joint 2 alone, is −8.8; every log distance falls at half that or faster
    steady = (run.time >= 0.5) & (run.time <= 1.5)
    slopes = np.polyfit(run.time[steady], np.log(distance[:, steady]).T, 1)[0]
    assert (slopes < -4.4).all()


def test_rollouts_do_not_know_of_each_other(arm, circle):
    rng = np.random.default_rng(3)
    q = rng.normal(size=(5, 2))
    loop = SampledLoop(encoders=True, velocity="difference", torque_limits=True)
    law = paper_law(arm, circle)
    together = simulate(law, q, duration=0.5, loop=loop, progress=False)
    for i in range(5):
        alone = simulate(law, q[i], duration=0.5, loop=loop, progress=False)
        for name in together.data.data_vars:
            assert np.array_equal(alone.array(name)[0], together.array(name)[i]), name


# --- the parts of the loop ----------------------------------------------------------------------------------------


def test_torques_stay_within_their_limits(arm, circle):
    law = paper_law(arm, circle)
    free = simulate(law, START, duration=0.3, progress=False)
    for limits in (True, [100.0, 9.0]):
        run = simulate(law, START, duration=0.3, loop=SampledLoop(torque_limits=limits), progress=False)
        bound = arm.limits.effort if limits is True else np.array(limits)
        assert (np.abs(run.array("tau")) <= bound).all()
        assert (np.abs(run.array("tau")).max((0, 1)) == bound).all()
        assert (np.abs(run.array("tau_demand")) > bound).any()
    assert np.array_equal(free.array("tau"), free.array("tau_demand"))


def test_encoders_read_whole_counts(arm, circle):
    counts = np.array([1000.0, 360.0])
    run = simulate(paper_law(arm, circle), START, duration=0.3, loop=SampledLoop(encoders=counts), progress=False)
    resolution = 2 * np.pi / counts
    read = run.array("q_measured") / resolution
    assert np.allclose(read, np.round(read), atol=1e-9)
    assert (np.abs(run.array("q_measured") - run.array("q")) <= resolution / 2 * (1 + 1e-9)).all()


def test_velocity_by_differentiation(arm, circle):
    loop = SampledLoop(velocity="difference")
    run = simulate(paper_law(arm, circle), START, [0.5, -0.2], duration=0.3, loop=loop, progress=False)
    q, measured = run.array("q")[0], run.array("qd_measured")[0]
    assert np.allclose(measured[1:], np.diff(q, axis=0) / loop.period, rtol=1e-9, atol=1e-12)
    assert np.allclose(measured[0], [0.5, -0.2])


def test_the_velocity_filter_is_a_first_order_lag():
    """A step of velocity comes through as 1 − e^{−ωt}, at any sampling period."""
    for period in (1e-3, 1e-2):
        sensors = Sensors(period, None, False, 5.0)
        reading = sensors.start(np.zeros((1, 1)), np.zeros((1, 1)))
        for tick in range(1, 30):
            reading = sensors.read(np.zeros((1, 1)), np.ones((1, 1)), reading)
            assert reading.qd[0, 0] == pytest.approx(1 - np.exp(-2 * np.pi * 5.0 * tick * period))


@pytest.mark.parametrize("delay", [1e-3, 2.5e-3, 6e-3])
def test_the_delay_moves_the_torque_in_time(arm, delay):
    """The arm hangs at rest: nothing acts before the delay is over, and then what was computed at t = 0."""
    task = Line([0.0, 0.0], [1.0, 1.0], 1.0)
    law = ComputedTorque(arm.with_friction(None), task, 50.0, 20.0)
    loop, late = SampledLoop(), SampledLoop(delay=delay)
    prompt = simulate(law, [0.0, 0.0], duration=0.05, loop=loop, progress=False)
    run = simulate(law, [0.0, 0.0], duration=0.05, loop=late, progress=False)
    still = run.time <= delay
    assert not run.array("q")[0, still].any()
    assert run.array("q")[0, ~still].all(-1).any()
    # while nothing has moved the demand is the same, so the first motion is the prompt one, later
    whole, part = divmod(delay, loop.period)
    first = int(whole) + 1
    expected = prompt.array("qd")[0, 1] * (1 - part / loop.period)
    assert np.allclose(run.array("qd")[0, first], expected, rtol=2e-3)


@pytest.mark.parametrize("period", [2.5e-3, 1 / 3000, 0.007322015953741585, 0.001])
def test_whole_periods_of_delay_leave_no_rest(arm, circle, period):
    for periods in range(1, 13):
        assert split_delay(periods * period, period) == (periods, 0.0)
        whole, rest = split_delay((periods + 0.25) * period, period)
        assert whole == periods
        assert rest == pytest.approx(0.25 * period)


def test_a_filtered_run_starts_at_the_speed_the_arm_has(arm):
    """An arm that moves steadily from the start on is measured so from the first tick on."""
    sensors = Sensors(2.5e-3, None, True, 20.0)
    q, qd = np.array([[0.3, -0.4]]), np.array([[0.5, -1.0]])
    reading = sensors.read(q, qd, sensors.start(q, qd))
    assert np.allclose(reading.qd, qd)


def test_a_nan_in_the_task_is_found_and_named(arm):
    class Hole(Circle):
        at = PathTask.at

        def q_d(self, s):
            return np.where(np.abs(np.asarray(s)[..., None] - 0.1227) < 0.02, np.nan, super().q_d(s))

    law = paper_law(arm, Hole(1.0, 2.0))
    with pytest.raises(SimulationError, match=r"diverged|NaN in the task"):
        simulate(law, START, duration=1.0, progress=False)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tau": np.zeros(1)}, ["Odd.law gives tau of shape (1,)", "(1, 2)"]),
        ({"regular": True}, ["regular of shape ()", "(1,)"]),
        ({"tau": np.full((1, 2), np.nan)}, ["Odd.law gives tau = [[nan, nan]]"]),
    ],
)
def test_a_law_of_ones_own_is_checked_before_the_run(arm, circle, change, words):
    class Odd(ComputedTorque):
        def law(self, t, q, qd, z):
            return super().law(t, q, qd, z)._replace(**change)

    for loop in (SampledLoop(), ContinuousTime()):
        with pytest.raises(InputError) as error:
            simulate(Odd(arm, circle, 1.0, 1.0), START, duration=1.0, loop=loop, progress=False)
        assert all(word in str(error.value) for word in words), str(error.value)


def test_absurd_speeds_are_divergence_even_while_finite(arm, circle):
    law = ComputedTorque(arm.with_friction(None), circle, 800.0, [45.0, 100.0])
    with pytest.raises(SimulationError, match="diverged"):
        simulate(law, START, duration=10.0, loop=SampledLoop(period=0.5), progress=False)
    with pytest.raises(InputError, match="less than one period"):
        simulate(law, START, duration=1.0, loop=SampledLoop(period=2.5), progress=False)


@pytest.mark.parametrize("kind", ["tracking", "plan", "projection"])
def test_the_end_of_an_open_path_is_the_same_in_both_modes(ideal_arm, kind):
    starts, task = [[0.0, -0.5], [1.4, 0.9]], Line([0.2, -0.3], [0.9, 0.6], 1.0)
    law = {
        "tracking": ComputedTorque(ideal_arm, task, 400.0, 40.0),
        "plan": ExtendedMotionPlan(ideal_arm, task, 400.0, 40.0, 20.0),
        "projection": Projection(ideal_arm, task, 400.0, 40.0),
    }[kind]
    loops = SampledLoop(period=1e-3), ContinuousTime(output_period=5e-3)
    sampled, continuous = (simulate(law, starts, duration=2.5, until="duration", loop=x, progress=False) for x in loops)
    assert np.allclose(sampled.finish_time, continuous.finish_time, atol=0.01)
    # the hold makes the loop first order in the period
    assert np.abs(sampled.array("q")[:, ::5] - continuous.array("q")).max() < 0.01
    for run in (sampled, continuous):
        assert np.abs(run.array("q")[:, -1] - task.end).max() < 1e-4
        s, sdot = run.array("s"), run.array("sdot")
        assert (sdot[s >= task.s_end] <= 0).all()
        assert (sdot[s <= task.s0] >= 0).all()


def test_sliding_joints_are_measured_in_metres():
    urdf = """<robot name="slide"><link name="base"/>
    <link name="carriage"><inertial><mass value="1"/>
    <inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial></link>
    <joint name="rail" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>"""
    robot = load_robot(urdf)
    law = ComputedTorque(robot, Line([0.0], [1.0], 1.0), 100.0, 20.0)
    run = simulate(law, [0.0], duration=0.1, progress=False)
    assert robot.position_units == ("m",)
    units = {name: run[name].attrs["units"] for name in ("q", "qd", "tau", "s")}
    assert units == {"q": "m", "qd": "m/s", "tau": "N", "s": "1"}
    with pytest.raises(InputError, match="rail slides"):
        simulate(law, [0.0], duration=0.1, loop=SampledLoop(encoders=[1000.0]))


def test_a_delay_too_long_destabilises_and_the_error_says_when(arm, circle):
    law = paper_law(arm.with_friction(None), circle)
    with pytest.raises(SimulationError, match=r"rollout 0 diverged at t = .* s: its state left"):
        simulate(law, START, duration=20.0, loop=SampledLoop(delay=0.05), progress=False)


def test_an_open_path_ends_at_rest_on_its_last_point(ideal_arm):
    task = Line([0.2, -0.3], [0.9, 0.6], 1.0)
    for law in (
        ComputedTorque(ideal_arm, task, 400.0, 40.0),
        ExtendedMotionPlan(ideal_arm, task, 400.0, 40.0, 20.0),
        Projection(ideal_arm, task, 400.0, 40.0),
    ):
        run = simulate(law, [0.0, -0.5], duration=4.0, progress=False)
        assert np.abs(run.array("q")[0, -1] - task.end).max() < 1e-3
        assert np.abs(run.array("qd")[0, -1]).max() < 1e-3
        s = run.array("s")[0]
        assert task.s0 <= s.min() <= s.max() <= task.s_end


def test_a_figure_of_eight_is_followed_branch_by_branch(arm):
    task = Lissajous([0.8, 0.8], [1, 2], 1.0)
    law = Projection(arm, task, 800.0, [45.0, 100.0])
    run = simulate(law, task.q_d(0.3), duration=12.0, loop=SampledLoop(velocity="difference"), progress=False)
    s = run.array("s")[0]
    assert s[-1] > s[0] + task.period
    assert np.abs(np.diff(s)).max() < 0.05  # never jumps at the crossing
    assert run.norm("e_p")[0, run.time > 2].max() < np.deg2rad(4)


# --- bad input ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"q": [0.0, 0.0, 0.0]}, ["q has shape (3,)", "2 joints"]),
        ({"q": [0.0, np.nan]}, ["q[1] is nan"]),
        ({"q": np.zeros((0, 2))}, ["q has shape (0, 2)", "one initial state"]),
        ({"qd": [[1.0, 2.0, 3.0]]}, ["qd has shape (1, 3)"]),
        ({"q": np.zeros((3, 2)), "qd": np.zeros((4, 2))}, ["(3, 2)", "(4, 2)"]),
        ({"q": np.zeros((4, 2)), "rows": 3}, ["K_p of shape (3, 2)", "4 rollouts"]),
        ({"duration": 0.0}, ["duration = 0"]),
        ({"duration": np.inf}, ["duration = inf"]),
    ],
)
def test_bad_calls(arm, circle, change, words):
    arguments = {"q": START, "duration": 1.0} | change
    gains = np.full((arguments.pop("rows"), 2), 50.0) if "rows" in change else 50.0
    with pytest.raises(InputError) as error:
        simulate(ExtendedMotionPlan(arm, circle, gains, 10.0, 1.0), **arguments)
    assert all(word in str(error.value) for word in words), str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"period": 0.0}, "period = 0"),
        ({"period": float("nan")}, "period"),
        ({"substeps": 0}, "substeps = 0"),
        ({"velocity": "guess"}, "'exact' or 'difference'"),
        ({"filter_hz": -1.0}, "filter_hz = -1"),
        ({"delay": -1.0}, "delay = -1"),
    ],
)
def test_bad_loops(options, word):
    with pytest.raises(InputError) as error:
        SampledLoop(**options)
    assert word in str(error.value)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"encoders": [100.0, 0.0]}, "counts per revolution greater than 0"),
        ({"encoders": [100.0]}, "one value for each joint"),
        ({"torque_limits": [np.nan, 15.0]}, "torque_limits.0. is nan"),
        ({"torque_limits": [10.0, 0.0]}, "torque limit of joint_2 is 0"),
    ],
)
def test_bad_hardware(arm, circle, options, word):
    with pytest.raises(InputError, match=word):
        simulate(paper_law(arm, circle), START, duration=0.1, loop=SampledLoop(**options))
