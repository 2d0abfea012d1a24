"""Wrapped laws and momentum observers in the compiled loop, against the reference."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from test_engine_loop import LAWS, MIDDLE, _apart, _arm, _law, _pair, _task

import pathcontrol as pc
from pathcontrol import EventPlan, Paced, SampledLoop, SpeedOverride
from pathcontrol.control.wrappers.contact_rule import ContactRule
from pathcontrol.control.wrappers.override_rule import OverrideRule
from pathcontrol.control.wrappers.pace_rule import FastestPlan, PaceRule
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.engine.library import BUILDS, load_library

CICESE, CIRCLE = pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0)
PLAN = pc.ExtendedMotionPlan(CICESE, CIRCLE, 800.0, [45.0, 100.0], k=20.0)
NEAREST = pc.Projection(CICESE, CIRCLE, 800.0, [45.0, 100.0])
PUSH = pc.Push([40.0, 8.0], start=0.15, duration=0.2)
#: changes of pace that are still under way when the next one comes, backwards too
STEPS = [[0.05, 1.7], [0.1, 0.0], [0.2, -1.0], [0.35, 0.6]]
WRAPPERS = {
    "override": lambda law: SpeedOverride(law, STEPS, acceleration=12.0),
    "function": lambda law: SpeedOverride(law, lambda t: np.cos(10 * t)),
    "paced": lambda law: Paced(law, torque_limits=0.6 * _effort(law)),
    "event": lambda law: EventPlan(law, threshold=0.02 * _effort(law), pause=0.03),
    "all": lambda law: Paced(
        EventPlan(SpeedOverride(law, STEPS), threshold=0.05 * _effort(law)), torque_limits=_effort(law)
    ),
    "twice": lambda law: SpeedOverride(SpeedOverride(law, [[0.0, 0.5]]), STEPS, acceleration=6.0),
}


def _effort(law):
    return np.asarray(law.robot.limits.effort)


@pytest.mark.parametrize(
    ("wrap", "kind", "name"),
    # all wrappers around each law; each alone around every other law; and each arm, by turns
    [
        (w, k, list(MIDDLE)[(i + j) % 3])
        for i, w in enumerate(WRAPPERS)
        for j, k in enumerate(LAWS)
        if w in ("all", "twice") or (i + j) % 2
    ],
)
def test_wrapped_laws_move_the_arm_as_the_reference_does(wrap, kind, name):
    robot = _arm(name)
    task = _task(name, closed=(len(wrap) + len(kind)) % 2 == 0)
    law = WRAPPERS[wrap](_law(kind, robot, task))
    start = task.q_d(np.array(task.s0)) + 0.02
    loop = SampledLoop(period=5e-3, torque_limits=True)
    push = pc.Push(0.1 * _effort(law), start=0.075, duration=0.1)
    runs = _pair(law, start, duration=0.4, loop=loop, disturbance=push, until="duration")
    assert _apart(runs) < 1e-10
    assert _apart(runs, "s") < 1e-10
    assert _apart(runs, "sdot") < 1e-8
    assert _apart(runs, "tau_demand") < 1e-6
    assert np.ptp(runs[1].array("sdot")) > 0.1  # the pace has changed


@pytest.mark.parametrize("kind", [pc.ExtendedMotionPlan, pc.Projection])
def test_a_plan_that_goes_back_is_paced_as_by_the_reference(kind):
    gains = {"K_p": 800.0, "k": 20.0} if kind is pc.ExtendedMotionPlan else {"k_p": 800.0}
    law = Paced(SpeedOverride(kind(CICESE, pc.Circle(1.0, 10.0), K_v=[45.0, 100.0], **gains), [[0.0, -1.0]]))
    runs = _pair(law, [1.0, 0.0], duration=1.0, loop=SampledLoop(period=5e-3, torque_limits=True))
    assert _apart(runs) < 1e-10
    assert pc.speed_factor(runs[1])[0, 100:].max() > -0.9  # the motors cannot do more everywhere


@pytest.mark.parametrize("kind", ["ExtendedMotionPlan", "Projection", "ComputedTorque"])
def test_a_plan_that_goes_back_to_its_begin_is_timed_there_as_by_the_reference(kind):
    """What pushes the arm no longer moves the plan then."""
    line = pc.Line([0.1, 0.0], [1.0, 1.2], speed=1.0)
    law = SpeedOverride(_law(kind, CICESE, line), [[0.3, -1.0]])
    push = pc.Push([20.0, -4.0], start=0.5, duration=0.4)
    loop = SampledLoop(period=5e-3)
    runs = _pair(law, [0.1, 0.0], duration=1.2, loop=loop, disturbance=push, until="duration")
    assert _apart(runs) < 1e-10
    assert runs[1].array("s")[0, -1] < 1e-2


def test_a_contact_is_forgotten_as_by_the_reference_at_long_periods_too():
    """The time for which the plan is still halted is wound up and down within less than a period, and no further."""
    law = EventPlan(_law("ExtendedMotionPlan", CICESE, CIRCLE), threshold=[6.0, 2.0], pause=0.1)
    runs = _pair(law, [0.9, 0.1], duration=1.5, loop=SampledLoop(period=0.012), disturbance=PUSH)
    assert _apart(runs) < 1e-10
    assert pc.speed_factor(runs[1]).min() < 0.5


def test_a_pace_waits_where_no_rate_keeps_all_limits_as_by_the_reference():
    """Far from the path one motor would need a plan that speeds up, another one a plan that slows down."""
    law = Paced(pc.ExtendedMotionPlan(CICESE, pc.Circle(1.0, 8.0), 800.0, [45.0, 100.0], k=20.0))
    loop = SampledLoop(period=2.5e-3, torque_limits=True)
    runs = _pair(law, [1.54, 0.39], qd=[1.4, -4.8], duration=0.3, loop=loop)
    assert _apart(runs) < 1e-10
    for run in runs:
        w, demand = pc.speed_factor(run)[0], np.abs(run.array("tau_demand")[0]) / _effort(law)
        assert (demand[:10] > 1.1).any(-1).all()
        assert (w[:10] == 0).all()
        assert w[-1] > 0.9


@pytest.mark.parametrize(("kind", "name"), [(kind, list(MIDDLE)[i % 3]) for i, kind in enumerate(LAWS)])
def test_observed_friction_is_compensated_as_by_the_reference(kind, name):
    robot, task = _arm(name), _task(name, closed=True)
    cutoff = np.linspace(5.0, 40.0, robot.n)
    law = _law(kind, robot.with_friction(None), task, friction="observed", observer_hz=cutoff)
    loop = SampledLoop(delay=3.1e-3, torque_limits=True)
    start = task.q_d(np.array(task.s0)) + 0.02
    runs = _pair(law, start, duration=0.3, loop=loop, plant=robot, until="duration")
    assert _apart(runs) < 1e-10
    assert _apart(runs, "tau_demand") < 1e-6


def test_rollouts_have_rows_of_their_own_with_the_bits_they_have_alone(monkeypatch):
    rng, count = np.random.default_rng(4), 11
    circles = [pc.Circle(0.8 + 0.1 * i, 5.0) for i in range(3)]
    tasks = [circles[i] for i in (0, 1, 2, 1, 0, 2, 2, 0, 1, 1, 0)]
    gains, speeds = rng.uniform(300, 900, (count, 1)), rng.uniform(-0.5, 1.5, count)
    cutoff, threshold = rng.uniform(5, 40, (count, 2)), rng.uniform(1, 8, (count, 2))

    def law(rows):
        plan = pc.ExtendedMotionPlan(
            CICESE,
            pc.TaskBatch(tasks[rows]),
            gains[rows],
            60.0,
            k=20.0,
            friction="observed",
            observer_hz=cutoff[rows],
        )
        return Paced(EventPlan(SpeedOverride(plan, speeds[rows]), threshold=threshold[rows]))

    options = {"duration": 0.5, "disturbance": PUSH, "loop": SampledLoop(period=5e-3, torque_limits=True)}
    many = law(slice(None))
    runs = _pair(many, [0.9, 0.1], **options)
    assert _apart(runs) < 1e-10
    together = runs[1].array("q")
    for i in (2, 10):
        alone = pc.simulate(law(slice(i, i + 1)), [0.9, 0.1], engine="compiled", progress=False, **options)
        assert np.array_equal(alone.array("q")[0], together[i])
    for build in BUILDS[: load_library("base").pathcontrol_instructions() + 1]:
        monkeypatch.setattr("pathcontrol.simulation.compiled.load_library", lambda build=build: load_library(build))
        same = pc.simulate(many, [0.9, 0.1], engine="compiled", progress=False, **options)
        assert np.array_equal(same.array("q"), together), build


def test_lost_ticks_and_noise_meet_wrapped_laws_alike_in_blocks_of_any_length(monkeypatch):
    noise = pc.SensorNoise(position=1e-5, seed=2)
    loop = SampledLoop(period=5e-3, noise=noise, velocity="difference", filter_hz=80.0)
    lost = pc.Dropout(0.1, 0.6, probability=0.3, seed=1) + pc.Dropout(0.2, 0.3, "measurements", probability=0.3)
    law = EventPlan(SpeedOverride(NEAREST, lambda t: 1 - t), threshold=[6.0, 2.0])
    starts = [[0.9, 0.1], [1.0, 0.2]]
    runs = _pair(law, starts, duration=0.8, loop=loop, disturbance=lost + PUSH)
    assert _apart(runs) < 1e-10
    monkeypatch.setattr("pathcontrol.simulation.compiled._BLOCK", 14)
    options = {"duration": 0.8, "loop": loop, "disturbance": lost + PUSH, "engine": "compiled"}
    assert np.array_equal(pc.simulate(law, starts, progress=False, **options).array("q"), runs[1].array("q"))


def test_a_sequence_hands_the_observer_on_as_the_reference_does():
    corners = [[0.6, 0.2], [0.9, 0.8], [0.2, 1.0]]
    lines = [pc.Line(a, b, speed=0.8) for a, b in itertools.pairwise(corners)]
    laws = [pc.ComputedTorque(CICESE, line, 800.0, 60.0, friction="observed") for line in lines]
    laws[1] = Paced(laws[1])
    options = {"duration": 6.0, "progress": False, "loop": SampledLoop(period=5e-3, torque_limits=True)}
    runs = [pc.simulate_sequence(laws, corners[0], engine=e, **options) for e in ("pinocchio", "compiled")]
    assert runs[1].config["engine"] == "compiled"
    assert _apart(runs) < 1e-10
    assert np.array_equal(runs[0].data.path_finish_time, runs[1].data.path_finish_time)


def test_rollouts_that_diverge_disturb_no_wrapped_neighbour():
    robot = CICESE.with_friction(None)
    plan = pc.ComputedTorque(robot, CIRCLE, np.array([[800.0], [5e6], [400.0]]), 40.0)
    law = Paced(EventPlan(plan))
    runs = _pair(law, [0.9, 0.1], duration=0.5)
    assert runs[1].data.status.values.tolist() == ["running", "diverged", "running"]
    assert np.allclose(runs[0].data.diverged_time, runs[1].data.diverged_time, equal_nan=True)
    assert _apart([run.rollout(2) for run in runs]) < 1e-10


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_an_override_out_of_range_is_an_error_when_it_is_asked_for(engine):
    law = SpeedOverride(PLAN, lambda t: 1.0 if t < 0.3 else 7.0)
    with pytest.raises(pc.InputError, match=r"override at t = 0\.3 s = 7\.0"):
        pc.simulate(law, [0.9, 0.1], duration=0.5, engine=engine, progress=False)
    line = pc.Line([0.9, 0.1], [0.8, 0.2], speed=1.0)  # of 0.14 rad, and ended before
    short = SpeedOverride(
        pc.ComputedTorque(CICESE.with_friction(None), line, 800.0, 60.0), lambda t: 1.0 if t < 1.5 else 7.0
    )
    run = pc.simulate(short, [0.9, 0.1], duration=5.0, engine=engine, progress=False)
    assert run.data.status.item() == "finished"
    changing = SpeedOverride(PLAN, lambda t: 1.0 if t < 0.1 else [1.0, 0.5])
    with pytest.raises(pc.InputError, match="2 values for 3 rollouts"):
        pc.simulate(changing, np.full((3, 2), 0.5), duration=0.3, engine=engine, progress=False)


def test_an_override_that_ends_with_the_run_is_asked_for_no_more_than_by_the_reference():
    """The run ends before the table does, and before the function fails."""
    table, asked = np.ones(2000), []  # 5 s of ticks, without the last one

    def tabulated(t):
        asked.append(t)
        return table[round(t / 2.5e-3)]

    line = pc.Line([0.9, 0.1], [0.8, 0.2], speed=1.0)
    law = SpeedOverride(pc.ComputedTorque(CICESE.with_friction(None), line, 800.0, 60.0), tabulated)
    runs = _pair(law, [0.9, 0.1], duration=5.0)
    assert _apart(runs) < 1e-11
    assert len(asked) < 1500  # 310 ticks of the reference, and one block of the engine
    table = np.ones(1 << 9)  # as long as a block
    with pytest.raises(IndexError):
        pc.simulate(SpeedOverride(PLAN, tabulated), [0.9, 0.1], duration=2.0, engine="compiled", progress=False)
    exact = np.ones((1 << 9) + 1)
    law = SpeedOverride(PLAN, lambda t: exact[round(t / 2.5e-3)])
    assert _apart(_pair(law, [0.9, 0.1], duration=(1 << 9) * 2.5e-3)) < 1e-11


class OwnRule(OverrideRule):
    """A rule of the user's own."""


class OwnWrapper(LawWrapper):
    """A wrapper of the user's own."""


class OwnPlan(FastestPlan):
    """Half as fast."""

    def forward(self, s):
        largest, slope = super().forward(s)
        return 0.5 * largest, 0.5 * slope


def test_a_pace_of_other_paths_or_of_one_s_own_runs_in_python():
    """Its plan has as many tables as it likes."""
    tasks = [pc.Circle(r, 10.0) for r in (0.8, 0.9, 1.0)]
    one = Paced(pc.ExtendedMotionPlan(CICESE, tasks[0], 800.0, 60.0, k=20.0))
    many = one.around(pc.ExtendedMotionPlan(CICESE, pc.TaskBatch(tasks), 800.0, 60.0, k=20.0))
    effort = _effort(PLAN)
    own = LawWrapper(PLAN, PaceRule(OwnPlan(CICESE, CIRCLE, effort, 0.1), effort, {}))
    twice = Paced(Paced(PLAN, torque_limits=0.6 * effort))
    stranger = LawWrapper(EventPlan(PLAN), ContactRule(CICESE.with_friction(None), [6.0, 2.0], 10.0, 0.1))
    for law in (many, own, twice, stranger):
        runs = [pc.simulate(law, [0.9, 0.1], duration=0.1, engine=e, progress=False) for e in ("pinocchio", "auto")]
        assert "in Python" in runs[1].config["engine_reason"]
        assert _apart(runs) < 1e-10


def test_no_pace_turns_round():
    """It comes to rest where it has to brake harder than that, as on winding paths that begin at rest."""
    rng = np.random.default_rng(6)
    for _ in range(6):
        path = pc.WaypointPath(rng.uniform([-0.5, 0.0], [0.5, 0.9], (4, 2)), speed=0.5)
        law = Paced(pc.ExtendedMotionPlan(CICESE, path, 400.0, 40.0, k=5.0), torque_limits=0.65 * _effort(PLAN))
        q, loop = path.q_d(np.array(0.0)) + np.array([0.02, -0.02]), SampledLoop(period=5e-3, torque_limits=True)
        for engine in ("pinocchio", "compiled"):
            run = pc.simulate(law, q, duration=0.4, loop=loop, engine=engine, progress=False)
            assert pc.speed_factor(run).min() > -1e-9


@pytest.mark.parametrize(
    ("law", "name"),
    [(LawWrapper(PLAN, OwnRule(0.5)), "OwnRule"), (OwnWrapper(PLAN, OverrideRule(0.5)), "OwnWrapper")],
)
def test_rules_and_wrappers_of_one_s_own_run_in_python_and_say_so(law, name):
    run = pc.simulate(law, [0.9, 0.1], duration=0.2, progress=False)
    assert f"{name} is in Python" in run.config["engine_reason"]
    known = pc.simulate(SpeedOverride(PLAN, 0.5, 10.0), [0.9, 0.1], duration=0.2, progress=False)
    assert "engine_reason" not in known.config
    assert np.abs(run.array("q") - known.array("q")).max() < 1e-11


def test_more_rules_than_the_engine_takes_run_in_python():
    law = PLAN
    for _ in range(9):
        law = SpeedOverride(law, 0.99)
    run = pc.simulate(law, [0.9, 0.1], duration=0.1, progress=False)
    assert "there are 9 rules of speed, the engine takes 8" in run.config["engine_reason"]


@pytest.mark.parametrize("law", [Paced(SpeedOverride(PLAN)), EventPlan(NEAREST, threshold=[6.0, 2.0])])
def test_a_control_tick_that_is_operated_is_what_the_law_says(law):
    """Whatever the operator asks for, at a moment's notice, and with an observer in the law."""
    period = 5e-3
    tick, plant = pc.ControlTick(law, period), pc.Plant(CICESE, period)
    q, qd, limits = np.array([[0.9, 0.1]]), np.zeros((1, 2)), CICESE.limits.effort
    tick.start(q[0], qd[0])
    z, asked = law.start(q, qd), {30: tick.hold, 75: tick.reverse, 130: tick.resume, 165: lambda: tick.override(1.8)}
    for k in range(225):
        asked.get(k, lambda: None)()
        out = law.law(k * period, q, qd, z)
        assert np.abs(tick(q[0], qd[0]) - out.tau).max() < 1e-7
        acting = np.clip(out.tau, -limits, limits)
        z = law.advance(z, out._replace(tau=acting), period)
        assert np.abs(tick.state - z[0]).max() < 1e-6
        q, qd = plant.advance(q, qd, acting + PUSH.torque(k * period, q, qd))


def test_a_tick_of_a_path_that_can_be_passed_in_one_direction_only_goes_forward():
    down = pc.Line([1.4, 0.3], [0.2, 0.1], speed=1.0)  # friction helps to lower the arm
    tick = pc.ControlTick(Paced(pc.ComputedTorque(CICESE, down, 800.0, 60.0), torque_limits=[45.0, 15.0]), 2.5e-3)
    tick.start([1.4, 0.3])
    for _ in range(20):
        tau = tick(np.array([1.4, 0.3]), np.zeros(2))
    assert np.isfinite(tau).all()
    assert tick.s > 0
    tick.reverse()
    with pytest.raises(pc.TaskError, match="weight and dry friction"):
        tick(np.array([1.4, 0.3]), np.zeros(2))


def test_a_tick_starts_again_from_its_state_with_the_same_torques():
    """The observer goes on, as if the tick before had been a period ago."""
    law = SpeedOverride(pc.ComputedTorque(CICESE, CIRCLE, 800.0, 60.0, friction="observed"))
    tick, q, qd = pc.ControlTick(law, 2.5e-3), np.array([0.9, 0.1]), np.zeros(2)
    tick.start(q, qd)
    for _ in range(100):
        tick(q, qd)
    state = tick.state
    expected = tick(q, qd).copy()
    tick.start_from(state)
    assert np.abs(tick(q, qd) - expected).max() < 1e-9
    with pytest.raises(pc.InputError, match=r"state has the shape \(2,\), expected \(12,\)"):
        tick.start_from([0.5, 0.3])
