"""Several paths one after another: the same as each by hand, and nothing happens at the seams."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats

from pathcontrol import (
    Circle,
    ComputedTorque,
    ContinuousTime,
    Dropout,
    ExtendedMotionPlan,
    FrictionChange,
    Harmonic,
    InputError,
    JammedJoint,
    Line,
    PathSequence,
    PathTask,
    PickUp,
    Projection,
    Push,
    Run,
    SampledLoop,
    TorqueLimitDrop,
    Wall,
    WaypointPath,
    load_robot,
    metrics,
    record,
    simulate,
)
from pathcontrol.analysis.lost_samples import find_lost
from pathcontrol.registry import DISTURBANCES
from pathcontrol.simulation.sequence import simulate_sequence

HOME, AWAY = np.array([0.2, -0.3]), np.array([0.9, 0.6])
GAINS = {"K_p": 800.0, "K_v": [45.0, 100.0]}


def there(arm, speed=1.0):
    return ExtendedMotionPlan(arm, Line(HOME, AWAY, speed), k=20.0, **GAINS)


def around(arm, speed=1.5):
    return Projection(arm, Circle(0.4, speed, center=[0.5, 0.6]), 800.0, [45.0, 100.0])


def back(arm, speed=1.0):
    return ComputedTorque(arm, WaypointPath([AWAY, [0.5, 0.5], HOME], speed), **GAINS)


def by_hand(controllers, q, duration, **options):
    """Each path with ``simulate``, from where the one before has left the arm."""
    runs, qd = [], np.zeros(2)
    for law in controllers:
        laps = 1 if law.task.closed else None
        runs.append(simulate(law, q, qd, duration=duration, laps=laps, progress=False, **options))
        q, qd = (runs[-1].array(name)[0, -1] for name in ("q", "qd"))
    return runs


@given(st.permutations([there, around, back]), floats(0.6, 1.5), floats(-0.1, 0.1))
@settings(max_examples=3)
def test_a_sequence_is_each_path_by_hand(arm, makers, speed, offset):
    laws = [make(arm, speed) for make in makers]
    run = simulate_sequence(laws, HOME + offset, duration=9.0, gaps=True, progress=False)
    runs = by_hand(laws, HOME + offset, 9.0)
    assert list(run.data["path_status"].to_numpy()) == ["finished"] * 3
    for i, alone in enumerate(runs):
        part = run.path(i)
        samples = len(alone.time) - (i < 2)  # the last one is the first of the next path
        assert len(part.time) == samples
        assert np.allclose(part.time, alone.time[:samples], atol=1e-9)
        assert part.finish_time[0] == pytest.approx(alone.finish_time[0])
        for name in alone.data.data_vars:
            difference = np.abs(part.array(name).astype(float) - alone.array(name)[:, :samples])
            assert difference.max() <= (1e-12 if name == "s" else 0.0), name  # s goes on from path to path
        assert part.config["controller"] == alone.config["controller"]
    assert run.finish_time[0] == pytest.approx(run.data["path_finish_time"].to_numpy()[-1])
    assert run.finish_time[0] == pytest.approx(sum(r.time[-1] for r in runs[:2]) + runs[2].finish_time[0])


def test_in_continuous_time_as_well(ideal_arm):
    laws, loop = [there(ideal_arm), around(ideal_arm)], ContinuousTime(output_period=0.01, rtol=1e-6, atol=1e-8)
    run = simulate_sequence(laws, HOME, duration=9.0, loop=loop, progress=False)
    runs = by_hand(laws, HOME, 9.0, loop=loop)
    assert np.allclose(np.diff(run.time), loop.output_period)
    for i, alone in enumerate(runs):
        assert np.array_equal(run.path(i).array("q"), alone.array("q")[:, : len(run.path(i).time)])


def test_nothing_happens_at_the_seams(arm):
    """One grid of time; sensors and delayed torques go on as if there were one controller."""
    loop = SampledLoop(velocity="difference", delay=2.5e-3, torque_limits=True)
    laws = [there(arm), around(arm), back(arm)]
    run = simulate_sequence(laws, HOME, duration=9.0, loop=loop, progress=False)
    assert np.array_equal(run.time, loop.period * np.arange(len(run.time)))
    index = run["path_index"].to_numpy()
    assert list(np.unique(np.diff(index))) == [0, 1]
    assert (index[0], index[-1]) == (0, 2)
    q, measured = run.array("q")[0], run.array("qd_measured")[0]
    assert np.allclose(measured[1:], np.diff(q, axis=0) / loop.period, rtol=1e-9, atol=1e-12)
    effort = arm.limits.effort
    demand = np.clip(run.array("tau_demand")[0], -effort, effort)
    assert np.array_equal(run.array("tau")[0, 1:], demand[:-1])  # a delay of one period


def test_a_path_that_is_not_finished_ends_the_sequence(arm):
    laws = [there(arm), back(arm), around(arm), there(arm)]
    run = simulate_sequence(laws, HOME, duration=[9.0, 0.5, 9.0, 9.0], gaps=True, progress=False)
    assert list(run.data["path_status"].to_numpy()) == ["finished", "running", "waiting", "waiting"]
    assert np.array_equal(np.isnan(run.data["path_finish_time"]), [False, True, True, True])
    assert run.status[0] == "running"
    assert np.isnan(run.finish_time[0])
    assert run.path(1).time[-1] == pytest.approx(0.5)
    assert run.path(1).status[0] == "running"
    assert run["path_index"].to_numpy()[-1] == 1
    with pytest.raises(InputError, match="path 2 was not followed: the run has 2"):
        run.path(2)


def test_laps_of_the_closed_ones(arm):
    laws = [around(arm), there(arm)]
    start = laws[0].task.q_d(np.array(0.0))
    run = simulate_sequence(iter(laws), start, duration=9.0, laps=2, gaps=True, progress=False)
    s = run.path(0).array("s")[0]
    assert s[-1] < s[0] + 2 * laws[0].task.period <= s[-1] + 0.05
    assert run.path(1).status[0] == "finished"
    with pytest.raises(InputError, match="counts no laps"):
        _ = run.laps


def test_a_sequence_is_a_run(arm, tmp_path):
    laws = [there(arm), back(arm)]
    run = simulate_sequence(laws, HOME, duration=9.0, progress=False)
    assert repr(run).startswith("Run(2 paths with ExtendedMotionPlan, ComputedTorque; rollout: 1")
    assert "finished after" in repr(run)
    again = Run.load(run.save(tmp_path / "run.nc"))
    assert again.data.identical(run.data)
    assert again.path(1).data.identical(run.path(1).data)
    assert record(run, arm).title[1] == "2 paths with ExtendedMotionPlan, ComputedTorque"
    values = metrics(run.path(1), laws[1].task)
    assert values["path_time"][0] == pytest.approx(np.diff(run.data["path_finish_time"])[0], abs=0.06)
    assert values["end_error"][0] < 0.03
    with pytest.raises(InputError, match="no sequence of paths"):
        simulate(laws[0], HOME, duration=0.1, progress=False).path(0)


class Endless(PathTask):
    def q_d(self, s):
        s = np.asarray(s)[..., None]
        return np.concatenate([np.cos(s), np.sin(s)], -1) * (0.5 + 0.02 * s)

    def theta(self, s):
        return 1.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"q": [HOME, AWAY]}, ["2 initial states, expected one", "once for each"]),
        ({"controllers": []}, ["controllers = []", "one controller for each path"]),
        ({"controllers": ["Projection"]}, ["controllers[0] = 'Projection', expected a Controller"]),
        ({"task": Endless()}, ["Endless", "neither ends nor repeats"]),
        ({"duration": [1.0, 2.0]}, ["duration has shape (2,)", "one for each of 1 paths"]),
        ({"duration": 0.0}, ["duration = ", "greater than 0"]),
        ({"duration": 1e-3}, ["less than one period"]),
        ({"laps": 0, "task": Circle(1.0, 1.0)}, ["laps = 0"]),
        ({"loop": 1e-3}, ["loop = 0.001", "SampledLoop"]),
        ({"plant": "double"}, ["the plant has the joints"]),
    ],
)
def test_bad_sequences(arm, change, words):
    change = dict(change)
    task = change.pop("task", Line(HOME, AWAY, 1.0))
    if "plant" in change:
        urdf = """<robot name="slide"><link name="base"/>
        <link name="carriage"><inertial><mass value="1"/>
        <inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial></link>
        <joint name="rail" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="1 0 0"/>
        <limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>"""
        change["plant"] = load_robot(urdf)
        change["q"] = [0.0]
    arguments = {"controllers": [ComputedTorque(arm, task, 100.0, 20.0)], "q": HOME, "duration": 1.0} | change
    with pytest.raises(InputError) as error:
        simulate_sequence(arguments.pop("controllers"), arguments.pop("q"), **arguments)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_a_run_of_a_sequence_has_the_parameters_of_the_task_of_its_paths(arm):
    paths = [there(arm).task, back(arm).task]
    task = PathSequence(paths)
    run = simulate_sequence([there(arm), back(arm)], HOME, duration=9.0, progress=False)
    s = run.array("s")[0]
    assert np.all(np.diff(s) >= 0)
    assert np.array_equal(task.index(s)[:-1], run["path_index"].to_numpy()[:-1])
    assert np.allclose(task.q_d(s) - run.array("q")[0], run.array("e_p")[0], atol=1e-9)


def made(described):
    """A disturbance from its description in the configuration of a run."""
    kind = DISTURBANCES.find(described["disturbance"])
    known = inspect.signature(kind).parameters
    return kind(**{name: value for name, value in described.items() if name in known})


@pytest.mark.parametrize(
    "disturbance",
    [
        Push([1.0, 2.0], [0.9], 0.4),
        Harmonic([1.0, 2.0], 3.0, 0.2),
        JammedJoint(1, 0.9, 0.4),
        TorqueLimitDrop(0.5, 0.9, 0.4),
        FrictionChange(2.0, 0.9, 0.4),
        Dropout(0.9, 0.4, "measurements"),
        PickUp(0.5, "tool", 0.9, 0.4),
        Wall("tool", [9.0, 0.0, 0.0], [-1.0, 0.0, 0.0], rigid=True, start=0.9, duration=0.4),
    ],
    ids=lambda one: type(one).__name__,
)
def test_the_disturbance_of_one_path_has_the_time_of_its_run(arm, disturbance):
    laws, loop = [there(arm), back(arm)], SampledLoop(torque_limits=True)
    run = simulate_sequence(laws, HOME, duration=9.0, loop=loop, disturbance=disturbance, gaps=True, progress=False)
    whole = simulate_sequence(
        laws, HOME, duration=9.0, loop=loop, disturbance=disturbance + Push([0.0, 0.0]), gaps=True, progress=False
    )
    begin = run.time[int((run["path_index"].to_numpy() == 0).sum())]
    moved = made(run.path(1).config["disturbance"])
    assert run.path(0).config["disturbance"] == run.config["disturbance"]
    assert made(whole.path(1).config["disturbance"]["terms"][0]).describe() == moved.describe()
    times = begin + np.linspace(-2.0, 2.0, 41) + 1e-3  # at none of them something begins or ends
    q = np.zeros((1, 2))
    for t in times:
        if isinstance(disturbance, Harmonic):
            np.testing.assert_allclose(moved.torque(t - begin, q, q), disturbance.torque(t, q, q), atol=1e-12)
        else:
            np.testing.assert_array_equal(moved.share(t - begin), disturbance.share(t))


def test_measurements_that_are_lost_on_one_path_are_those_of_the_whole(arm):
    laws = [there(arm), back(arm)]
    run = simulate_sequence(laws, HOME, duration=9.0, disturbance=Dropout(2.0, 0.1, "measurements"), progress=False)
    among, lost = run["path_index"].to_numpy(), find_lost(run, filtered=False)
    assert run["path_finish_time"].to_numpy()[0] < 2.0
    assert lost[0, among == 1].sum() == 40
    for i in range(2):
        np.testing.assert_array_equal(find_lost(run.path(i), filtered=False), lost[:, among == i])
