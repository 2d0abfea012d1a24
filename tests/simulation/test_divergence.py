"""Rollouts that diverge are marked, stop nobody, and change no other to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pathcontrol import (
    Circle,
    ComputedTorque,
    ContinuousTime,
    ExtendedMotionPlan,
    InputError,
    Line,
    PathTask,
    Projection,
    Run,
    SampledLoop,
    SimulationError,
    contour_error,
    error_bands_figure,
    error_figure,
    lyapunov,
    metrics,
    path_figure,
    report,
    simulate,
    simulate_sequence,
    speed_figure,
    torque_figure,
)

START = np.deg2rad([40.0, 70.0])
LOOP = SampledLoop(velocity="difference", delay=1e-3, filter_hz=100.0)
WILD = 1e6  # 1/s², a position gain that no hold of 2.5 ms survives


class Hole(Circle):
    """A circle with a stretch where q_d is no number."""

    at = PathTask.at

    def q_d(self, s):
        return np.where(np.abs(np.asarray(s)[..., None] - 0.1227) < 0.02, np.nan, super().q_d(s))


def law(kind, arm, task, K_p):
    """A law whose position gains are a column, one for each rollout."""
    if kind == "projection":
        return Projection(arm, task, K_p, [45.0, 100.0])
    if kind == "tracking":
        return ComputedTorque(arm, task, K_p, [45.0, 100.0])
    return ExtendedMotionPlan(arm, task, K_p, [45.0, 100.0], 20.0)


def gains(*wild: bool) -> np.ndarray:
    return np.where(wild, WILD, 800.0)[:, None]


def states(rollouts: int) -> np.ndarray:
    return START + 0.1 * np.random.default_rng(5).normal(size=(rollouts, 2))


@settings(max_examples=10)
@given(st.lists(st.booleans(), min_size=2, max_size=5), st.sampled_from(["plan", "projection", "tracking"]))
def test_the_others_are_what_they_would_be_without_it(arm, circle, wild, kind):
    wild = np.array([*wild, False])  # one is left at least
    q = states(len(wild))
    together = simulate(law(kind, arm, circle, gains(*wild)), q, duration=0.4, loop=LOOP, progress=False)
    assert_array_equal(together.status == "diverged", wild)
    alone = simulate(law(kind, arm, circle, gains(*wild[~wild])), q[~wild], duration=0.4, loop=LOOP, progress=False)
    for name in together.data.data_vars:
        assert_array_equal(together.array(name)[~wild], alone.array(name), err_msg=name)
    assert_array_equal(together.laps[~wild], alone.laps)


def test_it_is_marked_from_the_moment_on(arm, circle):
    run = simulate(law("plan", arm, circle, gains(False, True, True)), states(3), duration=0.4, progress=False)
    assert list(run.status) == ["running", "diverged", "diverged"]
    assert repr(run).endswith("2 of 3 diverged)")
    assert_array_equal(np.isnan(run.diverged_time), [True, False, False])
    assert run.reason[0] == ""
    assert all("left all bounds" in reason and "shorten the period" in reason for reason in run.reason[1:])
    for i, time in enumerate(run.diverged_time):
        later = run.time >= time
        for name in run.data.data_vars:
            values = run.array(name)[i]
            if name == "regular":
                assert not values[later].any()
            else:
                assert np.isnan(values[later]).all(), name
                assert np.isfinite(values[~later]).all(), name
        assert (np.abs(run.array("q")[i, ~later]) < 1e6).all()
        assert (np.abs(run.array("qd")[i, ~later]) < 1e6).all()


def test_when_it_diverges_does_not_depend_on_the_others(arm, circle):
    with pytest.raises(SimulationError, match=r"rollout 0 diverged at t = .* s: its state left") as error:
        simulate(law("plan", arm, circle, WILD), states(3)[1], duration=0.4, progress=False)
    run = simulate(law("plan", arm, circle, gains(False, True, False)), states(3), duration=0.4, progress=False)
    alone = error.value.run
    assert alone.diverged_time[0] == run.diverged_time[1]
    assert alone.time[-1] == alone.diverged_time[0]  # nothing is simulated when nobody is left
    for name in run.data.data_vars:
        assert_array_equal(run.array(name)[1, : len(alone.time)], alone.array(name)[0])


def test_a_batch_of_none_but_diverged_rollouts_is_an_error(arm, circle):
    with pytest.raises(SimulationError, match=r"all 3 rollouts diverged, the last one, \d, at t = .* s") as error:
        simulate(law("plan", arm, circle, gains(True, True, True)), states(3), duration=0.4, progress=False)
    run = error.value.run
    assert list(run.status) == ["diverged"] * 3
    assert all(np.isnan(value).all() for value in metrics(run).values())


def test_torques_that_are_no_numbers_are_a_reason(arm):
    task = Hole(1.0, 2.0)
    q = task.center + np.array([[1.0, 0.05], [-1.0, 0.05]])
    run = simulate(Projection(arm, task, 800.0, [45.0, 100.0]), q, duration=0.3, progress=False)
    assert list(run.status) == ["diverged", "running"]
    assert "look for a NaN in the task" in run.reason[0]
    before = run.time < run.diverged_time[0]
    assert np.isfinite(run.array("tau_demand")[0, before]).all()


def test_a_law_without_numbers_at_the_start_is_an_error_for_all_and_a_mark_for_some(arm):
    task = Hole(1.0, 2.0)
    q = np.array([[np.cos(0.12), np.sin(0.12)], [-1.0, 0.05]])
    controller = Projection(arm, task, 800.0, [45.0, 100.0])
    with pytest.raises(InputError, match="at the start, expected numbers"):
        simulate(controller, q[0], duration=0.1, progress=False)
    run = simulate(controller, q, duration=0.1, progress=False)
    assert list(run.status) == ["diverged", "running"]
    assert run.diverged_time[0] == 0.0
    assert run.laps[0] == 0


@pytest.mark.parametrize("until", ["end", "duration"])
def test_nobody_waits_for_it(arm, until):
    """A run ends when all others are finished, at the time they would be without it."""
    task = Line([0.2, -0.3], [0.9, 0.6], 1.5)
    q, options = [0.2, -0.3], {"duration": 3.0, "until": until, "progress": False}
    for kind in ("plan", "tracking"):
        run = simulate(law(kind, arm, task, gains(True, False)), [q, q], **options)
        alone = simulate(law(kind, arm, task, 800.0), q, **options)
        assert list(run.status) == ["diverged", "finished"]
        assert_array_equal(run.finish_time, [np.nan, alone.finish_time[0]])
        assert_array_equal(run.time, alone.time)
        found = metrics(run)
        assert found.keys() == metrics(alone).keys()
        for name, (lost, kept) in found.items():
            assert np.isnan(lost), name
            assert kept == pytest.approx(metrics(alone)[name][0], rel=1e-12), name  # means are summed in another order


def test_laps_are_counted_until_then(ideal_arm, circle):
    class Late(ComputedTorque):
        """Loses its numbers 4 s after the start, in rollout 0."""

        def law(self, t, q, qd, z):
            out = super().law(t, q, qd, z)
            return out._replace(tau=np.where((np.arange(len(q)) == 0)[:, None] & (t >= 4.0), np.inf, out.tau))

    run = simulate(Late(ideal_arm, circle, 400.0, 40.0), states(2), duration=7.0, laps=2, progress=False)
    assert list(run.status) == ["diverged", "finished"]
    assert run.diverged_time[0] == pytest.approx(4.0)
    assert list(run.laps) == [1, 2]


def test_it_survives_the_disk_and_is_drawn(arm, circle, tmp_path):
    controller = law("plan", arm, circle, gains(True, False))
    run = simulate(controller, states(2), duration=0.4, progress=False)
    again = Run.load(run.save(tmp_path / "run.nc"))
    assert again.data.identical(run.data)
    assert list(again.status) == ["diverged", "running"]
    assert list(again.reason) == list(run.reason)
    for figure in (error_figure, path_figure, torque_figure, speed_figure):
        figure(run, rollout=0)
    error_bands_figure(run)
    assert_array_equal(np.isnan(contour_error(run)), np.isnan(run.array("s")))
    assert_array_equal(np.isnan(lyapunov(controller, run).V), np.isnan(run.array("s")))


def test_a_sequence_is_marked_where_it_diverges(arm):
    first, second = Line([0.2, -0.3], [0.6, 0.2], 1.5), Line([0.6, 0.2], [0.9, 0.6], 1.5)
    laws = [law("plan", arm, first, 800.0), law("plan", arm, second, WILD), law("plan", arm, first, 800.0)]
    with pytest.raises(SimulationError, match=r"rollout 0 diverged at t = .* s: its state left") as error:
        simulate_sequence(laws, [0.2, -0.3], duration=3.0, gaps=True, progress=False)
    run = error.value.run
    assert run.status[0] == "diverged"
    assert list(run["path_status"].to_numpy()) == ["finished", "diverged", "waiting"]
    assert run.time[-1] == pytest.approx(run.diverged_time[0])
    assert run.path(0).status[0] == "finished"
    part = run.path(1)
    assert part.status[0] == "diverged"
    assert part.diverged_time[0] == pytest.approx(part.time[-1])


def test_continuous_time_goes_on_without_it(ideal_arm):
    """They share an integrator, so that its tolerance is what they may differ by."""
    task = Hole(1.0, 2.0)
    q = np.array([[1.0, 0.0], [-1.0, 0.1], [0.0, 1.2]])
    controller = Projection(ideal_arm, task, 400.0, 40.0)
    run = simulate(controller, q, duration=0.5, loop=ContinuousTime(), progress=False)
    alone = simulate(controller, q[1:], duration=0.5, loop=ContinuousTime(), progress=False)
    assert list(run.status) == ["diverged", "running", "running"]
    assert "NaN in the task" in run.reason[0]
    assert np.isnan(run.array("q")[0, run.time >= run.diverged_time[0]]).all()
    assert np.isfinite(run.array("q")[1:]).all()
    assert np.abs(run.array("q")[1:] - alone.array("q")).max() < 1e-6
    with pytest.raises(SimulationError, match=r"rollout 0 diverged at t = .* s: its law asks"):
        simulate(controller, q[0], duration=0.5, loop=ContinuousTime(), progress=False)


def test_a_report_says_so(arm, circle, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])  # they take most of the time
    run = simulate(law("plan", arm, circle, gains(True, False)), states(2), duration=0.4, progress=False)
    page = report(run, tmp_path / "report.html")  # with a film of rollout 0 until it diverged
    assert "2 rollouts, 1 diverged" in page.read_text(encoding="utf-8")
