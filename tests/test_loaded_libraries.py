"""What a run, its files, figures and films need is loaded, and no large library besides."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec

import pytest

PYARROW = find_spec("pyarrow") is not None
USES = {
    "metrics": "pc.metrics(run)",
    "file": "run.save('run.nc')",
    "loaded file": "pc.metrics(pc.Run.load('run.nc'))",
    "figures": "pc.save_figure(pc.error_figure(run), 'figure')",  # all formats
    "more figures": "[pc.save_figure(f(run), 'figure', formats=('svg',)) for f in (pc.path_figure, pc.torque_figure)]",
    "film": "pc.record(run).save('film.html')",
    "one rollout": "pc.metrics(run.rollout(0).with_robot(robot))",
    "sequence": "pc.metrics(pc.simulate_sequence([law, law], [0, 0], duration=1.0, gaps=True))",
    "sweep": "swept('table')",
    "table": "table_of('table')",
    "labels": "run.data.sizes['time']",
}
CODE = f"""
import json, sys
import pathcontrol as pc
from pathcontrol.experiments import reproduce

reproduce.DURATION = 0.5
large = {{"xarray", "pandas", "trimesh", "yourdfpy", "sympy", "dask.array", "pydantic", "matplotlib.pyplot", "scipy"}}
large |= {{"meshcat", "IPython"}}
robot = pc.load_robot("cicese_2dof")
run = reproduce.paper_experiment("projection", robot, False, "compiled").run
law = pc.ComputedTorque(robot, pc.Line([0, 0], [0.2, 0.2], 1.0), K_p=800.0, K_v=[45.0, 100.0])


def swept(folder):
    build = lambda p, samples: {{"controller": law, "q": p["q"], "duration": 0.1}}
    return {PYARROW} and pc.sweep(build, pc.Space.given({{"q": [[0, 0], [0, 0.1]]}}), folder, progress=False)


def table_of(folder):
    return {PYARROW} and pc.SweepResult(folder).table()


loaded = {{}}
for name, use in {USES!r}.items():
    value = eval(use)
    loaded[name] = sorted(large & {{*sys.modules}})
print(json.dumps([loaded, value]))
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """What is loaded after each use, one after another in a process of their own, and the value of the last one."""
    folder = tmp_path_factory.mktemp("used")
    done = subprocess.run([sys.executable, "-c", CODE], cwd=folder, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.parametrize("use", [use for use in USES if use not in ("sweep", "table", "labels")])
def test_no_large_library_is_loaded(use, told):
    assert told[0][use] == []


def test_a_sweep_loads_no_labels_and_its_table_no_dask(told):
    assert set(told[0]["sweep"]) <= {"pandas"}  # PyArrow looks whether it is given some of these
    assert "dask.array" not in told[0]["table"]


def test_labels_are_there_when_they_are_asked_for(told):
    loaded, samples = told
    assert "xarray" in loaded["labels"]
    assert "dask.array" not in loaded["labels"]
    assert samples == 201
