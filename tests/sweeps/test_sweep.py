"""Sweeps: a table is what simulations one by one give, however it was cut, killed and resumed."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from patience import PATIENCE
from scipy import stats

import pathcontrol as pc
from pathcontrol.errors import InputError, MissingExtraError, UnknownNameError

pytest.importorskip("pyarrow")

ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
LINE = pc.Line([0.7, 1.2], [0.6, 1.0], 1.0)
LOOP = pc.SampledLoop(encoders=True, velocity="difference")
SPACE = pc.Space.sobol(
    {"K_p": stats.loguniform(100.0, 1e4), "k": stats.uniform(1.0, 50.0), "q": stats.norm([0.7, 1.2], [0.3, 0.3])}, 14
)
STIFFER = pc.Space.given({"K_p": [300.0, 3000.0, 900.0]})
# gains of 3e5 and more diverge with this period
WILD = pc.Space.given({"K_p": [800.0, 1e7, 300.0, 3e7, 1e7, 500.0], "k": [20.0] * 6, "q": [[0.7, 1.2]] * 6})


def circle(p, samples):
    law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, p["K_p"][:, None], K_v=[45.0, 100.0], k=p["k"])
    return {"controller": law, "q": p["q"], "duration": 0.2, "loop": LOOP}


def line(p, samples):
    law = pc.ExtendedMotionPlan(ROBOT, LINE, p["K_p"][:, None], K_v=[45.0, 100.0], k=2.0, friction="full")
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 3.0}


def one_by_one(build, space):
    """The metrics of each sample, simulated alone; None where it diverged."""
    design = space.design()
    for i in range(space.samples):
        try:
            run = pc.simulate(**build({name: v[[i]] for name, v in design.items()}, np.array([i])), progress=False)
        except pc.SimulationError:
            yield None
        else:
            yield {name: values[0] for name, values in pc.metrics(run).items()}


def assert_same_numbers(table, expected):
    for i, alone in enumerate(expected):
        assert (table.status[i] == "diverged") == (alone is None)
        for name in set(table.data_vars) - {"status", "reason", "diverged_time", "finish_time"}:
            want = np.nan if alone is None else alone[name]
            np.testing.assert_array_equal(table[name][i], want, err_msg=f"{name} of sample {i}")


@pytest.mark.parametrize(("build", "space"), [(circle, SPACE), (circle, WILD), (line, STIFFER)])
def test_a_table_is_what_simulations_one_by_one_give(build, space, tmp_path):
    result = pc.sweep(build, space, tmp_path, progress=False)
    assert result.finished == result.samples == space.samples
    assert_same_numbers(result.table(), one_by_one(build, space))


SEVEN = pc.Space.sobol(
    {"K_p": stats.loguniform(100.0, 1e4), "k": stats.uniform(1.0, 50.0), "q": stats.norm([0.7, 1.2], [0.3, 0.3])}, 7
)


@pytest.mark.parametrize("space", [SEVEN, WILD], ids=["sobol", "wild"])
def test_chunks_of_any_size_give_the_same_table_and_the_same_histories(space, tmp_path):
    keep = pc.Keep(worst=2, by="e_p_peak", random=1, diverged=1)
    whole = pc.sweep(circle, space, tmp_path / "whole", keep=keep, chunk=7, progress=False)
    table, histories = whole.table(), {sample: whole.run(sample).data for sample in whole.kept}
    for chunk in (1, 3):
        other = pc.sweep(circle, space, tmp_path / str(chunk), keep=keep, chunk=chunk, progress=False)
        assert other.table().identical(table), chunk
        assert other.kept == whole.kept
        for sample, history in histories.items():
            assert other.run(sample).data.identical(history)


def test_the_histories_kept_are_the_worst_the_random_ones_and_the_first_that_diverged(tmp_path):
    keep = pc.Keep(worst=3, by="contour_error_peak")
    result = pc.sweep(circle, SPACE, tmp_path / "a", keep=keep, chunk=4, progress=False)
    order = np.argsort(-result.table()["contour_error_peak"].to_numpy(), kind="stable")
    assert result.kept == sorted(order[:3].tolist())
    run = result.run(result.kept[0])
    peak = pc.metrics(run)["contour_error_peak"][0]
    assert peak == result.table()["contour_error_peak"][result.kept[0]]
    assert run.config["sweep"]["q"] == SPACE.design()["q"][result.kept[0]].tolist()
    keep = pc.Keep(worst=1, by="e_p_peak", diverged=2)
    wild = pc.sweep(circle, WILD, tmp_path / "b", keep=keep, chunk=2, progress=False)
    status = wild.table()["status"].to_numpy()
    assert [status[i] for i in wild.kept].count("diverged") == 2
    assert set(np.flatnonzero(status == "diverged")[:2]) < set(wild.kept)


def test_a_run_kept_is_that_of_the_sample_alone(tmp_path):
    space = pc.Space.given({"K_p": [300.0, 3000.0]})
    result = pc.sweep(line, space, tmp_path, keep=pc.Keep(random=2), progress=False)
    for i in range(2):
        alone = pc.simulate(**line({"K_p": space.design()["K_p"][[i]]}, [i]), progress=False)
        assert result.run(i).data.drop_vars("rollout").equals(alone.data.drop_vars("rollout"))
    assert len({len(result.run(i).time) for i in range(2)}) == 2  # each ends when it is finished


def test_noise_goes_by_the_number_of_the_sample(tmp_path):
    def noisy(p, samples):
        loop = pc.SampledLoop(encoders=True, velocity="difference", noise=pc.SensorNoise(position=1e-3, seed=3))
        return circle(p, samples) | {"loop": loop}

    tables = [pc.sweep(noisy, SPACE, tmp_path / str(k), chunk=k, progress=False).table() for k in (3, 14)]
    assert tables[0].identical(tables[1])

    def torn(p, samples):
        rows = np.array([0, 2])
        return [(rows, noisy({name: v[rows] for name, v in p.items()}, samples))]

    with pytest.raises(InputError, match="have to follow one another"):
        pc.sweep(torn, SPACE, tmp_path / "torn", progress=False)


def test_parts_of_a_chunk_may_be_built_apart(tmp_path):
    def apart(p, samples):
        odd = samples % 2 == 1
        parts = [np.flatnonzero(odd), np.flatnonzero(~odd)]
        return [(rows, circle({name: v[rows] for name, v in p.items()}, samples[rows])) for rows in parts if len(rows)]

    together = pc.sweep(circle, SPACE, tmp_path / "a", progress=False).table()
    assert pc.sweep(apart, SPACE, tmp_path / "b", chunk=5, progress=False).table().identical(together)


def test_metrics_are_those_wanted(tmp_path):
    named = pc.sweep(circle, SPACE, tmp_path / "a", metrics=["e_p_peak"], progress=False).table()
    assert set(named.data_vars) == {"status", "finish_time", "diverged_time", "reason", "e_p_peak"}

    def fastest(run):
        return {"fastest": np.abs(run.array("qd")).max((1, 2))}

    own = pc.sweep(circle, WILD, tmp_path / "b", metrics=fastest, keep=pc.Keep(worst=1, by="fastest"), progress=False)
    lost = own.table()["status"] == "diverged"
    assert np.isnan(own.table()["fastest"][lost]).all()
    assert own.kept == [int(np.nanargmax(own.table()["fastest"]))]


# --- killed at any moment ---------------------------------------------------------------------------------------

KEEP = pc.Keep(worst=1, by="e_p_peak", random=1)
FEW = pc.Space.random({"K_p": stats.loguniform(100.0, 1e4), "k": [2.0, 20.0], "q": stats.norm([0.7, 1.2], 0.3)}, 4)


def go_on(folder, chunk=2):
    metrics = ["e_p_peak", "contour_error_rms"]
    return pc.sweep(circle, FEW, folder, metrics=metrics, keep=KEEP, chunk=chunk, resume=True, progress=False)


def dying(folder, moment, before):
    """A sweep whose process is killed when its ``moment``-th file is about to appear, or just did."""
    replace, count = Path.replace, iter(range(1000))

    def counting(self, target):
        now = next(count) == moment
        if now and before:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(self, target)
        if now:
            os.kill(os.getpid(), signal.SIGKILL)

    Path.replace = counting
    go_on(folder)


def in_a_process(target, *arguments):
    process = multiprocessing.get_context("fork").Process(target=target, args=arguments)
    process.start()
    return process


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return go_on(tmp_path_factory.mktemp("undisturbed"))


def assert_undisturbed(result, undisturbed):
    assert result.table().identical(undisturbed.table())
    assert result.kept == undisturbed.kept
    assert not list(result.folder.rglob(".*"))


@pytest.mark.parametrize("before", [True, False])
def test_killed_at_each_file_and_resumed_the_table_is_the_same(before, undisturbed, tmp_path):
    moment = 0
    while True:
        folder = tmp_path / str(moment)
        process = in_a_process(dying, folder, moment, before)
        process.join(PATIENCE)
        if process.exitcode == 0:
            break
        assert process.exitcode == -signal.SIGKILL
        assert_undisturbed(go_on(folder), undisturbed)
        moment += 1
    assert moment > 4  # the manifest, two chunks and a history of each


def test_killed_at_random_moments_over_and_over(undisturbed, tmp_path):
    rng, deaths = random.Random(4), 0
    for chunk in (1, 2, 5, 1):  # another size of chunks each time
        process = in_a_process(go_on, tmp_path, chunk)
        time.sleep(rng.uniform(0.02, 0.25))
        process.kill()
        process.join(PATIENCE)
        deaths += process.exitcode == -signal.SIGKILL
    assert deaths
    assert_undisturbed(go_on(tmp_path), undisturbed)


def test_resuming_computes_only_what_is_missing(tmp_path):
    asked, undisturbed = [], pc.sweep(circle, SPACE, tmp_path / "undisturbed", progress=False)

    class Counting:
        def __call__(self, p, samples):
            asked.extend(samples.tolist())
            if len(asked) > 8:
                raise KeyboardInterrupt
            return circle(p, samples)

        def describe(self):
            return {"name": "counting"}

    with pytest.raises(KeyboardInterrupt):
        pc.sweep(Counting(), SPACE, tmp_path / "a", chunk=4, progress=False)
    assert pc.SweepResult(tmp_path / "a").finished == 8
    asked.clear()
    done = pc.SweepResult(tmp_path / "a")
    assert "8 of 14 samples" in repr(done)
    np.testing.assert_array_equal(done.table()["e_p_peak"], undisturbed.table()["e_p_peak"][:8])

    class Rest(Counting):
        def __call__(self, p, samples):
            asked.extend(samples.tolist())
            return circle(p, samples)

    result = pc.sweep(Rest(), SPACE, tmp_path / "a", chunk=4, resume=True, progress=False)
    assert asked == list(range(8, 14))
    assert result.table().identical(undisturbed.table())
    pc.sweep(Rest(), SPACE, tmp_path / "a", chunk=4, resume=True, progress=False)
    assert asked == list(range(8, 14))


# --- refusals ----------------------------------------------------------------------------------------------------


def test_a_sweep_of_another_definition_is_refused_by_what_differs(tmp_path):
    pc.sweep(circle, SPACE, tmp_path, progress=False)
    with pytest.raises(InputError, match=r"holds a sweep already; resume it \(resume=True\), or name another folder"):
        pc.sweep(circle, SPACE, tmp_path, progress=False)
    other = pc.Space.sobol({"K_p": stats.loguniform(100.0, 2e4), "k": stats.uniform(1.0, 50.0), "q": [1, 2]}, 14)
    cases = [
        ({"seed": 1}, "seed was 0, is now 1"),
        ({"space": other}, r"space.parameters.K_p.args was \[100.0, 10000.0\], is now \[100.0, 20000.0\]"),
        ({"build": line}, 'build.function was "circle", is now "line"'),
        ({"metrics": ["e_p_peak"]}, r'metrics was null, is now \["e_p_peak"\]'),
        ({"keep": pc.Keep(random=2)}, "keep.random was 0, is now 2"),
    ]
    for change, message in cases:
        arguments = {"build": circle, "space": SPACE} | change
        with pytest.raises(InputError, match=message):
            pc.sweep(out=tmp_path, resume=True, progress=False, **arguments)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["samples"] == 14
    assert set(manifest["versions"][0]) == {"python", "pathcontrol", "pin", "numpy", "scipy"}


def test_other_versions_are_noted(tmp_path):
    pc.sweep(circle, SPACE, tmp_path, progress=False)
    file = tmp_path / "manifest.json"
    manifest = json.loads(file.read_text())
    manifest["versions"][0]["numpy"] = "0.1"
    file.write_text(json.dumps(manifest))
    pc.sweep(circle, SPACE, tmp_path, resume=True, progress=False)
    assert [v["numpy"] for v in json.loads(file.read_text())["versions"]] == ["0.1", np.__version__]


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"chunk": 0}, InputError, "chunk = 0, expected a whole number from 1"),
        ({"seed": -1}, InputError, "seed = -1, expected a whole number from 0"),
        ({"space": {"k": [1]}}, InputError, "expected a Space: Space.grid"),
        ({"keep": 3}, InputError, "keep = 3, expected a Keep"),
        ({"keep": pc.Keep(worst=1, by="error")}, UnknownNameError, "keep.by = 'error', expected a metric"),
        ({"keep": pc.Keep(worst=1, by="status")}, UnknownNameError, "keep.by = 'status', expected a metric: e_p_peak"),
        ({"metrics": ["error"]}, UnknownNameError, "expected a list of e_p_peak"),
        ({"metrics": lambda run: {"k": run.finish_time}}, InputError, "k: both a parameter and a metric"),
        ({"metrics": lambda run: {"one": 1.0}}, InputError, r"the metric one has shape \(\), expected \(14,\)"),
        ({"build": lambda p, i: circle(p, i) | {"progress": True}}, InputError, "progress, which the sweep sets"),
        (
            {"build": lambda p, i: circle(p, i) | {"q": [[0.7, 1.2]] * 2}},
            InputError,
            r"samples 0 to 13: .*K_p of shape \(14, 1\) .*expected a row for each of 2",
        ),
        ({"build": lambda p, i: line({"K_p": p["K_p"][:2]}, i[:2])}, InputError, "2 rollouts for 14 samples"),
    ],
)
def test_bad_arguments_are_refused(change, error, message, tmp_path):
    arguments = {"build": circle, "space": SPACE} | change
    with pytest.raises(error, match=message):
        pc.sweep(out=tmp_path / "out", progress=False, **arguments)
    assert not list(tmp_path.iterdir())


def test_what_else_is_in_the_folder_stays(tmp_path):
    (tmp_path / ".git").mkdir()
    others = [tmp_path / ".gitignore", tmp_path / ".git/config", tmp_path / "runs.md"]
    for file in others:
        file.write_text("mine")
    one = pc.Space.given({"K_p": [800.0], "k": [20.0], "q": [[0.7, 1.2]]})
    for resume in (False, True):
        pc.sweep(circle, one, tmp_path, resume=resume, progress=False)
        assert [file.read_text() for file in others] == ["mine"] * 3


def test_the_extra_is_named_where_it_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'pathcontrol\[sweep\]'"):
        pc.sweep(circle, SPACE, tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()


def test_what_is_no_sweep_is_told(tmp_path):
    with pytest.raises(InputError, match=r"there is no sweep in .*: it has no manifest.json"):
        pc.SweepResult(tmp_path)
    result = pc.sweep(circle, SPACE, tmp_path / "a", chunk=7, progress=False)
    file = next(result.folder.glob("chunks/*.parquet"))
    file.write_bytes(b"PAR1")
    with pytest.raises(InputError, match=r"cannot be read: damaged; resume the sweep to make it again"):
        result.table()
    with pytest.warns(pc.PathControlWarning, match=r"made again there: chunks/.* \(damaged\)"):
        assert pc.sweep(circle, SPACE, tmp_path / "a", resume=True, progress=False).finished == 14
    with pytest.raises(InputError, match=r"the history of sample 3 is not kept; kept are \[\]"):
        result.run(3)
    with pytest.raises(InputError, match="is a file, expected a folder"):
        pc.sweep(circle, SPACE, file.with_name("f.txt").touch() or file.with_name("f.txt"), progress=False)
