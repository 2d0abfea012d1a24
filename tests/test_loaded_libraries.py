"""What a run, its files, figures and films need is loaded, and no large library besides."""

from __future__ import annotations

import subprocess
import sys

import pytest

LARGE = "{'xarray', 'pandas', 'trimesh', 'yourdfpy', 'sympy', 'pydantic', 'matplotlib.pyplot', 'scipy'}"
RUN = "import pathcontrol as pc; from pathcontrol.experiments.reproduce import paper_experiment; " + (
    "robot = pc.load_robot('cicese_2dof'); run = paper_experiment('projection', robot, False, 'compiled').run"
)
USES = {
    "metrics": "pc.metrics(run)",
    "file": "run.save('run.nc')",
    "figures": "[pc.save_figure(f(run), 'figure') for f in (pc.error_figure, pc.path_figure, pc.torque_figure)]",
    "film": "pc.record(run).save('film.html')",
    "one rollout": "pc.metrics(run.rollout(0).with_robot(robot))",
}


@pytest.mark.parametrize("use", USES)
def test_no_large_library_is_loaded(use, tmp_path):
    code = f"import sys; {RUN}; {USES[use]}; print({LARGE} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_labels_are_there_when_they_are_asked_for():
    code = f"import sys; {RUN}; print('xarray' in sys.modules, run.data.sizes['time'], 'xarray' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False 4001 True\n"
