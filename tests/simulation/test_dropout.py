"""Ticks and measurements that are lost: the law stands still, or sees what it saw, and goes on from there."""

from __future__ import annotations

import numpy as np
import pytest
from circle_file import CIRCLE_FILE
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc

ENGINES = ["compiled", "pinocchio"]
ARM = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
PATH_LAW = pc.ExtendedMotionPlan(ARM, CIRCLE, 800.0, [45.0, 100.0], 20.0)
LAWS = {
    "plan": PATH_LAW,
    "timed": pc.ComputedTorque(ARM, CIRCLE, 800.0, 45.0),
    "slotine": pc.SlotineLi(ARM, CIRCLE, 20.0, 9.0),
}
LAWS["projection"] = pc.Projection(ARM, CIRCLE, 800.0, [45.0, 100.0])
SAID = ("s", "sdot", "e_p", "e_v", "tau_demand", "q_measured", "qd_measured")


def simulated(dropout, law=PATH_LAW, q=(0.7, 1.2), duration=0.3, **options):
    return pc.simulate(law, q, duration=duration, disturbance=dropout, progress=False, **options)


def during(run, begin, end):
    return np.flatnonzero((run.time >= begin - 1e-9) & (run.time < end - 1e-9))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("law", LAWS)
def test_a_law_that_misses_ticks_says_what_it_said_and_goes_on_from_there(law, engine):
    run, calm = (simulated(d, LAWS[law], engine=engine) for d in (pc.Dropout(0.1, 0.05), None))
    missed = during(run, 0.1, 0.15)
    for name in SAID:
        values = run.array(name)[0]
        assert_array_equal(values[missed], np.broadcast_to(values[missed[0] - 1], values[missed].shape), err_msg=name)
        assert_array_equal(values[: missed[0]], calm.array(name)[0, : missed[0]])
    assert not run.array("regular")[0, missed].any()
    assert run.array("regular")[0, missed[-1] + 1 :].all()
    after = missed[-1] + 1
    assert_array_equal(run.array("q_measured")[0, after:], run.array("q")[0, after:])
    assert np.ptp(run.array("q")[0, missed], axis=0).min() > 1e-3  # the arm itself goes on
    if law != "projection":  # its path parameter is the arm's, that of the others their own
        assert run.array("s")[0, after] == pytest.approx(
            calm.array("s")[0, missed[0]], abs=0.05 if law == "plan" else 1e-12
        )


@pytest.mark.parametrize("engine", ENGINES)
def test_held_torque_is_that_of_a_longer_period(engine):
    """Every second tick missed from the first on: the arm is driven as by a loop of twice the period."""
    q, qd, z = np.array([[0.7, 1.2]]), np.zeros((1, 2)), PATH_LAW.start(np.array([[0.7, 1.2]]), np.zeros((1, 2)))
    plant, odd = pc.Plant(ARM, 2.5e-3), pc.Dropout(2.5e-3, 2.5e-3)
    for tick in range(1, 20):
        odd = odd + pc.Dropout((2 * tick + 1) * 2.5e-3, 2.5e-3)
    run = simulated(odd, duration=0.1, engine=engine)
    for tick in range(20):
        assert_allclose(run.array("q")[0, 2 * tick], q[0], rtol=0, atol=1e-11)
        out = PATH_LAW.law(0.0, q, qd, z)
        z = PATH_LAW.advance(z, out, 2.5e-3)  # the law has run once
        for _ in range(2):
            q, qd = plant.advance(q, qd, out.tau)


@pytest.mark.parametrize("engine", ENGINES)
def test_without_torque_the_arm_falls(engine):
    run = simulated(pc.Dropout(0.0, fallback="zero"), engine=engine)
    q, qd, plant = np.array([[0.7, 1.2]]), np.zeros((1, 2)), pc.Plant(ARM, 2.5e-3)
    for _ in range(120):
        q, qd = plant.advance(q, qd, np.zeros((1, 2)))
    assert_allclose(run.array("q")[0, -1], q[0], rtol=0, atol=1e-11)
    assert (run.array("tau_demand") == 0).all()
    assert (run.array("s") == run.array("s")[0, 0]).all()
    assert_array_equal(run.array("q"), simulated(pc.Dropout(0.0), engine=engine).array("q"))  # no torque came before


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("law", LAWS)
def test_a_law_without_measurements_runs_on_with_the_last_ones(law, engine):
    loop = pc.SampledLoop(velocity="difference", filter_hz=200.0, encoders=True)
    options = {"loop": loop, "engine": engine, "law": LAWS[law]}
    run, calm = (simulated(d, **options) for d in (pc.Dropout(0.1, 0.05, "measurements"), None))
    stale = during(run, 0.1, 0.15)
    for name in ("q_measured", "qd_measured"):
        values = run.array(name)[0]
        assert_array_equal(values[stale], np.broadcast_to(values[stale[0] - 1], values[stale].shape))
    assert run.array("regular").all()
    if law == "timed":
        assert_array_equal(run.array("s"), calm.array("s"))  # its clock goes on
    # what comes then is what the sensors have measured all the time: no spike of a difference over the gap
    after = stale[-1] + 1
    counts = 2 * np.pi / np.array([1024000, 655360])
    assert (np.abs(run.array("q_measured") - run.array("q"))[0, after:] <= 0.5 * counts + 1e-15).all()
    assert (np.abs(run.array("qd_measured") - run.array("qd"))[0, after] < 0.5).all()
    q, qd, z = (run.array(name)[0, stale[3]][None] for name in ("q_measured", "qd_measured", "s"))
    said = LAWS[law].law(0.0, q, qd, z[..., None])
    assert_allclose(run.array("e_p")[0, stale[3]], said.e_p[0], rtol=0, atol=1e-12)


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["cicese_2dof", "ur5", "panda"]))
def test_the_engine_agrees_with_the_reference_on_random_dropouts(seed, name):
    rng = np.random.default_rng(seed)
    robot = pc.load_robot(
        name, lock={"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0} if name == "panda" else None
    )
    n = robot.n
    task = pc.Lissajous(np.full(n, 0.2), np.arange(n) % 2 + 1, 1.0, center=np.where(np.arange(n) == 3, -1.0, 0.4))
    law = pc.ExtendedMotionPlan(robot, task, 400.0, np.full(n, 40.0), 5.0)
    lost = sum(
        (
            pc.Dropout(
                rng.uniform(0, 0.2, 3), rng.uniform(0.01, 0.2), what, fallback, rng.uniform(0.1, 1, 3), int(seed)
            )
            for what, fallback in (("ticks", "hold"), ("ticks", "zero"), ("measurements", "hold"))
        ),
        start=pc.Push(np.ones(n)),
    )
    loop = pc.SampledLoop(
        period=5e-3, velocity="difference", delay=6e-3, noise=pc.SensorNoise(1e-5), torque_limits=np.full(n, 400.0)
    )
    runs = [simulated(lost, law, task.q_d(np.array(0.0)), 0.3, engine=e, loop=loop) for e in ENGINES]
    assert runs[0].config["engine"] == "compiled"
    assert "engine_reason" not in runs[0].config
    for variable in ("q", "s", "e_p", "q_measured"):
        assert_allclose(runs[0].array(variable), runs[1].array(variable), rtol=0, atol=1e-8)
    assert_array_equal(runs[0].array("regular"), runs[1].array("regular"))


@pytest.mark.parametrize("engine", ENGINES)
def test_each_rollout_loses_what_it_loses_alone(engine):
    starts, chances = np.array([0.0, 0.1, 0.2]), np.array([0.3, 1.0, 0.6])
    together = simulated(pc.Dropout(starts, 0.2, probability=chances, seed=7), engine=engine)
    assert together.rollouts == 3
    for i in range(3):
        lost = pc.Dropout(starts[i], 0.2, probability=chances[i], seed=7)
        alone = simulated(lost, engine=engine, first_rollout=i)
        for name in ("q", "s", "regular"):
            assert_array_equal(together.array(name)[i], alone.array(name)[0])


def test_blocks_of_ticks_make_no_difference(monkeypatch):
    lost = pc.Dropout(0.0, probability=0.5, seed=1) + pc.Dropout(0.05, 0.3, "measurements", probability=0.5)
    whole = simulated(lost)
    monkeypatch.setattr("pathcontrol.simulation.compiled._BLOCK", 7)
    for name in SAID:
        assert_array_equal(simulated(lost).array(name), whole.array(name))


def test_as_many_ticks_are_lost_as_the_probability_says():
    run = simulated(pc.Dropout(0.0, probability=np.full(20, 0.2)), duration=1.0)
    share = 1.0 - run.array("regular").mean()
    assert share == pytest.approx(0.2, abs=4 * np.sqrt(0.16 / run.array("regular").size))
    assert len({bytes(row) for row in run.array("regular")}) == 20  # each rollout has its own


class MyPlan(pc.ExtendedMotionPlan):
    """The same law, which the engine does not know."""


def test_a_law_in_python_loses_the_same():
    mine, lost = MyPlan(ARM, CIRCLE, 800.0, [45.0, 100.0], 20.0), pc.Dropout([0.1, 0.2], 0.1, probability=0.7)
    runs = [simulated(lost, law) for law in (PATH_LAW, mine)]
    assert "only the plant" in runs[1].config["engine_reason"]
    assert_allclose(runs[1].array("q"), runs[0].array("q"), rtol=0, atol=1e-11)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_law_that_takes_over_while_ticks_are_missed_begins_when_they_come(engine):
    paths = [pc.Line([0.0, 0.0], [0.1, 0.1], 1.0), pc.Line([0.1, 0.1], [0.2, 0.1], 1.0)]
    laws = [pc.ComputedTorque(ARM.with_friction(None), path, 400.0, 40.0) for path in paths]
    calm = pc.simulate_sequence(laws, [0.0, 0.0], duration=0.8, engine=engine, progress=False)
    seam = float(calm.data["path_finish_time"][0])
    lost = pc.Dropout(seam + 0.03, 0.05) + pc.Dropout(0.0, 0.01)
    run = pc.simulate_sequence(laws, [0.0, 0.0], duration=0.8, disturbance=lost, engine=engine, progress=False)
    assert not run.array("regular")[0, :4].any()
    assert (run.array("tau_demand")[0, :4] == 0).all()
    assert (np.diff(run.array("s")[0]) >= 0).all()
    assert (run.status == "finished").all()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_rollout_that_diverges_while_blind_disturbs_nobody(engine):
    wild = pc.ComputedTorque(ARM, CIRCLE, [[800.0], [5e7]], 45.0)
    lost = pc.Dropout(0.05, 0.1, "measurements") + pc.Dropout(0.2, 0.05)
    with np.errstate(all="ignore"), pytest.warns(pc.PathControlWarning):
        both = simulated(lost, wild, engine=engine)
    alone = simulated(lost, pc.ComputedTorque(ARM, CIRCLE, 800.0, 45.0), engine=engine)
    assert both.status.tolist() == ["running", "diverged"]
    assert_array_equal(both.array("q")[0], alone.array("q")[0])


def test_a_file_says_it(tmp_path):
    file = tmp_path / "lost.toml"
    file.write_text(
        CIRCLE_FILE
        + """
        [[disturbance]]
        type = "dropout"
        start = "100 ms"
        duration = 0.1
        fallback = "zero"
        [[disturbance]]
        type = "dropout"
        what = "measurements"
        start = 0.2
        probability = 0.5
        seed = 2
        """
    )
    run = pc.run_experiment(file, tmp_path / "out", progress=False).run
    assert (run.array("tau_demand")[0, during(run, 0.1, 0.2)] == 0).all()
    assert run.config["disturbance"]["terms"][1]["seed"] == 2


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: pc.Dropout(what="tick"), "what = 'tick'"),
        (lambda: pc.Dropout(fallback="none"), "fallback = 'none'"),
        (lambda: pc.Dropout(probability=0.0), "probability = 0.0, expected numbers above 0 and up to 1"),
        (lambda: pc.Dropout(probability=1.5), "probability = 1.5"),
        (lambda: pc.Dropout(probability=np.nan), "probability = nan"),
        (lambda: pc.Dropout(seed=-1), "seed"),
        (lambda: pc.Dropout(0.0, -1.0), "duration = -1.0"),
        (lambda: simulated(pc.Dropout(0.1), loop=pc.ContinuousTime()), "continuous time cannot"),
        (lambda: simulated(pc.Dropout([0.1, 0.2]), q=[[0.7, 1.2]] * 3), "Dropout"),
    ],
)
def test_what_cannot_be(make, said):
    with pytest.raises(pc.PathControlError, match=said):
        make()
