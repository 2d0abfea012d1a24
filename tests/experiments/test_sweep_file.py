"""``pathcontrol sweep``: a sample is the experiment with its values in the file; what is wrong is told by key."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from patience import PATIENCE, wait_until

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import ExperimentError, InputError
from pathcontrol.experiments.builders.setup import build
from pathcontrol.experiments.samples.dotted_keys import put
from pathcontrol.experiments.samples.swept_experiment import SweptExperiment
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.experiments.sweep_runner import run_sweep
from pathcontrol.sweeps.manifest import LOG

pytest.importorskip("pyarrow")

COMMAND = [sys.executable, "-m", "pathcontrol", "sweep"]
BASE = """
angle_unit = "deg"
duration = 0.1
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 57.3
speed = 114.59
[controller]
type = "extended_motion_plan"
K_p = 800.0
K_v = [45.0, 100.0]
k = 20.0
[plant]
payload = { mass = 0.1, frame = "tool" }
friction = { viscous = [2.288, 0.175], coulomb = [7.61, 1.734] }
[loop]
encoders = true
velocity = "difference"
torque_limits = true
[start]
q = [40.0, 70.0]
[output]
summary = "summary.json"
"""
SWEEP = """
[sweep]
method = "sobol"
samples = 9
seed = 3
keep = { worst = 2, by = "e_p_peak" }
[sweep.parameters]
"controller.K_p" = { log_uniform = [100.0, 1e4] }
"controller.K_v" = { uniform = [[30.0, 80.0], [50.0, 120.0]] }
"controller.k" = { uniform = [1.0, 40.0] }
"start.q[0]" = { normal = [40.0, 10.0] }
plant.payload.mass = { uniform = [0.0, 3.0] }
plant.friction.coulomb = { uniform = [[0.0, 0.0], [8.0, 2.0]] }
"task.radius" = { grid = [50.0, 57.3] }
"loop.substeps" = { grid = [1, 2] }
"""
GRID = '[sweep]\n[sweep.parameters]\n"start.q" = { grid = [[40.0, 70.0], [0.0, 10.0], [80.0, -20.0]] }\n'


@pytest.fixture
def experiment(tmp_path):
    def write(text):
        file = tmp_path / "sweep.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


def alone(values):
    """The run of the experiment whose file has these values."""
    data = tomllib.loads(BASE)
    for key, value in values.items():
        put(data, key, value)
    setup = build(Experiment.model_validate(data))
    return pc.simulate(
        setup.controller, setup.q, setup.qd, duration=setup.duration, plant=setup.plant, loop=setup.loop, progress=False
    )


def test_a_sample_is_the_experiment_with_its_values(experiment, tmp_path):
    table = run_sweep(experiment(BASE + SWEEP), tmp_path / "out", chunk=4, progress=False).table()
    for i in range(9):
        values = {str(name): table[name][i].values.tolist() for name in table.coords if name != "sample"}
        run = alone(values)
        for name, value in pc.metrics(run).items():
            np.testing.assert_array_equal(table[name][i], value[0], err_msg=f"{name} of sample {i}")
    assert set(table["task.radius"].to_numpy()) == {50.0, 57.3}
    assert table["loop.substeps"].dtype.kind == "i"


TASKS = """
[sweep]
method = "sobol"
samples = 8
[sweep.parameters]
"task.radius" = { uniform = [20.0, 80.0] }
"task.speed" = { uniform = [50.0, 150.0] }
"""


def parts_of(text, samples, folder=Path(), **parameters):
    """The rows of the batches in which samples are simulated, and their tasks."""
    swept = SweptExperiment(tomllib.loads(text), folder)
    return [(rows.tolist(), built["controller"].task) for rows, built in swept(parameters, np.arange(samples))]


def test_tasks_vary_within_a_batch(experiment, tmp_path):
    [(rows, task)] = parts_of(BASE, 3, **{"task.radius": np.array([30.0, 40.0, 30.0])})
    assert rows == [0, 1, 2]
    assert_allclose([one.radius for one in task.tasks], np.deg2rad([30.0, 40.0, 30.0]))
    assert task.tasks[0] is task.tasks[2]
    anywhere = BASE.replace("q = [40.0, 70.0]", "")  # each starts where its own path begins
    table = run_sweep(experiment(anywhere + TASKS), tmp_path / "out", progress=False).table()
    for i in range(8):
        data = tomllib.loads(anywhere)
        data["task"] |= {name: table[f"task.{name}"][i].item() for name in ("radius", "speed")}
        setup = build(Experiment.model_validate(data))
        run = pc.simulate(setup.controller, setup.q, duration=0.1, plant=setup.plant, loop=setup.loop, progress=False)
        for name, value in pc.metrics(run).items():
            np.testing.assert_array_equal(table[name][i], value[0], err_msg=f"{name} of sample {i}")


def test_paths_of_other_kinds_or_durations_are_simulated_apart():
    line = BASE.replace('type = "circle"\nradius = 57.3', 'type = "line"\nstart = [0.0, 0.0]\nend = [10.0, 0.0]')
    ends = {"task.end": np.array([[10.0, 0.0], [20.0, 5.0], [10.0, 0.0]])}
    assert [rows for rows, _ in parts_of(line, 3, **ends)] == [[0, 1, 2]]
    assert [rows for rows, _ in parts_of(line.replace("duration = 0.1", ""), 3, **ends)] == [[0, 2], [1]]


OWN = """
import numpy as np
import pathcontrol as pc

class Own(pc.PathTask):
    def __init__(self, kind, size):
        self.size = size
        if kind == "closed":
            self.period = 2 * np.pi
        elif kind == "open":
            self.s_end = 1.0

    def q_d(self, s):
        return self.size * np.stack([np.cos(s), np.sin(s)], axis=-1)

    def theta(self, s):
        return 1.0

    def sigma_bar(self, q, near=None):
        return np.arctan2(q[..., 1], q[..., 0])
"""


def test_tasks_of_a_file_are_of_one_class(tmp_path):
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    text = BASE.replace('type = "circle"\nradius = 57.3\nspeed = 114.59', 'type = "own.py:Own"')
    text = text.replace("[controller]", '[task.parameters]\nkind = "closed"\nsize = 1.0\n[controller]')
    kinds = np.array(["closed", "open", "closed", "endless", "endless"])
    sizes = {"task.parameters.size": np.array([1.0, 1.1, 1.2, 1.0, 1.1]), "task.parameters.kind": kinds}
    parts = parts_of(text, 5, tmp_path, **sizes)
    assert [rows for rows, _ in parts] == [[0, 2], [1], [3], [4]]
    assert len({type(task) for task in parts[0][1].tasks}) == 1


def test_any_chunk_gives_the_same_table(experiment, tmp_path):
    file = experiment(BASE + SWEEP)
    results = [run_sweep(file, tmp_path / str(k), chunk=k, progress=False) for k in (2, 100)]
    assert results[0].table().identical(results[1].table())
    assert results[0].kept == results[1].kept


def test_a_file_with_a_sweep_is_still_an_experiment(experiment, tmp_path):
    from pathcontrol.experiments.runner import run_experiment

    assert run_experiment(experiment(BASE + SWEEP), tmp_path / "out", progress=False).run.rollouts == 1


def test_the_command_writes_a_table_and_tells_it(experiment, tmp_path):
    file = experiment(BASE + SWEEP)
    done = CliRunner().invoke(main, ["sweep", str(file), "--out", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    table = pc.SweepResult(tmp_path / "out").table()
    assert told["samples"] == 9
    assert told["status"] == {"running": 9}
    assert told["metrics"]["e_p_peak"]["largest"] == table["e_p_peak"].max()
    assert [int(i) for i in told["histories"]] == sorted(np.argsort(-table["e_p_peak"].to_numpy())[:2])
    again = ["sweep", str(file), "--out", str(tmp_path / "out")]
    refused, resumed = (CliRunner().invoke(main, [*again, *more]) for more in ([], ["--resume"]))
    assert refused.exit_code == 2
    assert "holds a sweep already; resume it (--resume), or name" in refused.stderr
    assert resumed.exit_code == 0
    assert "9 ran until the time was up" in resumed.stdout


def test_after_ctrl_c_finished_chunks_stay(experiment, tmp_path):
    many = SWEEP.replace("samples = 9", "samples = 500")
    file, out = experiment(BASE + many), tmp_path / "out"
    process = subprocess.Popen(
        [*COMMAND, file, "--out", out, "--chunk", "1"],
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_until(
        lambda: (out / LOG).exists() or process.poll() is not None, pause=0.05
    )  # a chunk counts once it is noted
    os.kill(process.pid, signal.SIGINT)
    assert process.wait(PATIENCE) == 130
    told = process.stderr.read()
    assert "interrupted" in told
    assert f"--resume goes on with what is in {out}" in told
    finished = pc.SweepResult(out).finished
    assert 0 < finished < 500
    assert not list(out.rglob("*/.*"))


def test_another_file_is_refused_by_the_key_that_differs(experiment, tmp_path):
    run_sweep(experiment(BASE + GRID), tmp_path / "out", progress=False)
    with pytest.raises(InputError, match=r"build.experiment.controller.k was 20.0, is now 21.0"):
        run_sweep(experiment(BASE.replace("k = 20.0", "k = 21.0") + GRID), tmp_path / "out", resume=True)


def test_a_task_in_a_file_is_part_of_the_definition(experiment, tmp_path):
    code = "from pathcontrol import Circle\nclass Mine(Circle):\n  def __init__(self):\n    super().__init__(1.0, 2.0)"
    (tmp_path / "mine.py").write_text(code)
    head, task, tail = BASE.partition('[task]\ntype = "circle"\nradius = 57.3\nspeed = 114.59\n')
    file = experiment(head + '[task]\ntype = "mine.py:Mine"\n' + tail + GRID)
    assert task
    run_sweep(file, tmp_path / "out", progress=False)
    (tmp_path / "mine.py").write_text(code.replace("2.0", "2.5"))
    with pytest.raises(InputError, match=r"build.files_sha256.mine.py:Mine was"):
        run_sweep(file, tmp_path / "out", resume=True, progress=False)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("", r"sweep: missing; add a section \[sweep\]"),
        ("[sweep]\n", "sweep.parameters: missing"),
        ("[sweep]\nparameters = {}\n", "sweep.parameters = {}, expected a table of keys of this file that vary"),
        (GRID.replace("[sweep]", '[sweep]\nmetrics = ["e_p_peek"]'), "sweep.metrics = .*; did you mean 'e_p_peak'"),
        (GRID.replace("grid =", "list ="), "of 'start.q.list' a table of 'grid' or 'uniform'"),
        (GRID.replace("start.q", "start.p"), "in sample 0: start.p: unknown key; valid keys: q, qd"),
        (GRID.replace("start.q", "start.q.0"), r"no entry '0' on the way there; an entry of a list is written \[0\]"),
        (GRID.replace("start.q", "start.q[5]"), "no entry 5 on the way there|list of finite numbers"),
        (GRID.replace(", -20.0", ""), "expected values of one kind and length"),
        (GRID.replace("70.0", "-20.0, 1.0"), "expected values of one kind and length"),
        ('[sweep]\nmethod = "lhs"\n' + GRID[8:], "sweep.samples: method = 'lhs' needs samples"),
        ("[sweep]\nsamples = 3\n" + GRID[8:], "sweep.samples: method = 'grid' is as large as its grids"),
        ('[sweep]\nmethod = "sobl"\n' + GRID[8:], "sweep.method = 'sobl', expected .*; did you mean 'sobol'"),
        (
            SWEEP.replace("[1.0, 40.0]", "[40.0, 1.0]"),
            r"sweep.parameters.controller.k: uniform = \[40.0, 1.0\], expected a < b",
        ),
        (
            SWEEP.replace("log_uniform = [100.0", "normal = [-1e5"),
            "expected gains greater than 0; choose another distr",
        ),
        (GRID.replace('"start.q"', '""'), "sweep.parameters: '', expected a key of this file, such as"),
        (GRID.replace("start.q", "start..q"), "sweep.parameters: 'start..q', expected a key of this file, such as"),
        (GRID + '"start.q[0]" = { grid = [1.0] }', r"'start.q\[0\]' is a part of what 'start.q' sets"),
        (SWEEP.replace("worst = 2", "worst = -2"), "keep.worst = -2, expected a whole number from 0"),
        (SWEEP.replace("samples = 9", "samples = 0"), "samples = 0, expected a whole number from 1"),
        (SWEEP.replace("[0.0, 3.0]", "[-3.0, -2.0]"), "plant.payload.mass = -"),
    ],
)
def test_what_is_wrong_is_told_by_key(section, message, experiment, tmp_path):
    with pytest.raises(ExperimentError, match=message):
        run_sweep(experiment(BASE + section), tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()


def test_a_toolpath_cannot_be_swept(experiment, tmp_path):
    drawing = '<svg xmlns="http://www.w3.org/2000/svg" width="300mm" height="120mm" viewBox="0 0 300 120">'
    (tmp_path / "d.svg").write_text(f'{drawing}<path d="M 20 20 H 80 V 60" fill="none" stroke="black"/></svg>')
    head, _, tail = BASE.partition('[task]\ntype = "circle"\nradius = 57.3\nspeed = 114.59\n')
    place = "workpiece = { position = [0.25, -0.05, 0.65], rpy = [90.0, 0.0, 0.0] }\nfeed = 0.1\nclearance = 0.0\n"
    task = f'[task]\ntype = "toolpath"\nfile = "d.svg"\nframe = "tool"\n{place}'
    file = experiment(head.replace("duration = 0.1", "") + task + tail.replace("q = [40.0, 70.0]", "") + GRID)
    with pytest.raises(ExperimentError, match="a sequence of paths cannot be swept"):
        run_sweep(file, tmp_path / "out", progress=False)
