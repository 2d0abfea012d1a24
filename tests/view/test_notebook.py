"""Notebooks: figures and films show themselves, and nothing is written on standard error."""

from __future__ import annotations

import base64
import warnings
from pathlib import Path

import pytest
from patience import PATIENCE

import pathcontrol as pc

EXAMPLES = Path(__file__).parents[2] / "examples"
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def run():
    arm = pc.load_robot("cicese_2dof")
    law = pc.Projection(arm, pc.Circle(1.0, 2.0), 800.0, 50.0)
    return pc.simulate(law, [1.0, 0.0], duration=1.0)


@pytest.mark.parametrize("draw", [pc.path_figure, pc.error_figure])
def test_a_figure_shows_itself_and_is_saved_as_before(run, draw, tmp_path):
    before = pc.save_figure(draw(run), tmp_path / "before", ["svg"])
    figure = draw(run)
    picture = figure._repr_png_()
    assert picture.startswith(PNG)
    assert picture == figure._repr_png_()
    after = pc.save_figure(figure, tmp_path / "after", ["svg"])
    assert [file.read_bytes() for file in before] == [file.read_bytes() for file in after]


def test_a_figure_looks_the_same_whatever_the_settings_of_matplotlib(run):
    import matplotlib as mpl

    plain = pc.error_figure(run)._repr_png_()
    with mpl.rc_context({"savefig.facecolor": "black", "font.size": 20.0}):
        assert pc.error_figure(run)._repr_png_() == plain


def test_the_progress_bar_does_not_warn_in_a_notebook(monkeypatch):
    """Rich takes a process for a notebook by its shell, and warns where ipywidgets is not there."""
    import rich.console

    from pathcontrol import _progress

    monkeypatch.setattr(rich.console, "_is_jupyter", lambda: True)
    monkeypatch.setattr(_progress, "find_spec", lambda name: None)
    monkeypatch.setattr(_progress, "_PATIENCE", -1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with _progress.progress_bar("working", 2.0) as update:
            update(1.0)
            update(2.0)


@pytest.mark.parametrize("notebook", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_its_figures_and_its_film(notebook, tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    content = nbformat.read(notebook, as_version=4)
    nbformat.validate(content)
    assert all(not cell.get("outputs") for cell in content.cells), "committed without outputs"
    nbclient.NotebookClient(content, timeout=PATIENCE, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in content.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    shown = [output.data for output in outputs if "data" in output]
    pictures = [base64.b64decode(data["image/png"]) for data in shown if "image/png" in data]
    assert len(pictures) >= 2
    assert all(picture.startswith(PNG) for picture in pictures)
    assert any("<iframe" in data.get("text/html", "") for data in shown)


def test_there_is_a_notebook():
    assert list(EXAMPLES.glob("*.ipynb"))
