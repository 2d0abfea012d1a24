"""The histories of a sweep, and its numbers and figures, on pages: the worst first, by their parameters."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
from browser import opened
from click.testing import CliRunner
from lxml import html
from test_sweep import WILD, circle

import pathcontrol as pc
from pathcontrol.analysis.readable import readable_parameters
from pathcontrol.cli import main
from pathcontrol.errors import InputError

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A sweep of six samples, of which three diverge; the two worst that did not, and one that did, are kept."""
    keep = pc.Keep(worst=2, by="e_p_peak", diverged=1)
    return pc.sweep(circle, WILD, tmp_path_factory.mktemp("sweep") / "wild", keep=keep, progress=False)


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_histories_are_named_by_their_samples_the_worst_first(kept):
    table, histories = kept.table(), kept.histories()
    numbers = [int(name.removeprefix("sample ")) for name in histories]
    errors = table["e_p_peak"].to_numpy()
    assert table["status"][numbers[0]] == "diverged"
    assert errors[numbers[1]] == np.nanmax(errors)
    assert errors[numbers[1]] > errors[numbers[2]]
    assert sorted(numbers) == kept.kept
    for number, run in zip(numbers, histories.values(), strict=True):
        assert run.config["sweep"]["sample"] == number
    said = [row for one in pc.record(histories).film.header["tables"] for row in one["rows"]]
    (parameters,) = (row[1:] for row in said if row[0] == "parameters of the sample")
    for number, words in zip(numbers, parameters, strict=True):
        assert f"K_p = {float(table['K_p'][number]):.3g}" in words
    assert list(kept.histories(worst=1)) == list(histories)[:1]


def test_what_a_killed_process_left_behind_is_not_shown(kept, tmp_path):
    shutil.copytree(kept.folder, tmp_path / "killed")
    left = pc.SweepResult(tmp_path / "killed")
    for name in (".000000005-0123abcd.nc", "000000006.nc"):
        shutil.copy(kept.history(kept.kept[0]), left.folder / "runs" / name)
    assert list(left.histories()) == list(kept.histories())


def test_parameters_are_told_by_the_last_part_of_their_keys():
    assert readable_parameters({"a.K_p": 1234.56, "b.q": [0.5, 1e-7], "n": 3, "s": "x"}) == (
        "K_p = 1235, q = [0.5, 1e-07], n = 3, s = x"
    )
    assert readable_parameters({"a.k": 123456.0, "b.k": 0.12345}, 3) == "a.k = 123456, b.k = 0.123"


def test_without_histories_it_says_how_to_keep_some(tmp_path):
    bare = pc.sweep(circle, pc.Space.given({"K_p": [800.0], "k": [20.0], "q": [[0.7, 1.2]]}), tmp_path, progress=False)
    with pytest.raises(InputError, match=r"keeps no histories; give it .* keep=Keep\(worst=3\)"):
        bare.histories()
    said = call("view", tmp_path).stderr
    assert "keeps no histories; give it `keep = { worst = 3 }` in the [sweep] of its file, or run one" in said


def test_the_command_films_them_in_a_browser(kept):
    told = json.loads(call("view", kept.folder, "--worst", "2", "--json").stdout)
    assert list(told["runs"]) == list(kept.histories(worst=2))
    page = kept.folder / "histories.html"
    assert told["written"] == {"html": str(page)}
    with opened(page, (450, 300), "#t=0") as shown:
        assert shown.complaints == []
        words = shown.tab.locator("body").inner_text()
        assert all(name in words for name in told["runs"])
    told = call("view", kept.folder, kept.history(kept.kept[0]))
    assert told.exit_code == 2
    assert "is a sweep, expected it alone" in told.stderr


def test_the_report_of_a_sweep_has_its_numbers_and_figures(kept, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])
    result = call("report", kept.folder, "--out", tmp_path / "r.html", "--json")
    assert result.exit_code == 0, result.stderr
    page, table = html.parse(str(tmp_path / "r.html")), kept.table()
    assert "6 samples: 3 diverged, 3 ran until the time was up. It keeps 3 histories" in page.getroot().text_content()
    rows = {row.find("th").text_content().strip(): row for row in page.xpath("//table[@id='sweep']//tr[th and td]")}
    cells = [cell.text for cell in rows["‖ep‖ peak [deg]"].findall("td")]
    assert float(cells[2]) == pytest.approx(np.rad2deg(float(table["e_p_peak"].max())), rel=1e-3)
    assert int(cells[3]) == int(np.nanargmax(table["e_p_peak"].to_numpy()))
    (facts,) = page.xpath("//table[@id='summary']//tr[starts-with(normalize-space(), 'parameters of the sample')]")
    for number, cell in zip(kept.histories(), facts.findall("td"), strict=True):
        assert f"K_p = {float(table['K_p'][int(number.removeprefix('sample '))]):.3g}" in cell.text
    captions = [caption.text for caption in page.xpath("//figcaption")]
    assert captions == ["‖e_p‖ peak, over K_p", "Pareto front, with noise of the torque demand"]  # k and q are the same


def test_a_report_may_not_overwrite_a_history(kept):
    result = call("report", kept.folder, "--out", kept.history(kept.kept[0]))
    assert result.exit_code == 2
    assert "is the run itself, which would be lost" in result.stderr


def test_the_sweep_and_the_tuning_of_the_template_are_some(tmp_path):
    pytest.importorskip("pymoo")
    from pathcontrol.experiments.sweep_runner import run_sweep
    from pathcontrol.experiments.template import example_text
    from pathcontrol.experiments.tune_runner import run_tune

    head, marker, last = example_text().partition("#[sweep]\n")
    assert marker
    text = head + re.sub(r"(?m)^#(?=\S)", "", marker + last).replace("1024", "4").replace("= 25", "= 1")
    text = text.replace('#payload = { mass = 0.5, frame = "tool" }  ', 'payload = { mass = 0.5, frame = "tool" }  ')
    file = tmp_path / "mine.toml"
    file.write_text(text.replace("duration = 10.0", "duration = 0.05"), encoding="utf-8")
    result = run_sweep(file, tmp_path / "out", progress=False)
    assert set(result.definition["space"]["parameters"]) >= {"controller.K_p", "start.q[0]", "plant.payload.mass"}
    assert result.finished == 4
    found = run_tune(file, tmp_path / "tuned", progress=False)
    assert set(found.limits) == {"tau_demand_ratio", "speed_ratio"}
    assert found.scenarios == 2
    assert found.table().sizes["sample"] == 40
