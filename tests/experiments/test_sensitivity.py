"""How sure the reproduction is: what is varied, how it is counted, and what the command leaves behind."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from pathcontrol.cli import main
from pathcontrol.comparison.paper import PERIOD, paper_task
from pathcontrol.errors import InputError
from pathcontrol.experiments import reproduce, sensitivity, sensitivity_page, sensitivity_summary
from pathcontrol.experiments.reproduce import PAPER, paper_experiment
from pathcontrol.experiments.sensitivity import (
    NOMINAL,
    SINGLE,
    WINDOWS,
    Combinations,
    EulerPlan,
    combine_experiments,
    make_combinations,
    window_peaks,
)
from pathcontrol.experiments.sensitivity_summary import NEAR, furthest, summarise
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation.simulate import simulate
from pathcontrol.sweeps import chunk as compute
from pathcontrol.view.figures import style
from pathcontrol.view.report import sensitivity_section

PEAKS = ("e_p_peak_deg", "e_v_peak_deg_s")


def columns(rows, experiment):
    """The parameters of some rows of settings, as a sweep gives them to what builds them."""
    names = {name: np.array([row[name] for row in rows]) for name in NOMINAL}
    return names | {"experiment": np.array([experiment] * len(rows))}


@pytest.mark.parametrize("experiment", PAPER)
def test_coulomb_friction_moves_the_peaks_in_proportion_about_those_of_reproduce(experiment):
    rows = [NOMINAL, NOMINAL | {"coulomb": [0.9, 0.9]}, NOMINAL | {"coulomb": [1.1, 1.1]}]
    [(order, arguments)] = Combinations()(columns(rows, experiment), np.arange(3))
    assert_array_equal(order, [0, 1, 2])
    peaks = window_peaks(simulate(**arguments, progress=False))
    published = paper_experiment(experiment, load_robot("cicese_2dof"), progress=False, engine="auto").peaks
    for name, signal in zip(PEAKS, ("e_p", "e_v"), strict=True):
        nominal, less, more = np.rad2deg(peaks[f"{signal} second half"])
        assert nominal == published[name]  # to the last bit: the settings are those of the table
        # the errors are linear in the friction that is left, but for the arm's nonlinearity and the encoders' rounding
        assert less / nominal == pytest.approx(0.9, abs=0.03)
        assert more / nominal == pytest.approx(1.1, abs=0.03)


def test_windows_end_with_the_run_and_a_longer_one_has_no_smaller_peak():
    assert {end for _, end in WINDOWS.values()} == {reproduce.DURATION}
    law = Combinations()._controller({"experiment": "projection"})
    peaks = window_peaks(simulate(law, [0.7, 1.2], duration=reproduce.DURATION, progress=False))
    for signal in ("e_p", "e_v"):
        assert peaks[f"{signal} from 2 s"] >= peaks[f"{signal} second half"] >= peaks[f"{signal} last lap"]


def test_a_single_change_changes_one_setting_and_the_cloud_stays_around_what_is_published():
    design = make_combinations(60)
    for i, (_, _, change) in enumerate(SINGLE):
        differing = [name for name in NOMINAL if not np.array_equal(design[name][1 + i], NOMINAL[name])]
        assert differing == list(change)
    cloud = {name: values[1 + len(SINGLE) :] for name, values in design.items()}
    for name in ("coulomb", "viscous"):
        assert cloud[name].shape == (60, 2)
        assert (abs(cloud[name] - 1) <= 0.1).all()
        assert cloud[name].min() < 0.905  # a Latin hypercube has one in each sixtieth
        assert cloud[name].max() > 1.095
    for name in ("filter_hz", "encoders", "delay", "start", "plan", "window"):
        values, counts = np.unique(cloud[name], return_counts=True)
        assert set(counts) == {60 // len(values)}, name  # each as often as any other


def test_every_combination_is_simulated_with_both_laws_and_batches_share_what_they_must():
    design = combine_experiments(make_combinations(7)).design()
    pairs = sorted(zip(design["combination"].tolist(), design["experiment"].tolist(), strict=True))
    assert pairs == [(i, name) for i in range(1 + len(SINGLE) + 7) for name in sorted(PAPER)]
    parts = Combinations()(design, np.arange(len(pairs)))
    assert_array_equal(np.sort(np.concatenate([rows for rows, _ in parts])), np.arange(len(pairs)))
    for rows, arguments in parts:
        loop, law = arguments["loop"], arguments["controller"]
        for row in rows:
            assert loop.filter_hz == (design["filter_hz"][row] or None)
            assert (loop.encoders, loop.delay) == (design["encoders"][row], design["delay"][row])
            assert (type(law).__name__ == "Projection") == (design["experiment"][row] == "projection")
        assert_allclose(arguments["plant"].friction.viscous, law.robot.friction.viscous * design["viscous"][rows])


def test_eulers_plan_is_eulers():
    law = EulerPlan(load_robot("cicese_2dof"), paper_task(), 800.0, [45.0, 100.0], 20.0)
    z = np.array([[0.3]])
    out = law.law(0.0, np.array([[0.7, 1.2]]), np.array([[0.1, -0.2]]), z)
    assert_array_equal(law.advance(z, out, PERIOD)[:, 0], z[:, 0] + PERIOD * out.sdot)


@given(
    cloud=st.integers(1, 6).flatmap(
        lambda n: st.lists(st.lists(st.floats(0.6, 1.6), min_size=4, max_size=4), min_size=n, max_size=n)
    )
)
def test_fractions_and_effects_are_those_of_a_count(cloud):
    """Peaks that are the paper's times known factors: the first rows are nominal and single changes of (1 + i) %."""
    singles = [[1 + (i + 1) / 100] * 4 for i in range(len(SINGLE))]
    factors = np.array([[1.0] * 4, *singles, *cloud]).T
    flat = iter(factors)
    peaks = {key: {name: PAPER[key][name] * next(flat) for name in PEAKS} for key in PAPER}
    summary = summarise(peaks)
    assert summary["samples"] == len(cloud)
    for near in NEAR:
        fraction = sum(all(abs(f - 1) <= near + 1e-12 for f in row) for row in cloud) / len(cloud)
        exact = sum(all(abs(f - 1) <= near - 1e-12 for f in row) for row in cloud) / len(cloud)
        assert exact <= summary["fractions"][f"all_four_within_{100 * near:.0f}_percent"] <= fraction
    for i, effect in enumerate(summary["effects"]):
        assert (effect["setting"], effect["value"]) == SINGLE[i][:2]
        assert_allclose([v for own in effect["change_percent"].values() for v in own.values()], i + 1, atol=1e-9)
    ratios = [(17.2 * row[3]) / (14.5 * row[1]) for row in cloud]
    assert_allclose([summary["e_v_ratio"][name] for name in ("least", "largest")], [min(ratios), max(ratios)])
    assert furthest(peaks)[0] == 0
    assert all("nan" not in sentence for sentence in sensitivity_page.sentences(summary))


@pytest.fixture
def brief(monkeypatch):
    """The same study of a tenth of a second."""
    monkeypatch.setattr(sensitivity, "DURATION", 0.1)
    windows = {"second half": (0.05, 0.1), "from 2 s": (0.02, 0.1), "last lap": (0.066, 0.1)}
    monkeypatch.setattr(sensitivity, "WINDOWS", windows)
    monkeypatch.setattr(sensitivity_summary, "WINDOWS", windows)


@pytest.mark.usefixtures("brief")
def test_what_was_interrupted_goes_on_and_what_is_done_is_not_done_again(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    simulated, original = [], compute.simulate

    def counted(*args, **options):
        simulated.append(len(options["q"]))
        if len(simulated) == 12:
            raise KeyboardInterrupt
        return original(*args, **options)

    monkeypatch.setattr(compute, "simulate", counted)
    monkeypatch.setattr(sensitivity, "_CHUNK", 5)
    with pytest.raises(KeyboardInterrupt):
        sensitivity_page.sensitivity(tmp_path, 3, progress=False)
    before = len(list((tmp_path / "sensitivity" / "chunks").glob("*.parquet")))
    assert before >= 1
    assert not (tmp_path / "sensitivity.html").exists()
    summary = sensitivity_page.sensitivity(tmp_path, 3, progress=False)
    rollouts = 2 * (1 + len(SINGLE) + 3)
    assert sum(simulated) < rollouts + 5 + max(simulated)  # one chunk at most is done twice
    assert json.loads((tmp_path / "sensitivity.json").read_text()) == summary
    page = (tmp_path / "sensitivity.html").read_text()
    assert "How sure is this?" in page
    assert "<script" not in page
    assert "http" not in page.replace("http-equiv", "").partition("data:image")[0]
    assert {"sensitivity.svg", "sensitivity.png"} < {file.name for file in tmp_path.iterdir()}
    done = len(simulated)
    monkeypatch.setattr(style, "save_figure", lambda *_: None)  # as these are drawn already
    monkeypatch.setattr(sensitivity_section, "sensitivity_page", lambda *_: page)
    assert sensitivity_page.sensitivity(tmp_path, 3, progress=False) == summary
    assert len(simulated) == done
    with pytest.raises(InputError, match="another definition"):
        sensitivity_page.sensitivity(tmp_path, 4, progress=False)


def call(*arguments):
    return CliRunner().invoke(main, [*map(str, arguments)], catch_exceptions=False)


def test_the_command_adds_it_to_its_json(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(reproduce, "reproduce", lambda out: {"seconds": 0.0})

    def vary(out, samples):
        asked.append((out, samples))
        return {"fractions": {}, "effects": []}

    monkeypatch.setattr(sensitivity_page, "sensitivity", vary)
    done = call("reproduce", "--out", tmp_path, "--sensitivity", "--json")
    assert json.loads(done.stdout)["sensitivity"] == {"fractions": {}, "effects": []}
    call("reproduce", "--out", tmp_path, "--sensitivity", "--samples", 7, "--json")
    assert asked == [(tmp_path, 300), (tmp_path, 7)]
    assert "sensitivity" not in json.loads(call("reproduce", "--out", tmp_path, "--json").stdout)


def test_samples_count_nothing_without_it(tmp_path):
    done = call("reproduce", "--out", tmp_path, "--samples", 7)
    assert done.exit_code == 2
    assert "--sensitivity" in done.output
