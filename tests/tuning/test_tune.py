"""Tuning finds what is known in closed form, and says what limits cost; its numbers are those of simulations."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

import pathcontrol as pc
from pathcontrol.errors import InputError, MissingExtraError, UnknownNameError
from pathcontrol.sweeps.objectives import excess
from pathcontrol.tuning.problem import Terms
from pathcontrol.view.figures.style import INK

pytest.importorskip("pymoo")

ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
LAW = pc.ExtendedMotionPlan(ROBOT, CIRCLE, 100.0, 20.0, 5.0)
SQUARE = {"x": stats.uniform([-1.0, -1.0], [3.0, 3.0])}
A, B = np.array([0.2, 0.1]), np.array([1.0, 0.7])  # at a distance of 1
GAINS = {"K_p": stats.loguniform(100.0, 1e4), "k": stats.loguniform(1.0, 50.0)}


def placed(p, samples):
    """Simulations of one step that begin at x, with a velocity of c: what is measured is known in closed form."""
    c = p.get("c", np.zeros_like(p["x"]))
    return {"controller": LAW, "q": p["x"], "qd": c, "duration": 0.0025}


def distances(run):
    x, c = run.array("q")[:, 0], run.array("qd")[:, 0]
    return {name: np.linalg.norm(x - at, axis=-1) for name, at in (("to_a", A), ("to_b", B), ("to_c", c))}


def circle(p, samples):
    law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, p["K_p"][:, None], K_v=[45.0, 100.0], k=p["k"])
    start = np.tile([0.7, 1.2], (len(samples), 1))
    loop = pc.SampledLoop(encoders=True, velocity="difference", noise=pc.SensorNoise(position=1e-4, seed=2))
    return {"controller": law, "q": start, "duration": 0.1, "loop": loop, "plant": _plants(p, samples)}


def _plants(p, samples):
    return [ROBOT.with_payload(mass, "tool") for mass in p["mass"]] if "mass" in p else ROBOT


def quick(build=circle, space=GAINS, objectives="e_p_rms", **options):
    return pc.tune(build, space, objectives, **({"population": 6, "generations": 4, "progress": False} | options))


# --- known in closed form ----------------------------------------------------------------------------------------


def test_a_single_objective_at_its_limit():
    """The point of the disc around B that is nearest to A is on the line between them, at the edge of the disc."""
    found = quick(placed, SQUARE, "to_a", limits={"to_b": 0.4}, metrics=distances, population=20, generations=25)
    best = found.best()
    assert best.metrics["to_a"] == pytest.approx(0.6, abs=2e-3)
    np.testing.assert_allclose(best.parameters["x"], A + 0.6 * (B - A), atol=0.03)
    active = found.activity()["to_b"]
    assert active.share == pytest.approx(1.0, abs=2e-3)
    assert 0.56 - 1e-9 <= active.bought <= best.metrics["to_a"]  # 10 % more of the limit is worth 0.04 at most
    # the front of objective and limit is a + b = 1
    trade = found.trade("to_b")
    assert (trade["to_a"] + trade["to_b"] >= 1 - 1e-12).all()
    assert "100 % used" in str(found)


def test_a_limit_that_does_not_matter_is_not_active():
    found = quick(placed, SQUARE, "to_a", limits={"to_b": 1.5}, metrics=distances, population=20, generations=25)
    assert found.best().metrics["to_a"] < 5e-3
    active = found.activity()["to_b"]
    assert active.share == pytest.approx(1 / 1.5, abs=0.01)
    assert active.bought == found.best().metrics["to_a"]


def test_the_front_of_two_objectives_is_the_segment_between_their_best():
    found = quick(placed, SQUARE, ["to_a", "to_b"], metrics=distances, population=40, generations=25)
    front = found.front()
    total = (front["to_a"] + front["to_b"]).to_numpy()  # on the segment it is 1
    assert total.min() >= 1 - 1e-12
    assert np.median(total) < 1.005
    reached = front["to_a"].to_numpy()
    assert (np.diff(np.r_[0.0, reached, 1.0]) < 0.1).all()  # all along it


def test_the_knee_is_where_the_front_bends():
    """a² and b² at a + b = 1: the front √f + √g = 1 is symmetric, and bends most in its middle."""

    def squares(run):
        return {name: value**2 for name, value in distances(run).items()}

    found = quick(placed, SQUARE, ["to_a", "to_b"], metrics=squares, population=40, generations=25)
    knee = found.knee()
    assert knee.metrics["to_a"] == pytest.approx(0.25, abs=0.07)
    np.testing.assert_allclose(knee.parameters["x"], (A + B) / 2, atol=0.07)
    assert quick(placed, SQUARE, "to_a", metrics=distances).knee() is None


def test_the_worst_of_several_scenarios_is_least_in_their_middle():
    """The largest distance from two points is least half way between them."""
    scenarios = {"c": np.array([A, B])}
    found = quick(placed, SQUARE, "to_c", scenarios=scenarios, metrics=distances, population=20, generations=25)
    assert found.best().metrics["to_c"] == pytest.approx(0.5, abs=2e-3)
    np.testing.assert_allclose(found.best().parameters["x"], (A + B) / 2, atol=0.03)
    mean = quick(placed, SQUARE, "to_c", scenarios=scenarios, metrics=distances, reduce="mean", generations=2)
    x = mean.table()["x"].to_numpy()
    expected = (np.linalg.norm(x - A, axis=1) + np.linalg.norm(x - B, axis=1)) / 2
    np.testing.assert_allclose(mean.table()["to_c"], expected, rtol=1e-14)


@given(arrays(np.float64, (5, 3), elements=st.floats(-3, 3)), st.sampled_from([(None, 1.0), (0.5, None), (-1.0, 1.0)]))
def test_the_worst_keeps_a_limit_if_and_only_if_every_scenario_does(values, ends):
    bounds = (-np.inf if ends[0] is None else ends[0], np.inf if ends[1] is None else ends[1])
    worst = Terms({"f": "min"}, {"g": bounds}, "worst").reduce_scenarios("g", values)
    np.testing.assert_array_equal(excess(worst, bounds) <= 0, (excess(values, bounds) <= 0).all(1))
    np.testing.assert_array_equal(Terms({"f": "min"}, {}, "worst").reduce_scenarios("f", values), values.max(1))
    np.testing.assert_array_equal(Terms({"f": "max"}, {}, "worst").reduce_scenarios("f", values), values.min(1))


# --- made of simulations -----------------------------------------------------------------------------------------


def test_a_candidate_is_what_plain_simulations_of_its_scenarios_give():
    masses = [0.0, 1.5, 3.0]
    found = quick(objectives=["e_p_rms", "tau_noise"], scenarios={"mass": masses})
    for number in (0, 13, 23):
        one = found.candidate(number)
        values = {name: np.array([value]) for name, value in one.parameters.items()}
        runs = [
            pc.simulate(**circle(values | {"mass": [mass]}, [0]), first_rollout=3 * number + j, progress=False)
            for j, mass in enumerate(masses)
        ]
        alone = [pc.metrics(run) for run in runs]
        for name, value in one.metrics.items():
            assert value == max(numbers[name][0] for numbers in alone)


def test_the_seed_decides_and_the_chunk_does_not():
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    options = {"objectives": ["e_p_rms", "tau_noise"], "scenarios": {"mass": [0.0, 2.0]}, "generations": 2}
    whole = quick(**options)
    for chunk in (1, 7):
        assert quick(**options, chunk=chunk).table().identical(whole.table())
    assert not quick(seed=1).table().equals(quick(seed=2).table())
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002


def test_gains_are_searched_in_their_logarithm():
    first = quick(population=64, generations=1).table()
    for name, (low, high) in {"K_p": (100.0, 1e4), "k": (1.0, 50.0)}.items():
        values = np.sort(first[name].to_numpy())
        assert low <= values[0]
        assert values[-1] <= high
        # a Latin hypercube: one in each of 64 intervals of the logarithm
        assert (np.floor(64 * np.log(values / low) / np.log(high / low)) == np.arange(64)).all()


def test_candidates_that_diverge_are_beyond_every_limit():
    wild = {"K_p": stats.loguniform(300.0, 1e8), "k": [20.0]}
    found = quick(space=wild, limits={"tau_noise": 1e9}, population=10)
    lost = (found.table()["status"] == "diverged").to_numpy()
    assert 0 < lost.sum() < 40
    assert np.isnan(found.table()["e_p_rms"].to_numpy()[lost]).all()
    assert not np.isin(np.flatnonzero(lost), found.feasible()["sample"]).any()
    assert found.best() is not None
    every = quick(space={"K_p": stats.loguniform(1e7, 1e8), "k": [20.0]}, generations=2)
    assert every.best() is None
    assert every.nearest() is None
    assert every.front().sizes["sample"] == 0
    assert "12 diverged" in str(every)


def test_limits_that_nothing_keeps_are_told():
    found = quick(placed, SQUARE, "to_a", limits={"to_b": 0.1, "to_c": -1.0}, metrics=distances)
    assert found.best() is None
    assert found.activity() == {}
    assert repr(found) == "Tuning(24 candidates, 0 within limits)"
    table, nearest = found.table(), found.nearest()
    beyond = np.maximum(table["to_b"] / 0.1 - 1, 0) + np.maximum(table["to_c"] + 1, 0)
    assert nearest.number == int(np.argmin(beyond.to_numpy()))
    said = str(found).splitlines()
    assert said[1] == "no candidate keeps all limits"
    farthest = "to_c" if table["to_c"].min() + 1 > table["to_b"].min() / 0.1 - 1 else "to_b"
    assert farthest in said[2]
    assert "beyond" in said[2]


# --- stopped and resumed -----------------------------------------------------------------------------------------


class Stopped:
    """Builds until so many rollouts were asked for; then somebody presses Ctrl-C."""

    def __init__(self, after=10**9):
        self.asked, self.after = [], after

    def __call__(self, p, samples):
        self.asked.extend(samples.tolist())
        if len(self.asked) > self.after:
            raise KeyboardInterrupt
        return circle(p, samples)

    def describe(self):
        return {"name": "circle"}


@pytest.mark.parametrize("objectives", ["settling_time", ["e_p_rms", "settling_time"], ["settling_time", "e_p_rms"]])
def test_an_objective_that_is_never_finite_is_told(objectives):
    found = quick(space={"K_p": [100.0, 200.0], "k": [1.0, 2.0]}, objectives=objectives, generations=1)
    assert found.feasible().sizes["sample"] == 6
    assert "settling time of ‖e_p‖ is not finite for any candidate within the limits" in str(found)
    assert ("least ‖e_p‖ RMS" in str(found)) == (objectives != "settling_time")


def test_after_ctrl_c_whole_generations_are_kept():
    whole = quick()
    found = quick(Stopped(after=15), chunk=3)
    assert found.table().identical(whole.table().isel(sample=slice(0, 12)))
    assert "stopped after 2 of 4 generations" in repr(found)
    assert "in 2 generations of 4, then stopped" in str(found)
    with pytest.raises(KeyboardInterrupt):
        quick(Stopped(after=5), chunk=3)


def test_what_is_noted_is_not_computed_again(tmp_path):
    pytest.importorskip("pyarrow")
    options = {"scenarios": {"mass": [0.0, 2.0]}, "out": tmp_path / "out", "chunk": 5}
    whole = quick(Stopped(), scenarios=options["scenarios"])
    assert quick(Stopped(after=30), **options).generations == (2, 4)
    rest = Stopped()
    found = quick(rest, **options, resume=True)
    assert found.table().identical(whole.table())
    noted = pc.SweepResult(tmp_path / "out")
    assert noted.finished == noted.samples == 48
    assert rest.asked == list(range(29, 48))  # after two generations of 5 + 5 + 2 rollouts, and 5 of the third
    np.testing.assert_array_equal(noted.table()["mass"], [0.0, 2.0] * 24)
    np.testing.assert_array_equal(noted.table()["e_p_rms"].to_numpy().reshape(-1, 2).max(1), whole.table()["e_p_rms"])
    with pytest.raises(InputError, match=r"limits.tau_noise was null, is now \[\"-inf\", \"3.0\"\]"):
        quick(Stopped(), **options, resume=True, limits={"tau_noise": 3.0})


# --- refusals ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"objectives": "error"}, UnknownNameError, "expected a list of e_p_peak"),
        ({"objectives": []}, InputError, "expected names of metrics, or"),
        ({"limits": {"error": 1.0}}, UnknownNameError, "expected a list of e_p_peak"),
        ({"limits": {"tau_peak": (3, 1)}}, InputError, r"limits: tau_peak = \(3, 1\), expected the largest value"),
        ({"reduce": "least"}, UnknownNameError, "reduce = 'least', expected one of 'worst', 'mean'"),
        ({"population": 4}, InputError, "population = 4, expected a whole number from 5"),
        ({"generations": 0}, InputError, "generations = 0, expected a whole number from 1"),
        ({"chunk": 1.5}, InputError, "chunk = 1.5, expected a whole number from 1"),
        ({"seed": -1}, InputError, "seed = -1, expected a whole number from 0"),
        ({"space": {}}, InputError, "expected a dict with a parameter at least"),
        ({"scenarios": {"k": [1.0, 2.0]}}, InputError, "k: both searched and in the scenarios"),
        ({"scenarios": {"mass": stats.norm()}}, InputError, "mass is a norm distribution"),
        ({"metrics": lambda run: {"f": run.finish_time}}, UnknownNameError, "metric 'e_p_rms': expected one of f"),
    ],
)
def test_bad_arguments_are_refused(change, error, message, tmp_path):
    with pytest.raises(error, match=message):
        quick(out=tmp_path / "out", **change)
    assert change.get("metrics") or not list(tmp_path.iterdir())


def test_the_extra_is_named_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymoo.algorithms.moo.nsga2", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'pathcontrol\[tune\]'"):
        quick()


def test_names_that_are_not_there_are_told():
    found = quick(limits={"tau_noise": 1e9}, generations=1)
    with pytest.raises(UnknownNameError, match="objective 'tau_noise': expected one of e_p_rms"):
        found.best("tau_noise")
    with pytest.raises(UnknownNameError, match="limit 'e_p_rms': expected one of tau_noise"):
        found.trade("e_p_rms")


def test_the_figure_of_a_tuning_is_that_of_its_objective_and_its_limit():
    found = quick(limits={"tau_noise": 2.0})
    axes = pc.pareto_figure(found).axes[0]
    [stairs] = [line for line in axes.lines if line.get_drawstyle() == "steps-post"]
    np.testing.assert_array_equal(np.sort(stairs.get_ydata()), np.sort(found.trade("tau_noise")["tau_noise"]))
    assert any(np.array_equal(line.get_ydata(), [2.0, 2.0]) for line in axes.lines)


def test_the_figure_of_a_tuning_marks_its_best_candidate():
    found = quick(limits={"tau_noise": 10.0})
    lines = pc.pareto_figure(found).axes[0].lines
    [mark] = [line for line in lines if line.get_marker() == "o" and line.get_markerfacecolor() == INK]
    assert list(mark.get_ydata()) == [found.best().metrics["tau_noise"]]
