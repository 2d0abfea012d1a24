"""Logs of anyone's arm as runs: the same numbers as the simulation that made them, and slips that are told."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import InputError, PathControlWarning, TaskError

ROBOT = pc.load_robot("cicese_2dof").with_friction(pc.no_friction(2))
CIRCLE = pc.Circle(0.5, 2.0)
EIGHT = pc.Lissajous([0.3, 0.3], [1, 2], speed=0.8, center=[0.2, 0.4])


@cache
def run_of(task, duration=3.0):
    law = pc.Projection(ROBOT, task, k_p=400.0, K_v=40.0)
    start = np.asarray(task.q_d(np.array(task.s0))) + np.array([0.02, -0.01])
    return pc.simulate(law, start, duration=duration, progress=False)


def log_of(run, task, **changes):
    parts = {name: run.array(name)[0] for name in ("q", "qd", "tau")} | changes
    return pc.Run.from_log(run.time, **parts, robot=ROBOT, task=task)


@pytest.mark.parametrize("task", [CIRCLE, EIGHT, pc.Line([0.0, 0.0], [1.0, 0.5], 0.4)])
def test_a_log_has_the_numbers_of_the_run_that_it_is_of(task):
    """The projection law's own s is the nearest point: through the crossing of the eight, and to the end of a line."""
    run = run_of(task)
    log = log_of(run, task)
    own = (
        slice(None, np.argmax(run.array("s")[0] > 0.75) or None)
        if task.s_end < np.inf and not task.closed
        else slice(None)
    )
    for name, error in (("s", 1e-6), ("e_p", 1e-6), ("e_v", 1e-5), ("sdot", 1e-4)):
        difference = log.array(name)[0, own] - run.array(name)[0, own]
        assert np.abs(difference).max() < error, name
    for name in ("q", "qd", "tau"):
        assert (log.array(name) == run.array(name)).all()
    before, after = pc.metrics(run), pc.metrics(log)
    for name in ("contour_error_peak", "gamma_distance_rms", "coverage", "tau_peak", "velocity_limit_ratio"):
        assert before[name] == after[name], name
    if task.closed:
        assert (log.laps == run.laps).all()


def test_a_log_goes_through_all_that_a_run_does(tmp_path):
    log = log_of(run_of(CIRCLE, 1.0), CIRCLE)
    page = pc.report(log, tmp_path / "report.html").read_text(encoding="utf-8")  # with a film and the figures
    assert "the log of an arm" in page
    assert 'id="film"' in page
    assert "<figcaption>Errors</figcaption>" in page
    for name in ("log.mcap", "log.nc"):
        loaded = pc.Run.load(log.save(tmp_path / name))
        assert repr(pc.metrics(loaded)) == repr(pc.metrics(log))
    assert np.abs(pc.momentum_observer(log)[0, 5:]).max() < 0.05  # nothing but the motors acts
    assert len(log.to_trajectory(100.0).time) == 101


def test_velocities_that_are_missing_are_second_order_differences_of_irregular_times():
    rng, errors = np.random.default_rng(3), []
    for count in (200, 400):
        times = np.cumsum(rng.uniform(0.5, 1.5, count)) / count
        q = np.stack([np.sin(5 * times), np.cos(3 * times)], axis=-1)
        log = pc.Run.from_log(times, q)
        exact = np.stack([5 * np.cos(5 * times), -3 * np.sin(3 * times)], axis=-1)
        errors.append(np.abs(log.array("qd")[0] - exact).max())
        assert np.isnan(log.array("tau")).all()
        assert np.isnan(log.array("s")).all()
        assert log.joints == ["joint_1", "joint_2"]
    assert errors[0] / errors[1] > 2.5


def test_times_may_be_stamps_of_any_clock():
    passed, q = np.arange(50) * 0.01, np.zeros((50, 2))
    stamps = 1_700_000_000_123_456_789 + np.arange(50) * 10_000_000
    for times in (passed + 1.7e9, stamps.view("datetime64[ns]"), passed - 3.0):
        np.testing.assert_allclose(pc.Run.from_log(times, q).time, passed, atol=1e-6)
    whole = np.arange(50)  # seconds as integers
    with pytest.warns(PathControlWarning, match="apart"):
        np.testing.assert_array_equal(pc.Run.from_log(whole, q).time, whole)


def test_friction_is_identified_from_a_log():
    robot = pc.load_robot("cicese_2dof")
    to_and_fro = pc.Lissajous([0.8, 0.8], [3, 4], speed=1.3, phases=[0.2, 2.0], center=[0.2, 0.4])
    law = pc.ComputedTorque(robot, to_and_fro, K_p=400.0, K_v=40.0)
    run = pc.simulate(law, to_and_fro.q_d(np.array(0.0)), duration=10.0, progress=False)
    q, qd, tau = (run.array(name)[0] for name in ("q", "qd", "tau"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PathControlWarning)  # the start is beyond the torque limits
        log = pc.Run.from_log(run.time, q, qd, tau, robot)
    assert pc.identify_friction(log).to_dict() == pc.identify_friction(run).to_dict()


SLIPS = {
    "milliseconds": (lambda t, q, qd, tau: (t * 1e3, q, qd, tau), "milliseconds"),
    "nanoseconds": (lambda t, q, qd, tau: (t * 1e9, q, qd, tau), "nanoseconds"),
    "q in degrees": (lambda t, q, qd, tau: (t, np.rad2deg(q), qd, tau), "q is in degrees"),
    "all in degrees": (lambda t, q, qd, tau: (t, np.rad2deg(q), np.rad2deg(qd), tau), "did you mean degrees"),
    "qd in degrees": (lambda t, q, qd, tau: (t, q, np.rad2deg(qd), tau), "qd in deg/s"),
    "sign": (lambda t, q, qd, tau: (t, q, -qd, tau), "other sign"),
    "torques": (lambda t, q, qd, tau: (t, q, qd, 1e3 * tau), "N mm"),
    "joints": (lambda t, q, qd, tau: (t, q + np.array([3.0, -3.0]), qd, tau), "never nearer"),
    "gap": (lambda t, q, qd, tau: (t + (t > 1.0), q, qd, tau), "a gap of"),
}


@pytest.mark.parametrize("what", SLIPS)
def test_slips_are_told(what):
    change, said = SLIPS[what]
    run = run_of(EIGHT)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        pc.Run.from_log(*change(run.time, *(run.array(name)[0] for name in ("q", "qd", "tau"))), ROBOT, EIGHT)
    assert any(said in str(one.message) for one in told)


def test_a_sound_log_is_no_slip():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log_of(run_of(EIGHT), EIGHT)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([0.0, 0.1, 0.1], np.zeros((3, 2))), r"times\[2\] = 0.1 is not after"),
        (([0.0, 0.2, 0.1], np.zeros((3, 2))), "sort"),
        (([0.0, np.nan, 0.1], np.zeros((3, 2))), r"times\[1\]"),
        (([0.0], np.zeros((1, 2))), "two or more"),
        (([0.0, 0.1, 0.2], np.zeros((2, 3))), "transposed"),
        (([0.0, 0.1, 0.2], np.zeros(3)), r"q has shape \(3,\)"),
        (([0.0, 0.1], [[0.0, np.nan], [0.0, 0.0]]), r"q\[0, 1\]"),
        (([0.0, 0.1], np.zeros((2, 2)), np.zeros((2, 3))), "qd has shape"),
        (([0.0, 0.1], np.zeros((2, 2)), None, np.full((2, 2), np.inf)), "tau"),
        (([0.0, 0.1], np.zeros((2, 3)), None, None, ROBOT), r"expected \(2, 2\)"),
    ],
)
def test_what_is_no_log_is_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        pc.Run.from_log(*arguments)


def test_what_is_no_path_is_refused():
    with pytest.raises((InputError, TaskError), match="joints"):
        pc.Run.from_log([0.0, 0.1], np.zeros((2, 3)), task=CIRCLE)
    with pytest.raises(TaskError):
        pc.Run.from_log([0.0, 0.1], np.zeros((2, 2)), task="circle")
