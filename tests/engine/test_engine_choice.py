"""Which engine runs, what is said of it, and the same bits however a batch is cut."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.engine import library
from pathcontrol.engine.gamma_distance import distances_to_gamma
from pathcontrol.engine.library import BUILDS, load_library

ROBOT, TASK = pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0)
LAW = pc.ExtendedMotionPlan(ROBOT, TASK, 800.0, [45.0, 100.0], k=20.0)


class Own(pc.ExtendedMotionPlan):
    """A law of the user's own."""


class Wind(pc.Disturbance):
    """A disturbance of the user's own."""

    def torque(self, t, q, qd):
        return -0.5 * qd + np.sin(t)


def _run(law=LAW, q=(0.9, 0.1), **options):
    return pc.simulate(law, np.asarray(q), duration=0.5, progress=False, **{"engine": "auto"} | options)


def test_auto_is_compiled_where_that_can_be_and_says_so():
    assert _run().config["engine"] == "compiled"
    reference = _run(engine="pinocchio").config
    assert (reference["engine"], reference["engine_reason"]) == ("pinocchio", "asked for")
    continuous = _run(loop=pc.ContinuousTime())
    assert continuous.config["engine"] == "pinocchio"
    assert "continuous time" in continuous.config["engine_reason"]


def test_what_continuous_time_cannot_is_an_error_when_asked_for():
    with pytest.raises(pc.EngineError, match="continuous time"):
        _run(loop=pc.ContinuousTime(), engine="compiled")
    with pytest.raises(pc.UnknownNameError, match=r"engine = 'fast'.*'auto', 'compiled', 'pinocchio'"):
        _run(engine="fast")


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"law": Own(ROBOT, TASK, 800.0, [45.0, 100.0], k=20.0)}, "the law Own"),
        ({"disturbance": Wind() + pc.Push([1.0, 0.0])}, "the disturbance Wind"),
    ],
)
def test_laws_and_disturbances_in_python_run_on_the_compiled_plant(options, name):
    starts = np.array([[0.9, 0.1], [0.8, 0.2], [1.0, -0.1]])  # with the same q̇, whose array has another layout
    runs = [_run(q=starts, **options, engine=engine) for engine in ("auto", "pinocchio")]
    assert runs[0].config["engine"] == "compiled"
    assert name in runs[0].config["engine_reason"]
    assert np.abs(runs[0].array("q") - runs[1].array("q")).max() < 1e-12


def test_everything_works_without_the_library_and_says_so_once(monkeypatch, tmp_path):
    monkeypatch.setattr(library, "_FOLDER", tmp_path)
    load_library.cache_clear()
    try:
        with pytest.warns(pc.PathControlWarning, match="not installed"):
            run = _run()
        assert run.config["engine"] == "pinocchio"
        assert "engine_base.so is missing" in run.config["engine_reason"]
        with pytest.raises(pc.EngineError, match="install pathcontrol again"):
            _run(engine="compiled")
    finally:
        load_library.cache_clear()


@pytest.mark.filterwarnings("ignore::pathcontrol.PathControlWarning")
def test_a_file_that_is_no_library_or_another_one_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(library, "_FOLDER", tmp_path)
    (tmp_path / "engine_base.so").write_bytes(b"not a library")
    load_library.cache_clear()
    try:
        with pytest.raises(pc.EngineError, match="cannot be used"):
            _run(engine="compiled")
        monkeypatch.undo()
        load_library.cache_clear()
        monkeypatch.setattr(library, "MOST_JOINTS", 8)
        with pytest.raises(pc.EngineError, match="built from other sources"):
            _run(engine="compiled")
        monkeypatch.undo()
        load_library.cache_clear()
        monkeypatch.setattr(library, "FUNCTIONS", library.FUNCTIONS | {"of_tomorrow": []})
        with pytest.raises(pc.EngineError, match=r"built from other sources.*of_tomorrow"):
            _run(engine="compiled")
    finally:
        monkeypatch.undo()
        load_library.cache_clear()


def _available():
    best = BUILDS[load_library("base").pathcontrol_instructions()]
    return BUILDS[: BUILDS.index(best) + 1]


def test_bits_do_not_depend_on_size_order_threads_or_instructions(monkeypatch):
    rng = np.random.default_rng(0)
    starts = np.array([0.9, 0.1]) + rng.normal(0, 0.2, (37, 2))
    loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True)
    whole = _run(q=starts, loop=loop).array("q")
    for i in (0, 8, 36):
        assert np.array_equal(_run(q=starts[i], loop=loop).array("q")[0], whole[i])
    order = rng.permutation(37)
    assert np.array_equal(_run(q=starts[order], loop=loop).array("q"), whole[order])
    threaded = pc.ExtendedMotionPlan(ROBOT.with_threads(2), TASK, 800.0, [45.0, 100.0], k=20.0)
    assert np.array_equal(_run(threaded, starts, loop=loop).array("q"), whole)
    for build in _available():
        monkeypatch.setattr("pathcontrol.simulation.compiled.load_library", lambda build=build: load_library(build))
        assert np.array_equal(_run(q=starts, loop=loop).array("q"), whole), build


def test_bits_of_distances_do_not_depend_on_instructions(monkeypatch):
    rng = np.random.default_rng(1)
    q, qd = rng.normal(0, 1, (500, 2)), rng.normal(0, 2, (500, 2))
    found = []
    for build in _available():
        monkeypatch.setattr("pathcontrol.engine.gamma_distance.load_library", lambda build=build: load_library(build))
        found.append(np.array(distances_to_gamma(TASK, q, qd, 1.0, True)))
    assert all(np.array_equal(one, found[0]) for one in found)


def test_a_control_tick_is_the_law_and_a_step_of_its_plan():
    laws = [
        LAW,
        pc.Projection(ROBOT, TASK, 800.0, [45.0, 100.0]),
        pc.ComputedTorque(ROBOT, TASK, 800.0, [45.0, 100.0]),
        pc.PDPlus(ROBOT, TASK, 80.0, [4.0, 1.0], friction="full"),
        pc.SlotineLi(ROBOT, TASK, 10.0, [4.0, 2.0], friction="none"),
    ]
    for law in laws:
        tick, q, qd = pc.ControlTick(law, 2.5e-3), np.array([0.9, 0.1]), np.array([0.1, 1.7])
        tick.start(q, qd)
        z = law.start(q, qd)
        for _ in range(200):
            out = law.law(0.0, q, qd, z)
            tau = tick(q, qd)
            assert np.abs(tau - out.tau).max() < 1e-8
            z = law.advance(z, out, 2.5e-3)
            assert tick.s == pytest.approx(z[0], abs=1e-11)
            q = q + 2.5e-3 * qd
    with pytest.raises(pc.InputError, match="several rollouts"):
        pc.ControlTick(pc.ComputedTorque(ROBOT, TASK, np.ones((3, 1)), 1.0), 1e-3)
    own = Own(ROBOT, TASK, 800.0, [45.0, 100.0], k=20.0)
    tick = pc.ControlTick(own, 1e-3)  # in Python
    tick.start(q, qd)
    np.testing.assert_array_equal(tick(q, qd), own.law(0.0, q, qd, own.start(q, qd)).tau)


EXPERIMENT = """
duration = 0.3
{engine}
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 2.0
[controller]
type = "projection"
k_p = 800.0
K_v = [45.0, 100.0]
[start]
q = [0.9, 0.1]
[output]
"""


def test_experiment_files_and_the_command_line_choose_the_engine(tmp_path):
    from pathcontrol.experiments.runner import run_experiment

    file = tmp_path / "one.toml"
    file.write_text(EXPERIMENT.format(engine=""))
    assert run_experiment(file, tmp_path / "a", progress=False).run.config["engine"] == "compiled"
    assert run_experiment(file, tmp_path / "b", engine="pinocchio").run.config["engine"] == "pinocchio"
    file.write_text(EXPERIMENT.format(engine='engine = "compiled"'))
    assert run_experiment(file, tmp_path / "c", progress=False).run.config["engine"] == "compiled"
    file.write_text(EXPERIMENT.format(engine='engine = "fast"'))
    with pytest.raises(pc.ExperimentError, match=r"engine.*'fast'"):
        run_experiment(file, tmp_path / "d")


def test_sweeps_choose_the_engine(tmp_path):
    pytest.importorskip("pyarrow")

    def build(parameters, samples):
        law = pc.Projection(ROBOT, TASK, parameters["k_p"][:, None], [45.0, 100.0])
        return {"controller": law, "q": [0.9, 0.1], "duration": 0.3}

    space = pc.Space.grid({"k_p": [400.0, 800.0]})
    tables = [
        pc.sweep(build, space, tmp_path / engine, metrics=["contour_error_peak"], engine=engine).table()
        for engine in ("compiled", "pinocchio")
    ]
    peaks = [table["contour_error_peak"].to_numpy() for table in tables]
    assert np.abs(peaks[0] - peaks[1]).max() < 1e-10
    with pytest.raises(pc.UnknownNameError, match="engine = 'fast'"):
        pc.sweep(build, space, tmp_path / "no", engine="fast")


def test_a_task_without_a_hash_has_a_table_too():
    from dataclasses import dataclass

    @dataclass
    class Round(pc.PathTask):
        radius: float
        period = 2 * np.pi

        def q_d(self, s):
            return self.radius * np.stack([np.cos(s), np.sin(s)], axis=-1)

        def theta(self, s):
            return 2.0 + 0.0 * s

    law = pc.ExtendedMotionPlan(ROBOT, Round(1.0), 800.0, [45.0, 100.0], k=20.0)
    assert _run(law).config["engine"] == "compiled"
    assert np.abs(_run(law).array("q") - _run().array("q")).max() < 1e-10
