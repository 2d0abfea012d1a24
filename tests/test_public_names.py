"""The same functions by their short names and by the packages they belong to, each loaded when it is used."""

from __future__ import annotations

import subprocess
import sys

import pathcontrol as pc
from pathcontrol import analysis, figures


def test_figures_and_metrics_have_packages_of_their_own():
    for package, some in ((analysis, ("metrics", "lyapunov", "non_dominated")), (figures, ("path_figure",))):
        names = [name for name in dir(package) if not name.startswith("_") and hasattr(pc, name)]
        assert {*some} <= {*names}
        for name in names:
            assert getattr(package, name) is getattr(pc, name), name


def test_every_analysis_is_in_analysis():
    public = {name: getattr(pc, name) for name in pc.__all__}
    own = {name for name, one in public.items() if getattr(one, "__module__", "").startswith("pathcontrol.analysis.")}
    assert own <= {*dir(analysis)}


def test_every_figure_is_in_figures():
    assert {name for name in pc.__all__ if name.endswith("_figure")} | {"save_figure"} <= {*dir(figures)}


def test_a_function_stays_one_when_its_package_has_loaded_all_modules():
    """A module called as a function would take its place in the package once it is imported."""
    code = (
        "import importlib, pkgutil, pathcontrol.analysis as a\n"
        "for m in pkgutil.iter_modules(a.__path__): importlib.import_module(f'pathcontrol.analysis.{m.name}')\n"
        "assert all(callable(getattr(a, name)) for name in a.__all__)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_experiments_are_run_from_python_too():
    assert {"run_experiment", "run_sweep", "run_tune"} <= {*dir(pc)}
    assert all(callable(getattr(pc, name)) for name in ("run_experiment", "run_sweep", "run_tune"))
