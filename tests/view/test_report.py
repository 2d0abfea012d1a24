"""One page about runs: what it says is what was measured and configured, and every name in it is text."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree, html
from PIL import Image
from strategies import floats

import pathcontrol as pc
from pathcontrol import Circle, InputError, RobotModel, Run, metrics
from pathcontrol.analysis.readable import reading
from pathcontrol.analysis.run_metrics import LABELS, UNITS
from pathcontrol.simulation.context import RunContext
from pathcontrol.view.report.pictures import picture
from pathcontrol.view.report.report import report
from pathcontrol.view.report.run_summary import Row, measure, rows
from pathcontrol.view.report.sections import _section
from pathcontrol.view.report.settings_table import settings as groups_of

HOSTILE = "</script><img src=x onerror=alert(1)>&amp;\"'<b>"
SI = {"deg": np.pi / 180, "deg/s": np.pi / 180, "s": 1.0, "N m": 1.0, "N m/rad": 1.0, "": 1.0, "mm": 1e-3, "µm": 1e-6}


def followed(arm: RobotModel, task: pc.PathTask, law: str = "projection", q=(0.7, 1.2), duration: float = 1.5) -> Run:
    if law == "projection":
        controller = pc.Projection(arm, task, k_p=800.0, K_v=[45.0, 100.0])
    else:
        controller = pc.ExtendedMotionPlan(arm, task, K_p=800.0, K_v=[45.0, 100.0], k=20.0)
    return pc.simulate(controller, q, duration=duration, loop=pc.SampledLoop(period=5e-3, torque_limits=True))


@pytest.fixture(scope="module")
def runs(arm: RobotModel, circle: Circle) -> dict[str, Run]:
    return {law: followed(arm, circle, law) for law in ("plan", "projection")}


@pytest.fixture(scope="module")
def file(runs: dict[str, Run], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report(runs, tmp_path_factory.mktemp("report") / "two.html", command="make it")


@pytest.fixture(scope="module")
def page(file: Path) -> html.HtmlElement:
    return parsed(file)


def parsed(file: Path) -> html.HtmlElement:
    return html.document_fromstring(file.read_text(encoding="utf-8"))


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """For reports whose figures do not matter: they take most of the time."""
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """For reports in which the figures are made, and stand with their captions, but are empty images."""
    monkeypatch.setattr("pathcontrol.view.report.pictures._draw", lambda figure: ("png", b""))


def words(element: html.HtmlElement) -> str:
    return " ".join(element.text_content().split())


def table(page: html.HtmlElement, name: str) -> dict[str, list[str]]:
    """The cells of each row by its head, without the marks."""
    found = {}
    for row in page.xpath(f"//table[@id='{name}']//tr[th and td]"):
        found[words(row.find("th")).removesuffix(" ≠")] = [words(cell).removesuffix(" ★") for cell in row.findall("td")]
    return found


def downloads(page: html.HtmlElement) -> dict[str, str]:
    """The files in the page by their names."""
    return {
        link.get("download"): base64.b64decode(link.get("href").partition("base64,")[2]).decode()
        for link in page.xpath("//a[@download]")
    }


def test_every_metric_stands_in_the_page_as_it_was_measured(page, runs):
    said = table(page, "summary")
    for key in metrics(runs["plan"], runs["plan"].task):
        unit, cells = next(
            (m[1] or "", cells)
            for head, cells in said.items()
            if (m := re.fullmatch(re.escape(LABELS[key].replace("_", "")) + r"(?: \[(.*)\])?", head))
        )
        for run, cell in zip(runs.values(), cells, strict=True):
            (value,) = metrics(run, run.task)[key]
            if np.isfinite(value):
                assert float(cell) * SI[unit] == pytest.approx(value, rel=5e-4), key
            else:
                assert cell == "never"


def test_every_metric_has_a_name():
    assert set(LABELS) == set(UNITS)


def test_every_metric_is_explained(page, runs):
    every = [Row(label, "", ()) for label in LABELS.values()]
    summary = _section("Summary", runs=runs, facts=[], rows=every, files=[]).body
    explained = [words(term) for term in html.fromstring(f"<div>{summary}</div>").xpath("//dt")]
    labels = [label.replace("_", "") for label in LABELS.values()]
    assert [label for label in labels if not any(word in label for word in explained)] == []
    told = [words(term) for term in page.xpath("//dl[@class='words']//dt")]
    assert {"contour error", "lag error"} < set(told) < set(explained)  # no toolpath, none of its words


def test_facts(page):
    said = table(page, "summary")
    assert said["robot"] == ["cicese_2dof"] * 2
    assert said["controller"] == ["ExtendedMotionPlan", "Projection"]
    assert said["path"] == ["Circle"] * 2


@given(st.lists(floats(0, 1), min_size=2, max_size=5), st.sampled_from(["e_p_peak", "speed_ratio", "path_time"]))
def test_the_best_of_a_row_is_as_good_as_any(runs, values, key):
    some = {str(i): runs["plan"] for i in range(len(values))}
    (row,) = rows(some, {name: {key: [value]} for name, value in zip(some, values, strict=True)})
    badness = [abs(value - 1) if key == "speed_ratio" else value for value in values]
    rounding = key != "speed_ratio" and any(0 < value < 1e-9 for value in values)
    if len({cell.text for cell in row.cells}) == 1 or (rounding and 0 not in values):
        assert not any(cell.best for cell in row.cells)
        return
    if rounding:  # beside an exact 0, which it may be or not
        assert {cell.text for cell in row.cells if cell.best} <= {"0"}
        return
    best = {cell.text for cell in row.cells if cell.best}
    assert best == {row.cells[int(np.argmin(badness))].text}
    assert all(cell.best == (cell.text in best) for cell in row.cells)


def test_what_never_happens_is_never_the_best(runs):
    some = {"a": runs["plan"], "b": runs["plan"]}
    (row,) = rows(some, {"a": {"settling_time": [np.inf]}, "b": {"settling_time": [3.0]}})
    assert [(cell.text, cell.best) for cell in row.cells] == [("never", False), ("3.000", True)]
    (row,) = rows(some, {name: {"smoothing_deviation": [value]} for name, value in (("a", 1e-5), ("b", 2e-5))})
    assert (row.unit, [cell.best for cell in row.cells]) == ("µm", [False, False])  # of the drawing, not of the run


@given(st.lists(floats(1e-9, 1e3), min_size=1, max_size=5), st.sampled_from(["rad", "rad/s", "m", "s", "N m"]))
def test_readable_units_are_the_same_quantity(values, unit):
    scale, name = reading(unit, np.array(values))
    assert scale * SI[name] == pytest.approx(1.0)


@pytest.mark.usefixtures("no_figures")
def test_rollouts_have_their_median_and_their_extremes(arm, circle, tmp_path):
    run = followed(arm, circle, q=[[0.7, 1.2], [1.0, 0.2], [0.9, 0.1]], duration=0.5)
    peaks = sorted(np.rad2deg(metrics(run, circle)["e_p_peak"]))
    (cell,) = table(parsed(report(run, tmp_path / "r.html")), "summary")["‖ep‖ peak [deg]"]
    assert [float(text) for text in re.findall(r"[\d.]+", cell)] == pytest.approx(
        [peaks[1], peaks[0], peaks[2]], rel=5e-4
    )


def test_downloads_are_the_configuration_the_metrics_and_the_signals(page, runs):
    files = downloads(page)
    assert json.loads(files["configuration.json"]) == {name: run.config for name, run in runs.items()}
    assert json.loads(page.xpath("//pre[@id='configuration-json']")[0].text) == json.loads(files["configuration.json"])
    content = json.loads(files["metrics.json"])
    for name, run in runs.items():
        for key, values in metrics(run, run.task).items():
            assert content["metrics"][name][key] == [v if np.isfinite(v) else None for v in values]
            assert content["units"][key] == UNITS[key]
        assert_signals(files[f"{name}-signals.csv"], run)


def assert_signals(text: str, run: Run) -> None:
    lines = list(csv.DictReader(io.StringIO(text)))
    time = np.array([float(line["time [s]"]) for line in lines])
    samples = np.searchsorted(run.time, time - 1e-6)
    assert (time[0], time[-1]) == (run.time[0], pytest.approx(run.time[-1]))
    assert len(time) <= 501
    for j, joint in enumerate(run["joint"].to_numpy()):
        for name, unit in (("q", "rad"), ("e_v", "rad/s"), ("tau", "N m")):
            column = [float(line[f"{name} {joint} [{unit}]"]) for line in lines]
            np.testing.assert_allclose(column, run.array(name)[0, samples, j], rtol=1e-5, atol=1e-30)


@pytest.mark.usefixtures("no_figures")
def test_long_runs_are_thinned_evenly(arm, circle, tmp_path):
    run = followed(arm, circle, duration=4.0)  # 801 samples
    text = downloads(parsed(report(run, tmp_path / "r.html")))["signals.csv"]
    assert_signals(text, run)
    time = np.array([float(line["time [s]"]) for line in csv.DictReader(io.StringIO(text))])
    assert np.diff(time).max() <= 2 * np.diff(time).min() + 1e-9


@pytest.mark.usefixtures("no_figures")
def test_the_film_of_a_page_with_tables_of_its_own_measures_nothing(runs, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.animation.record.tables", None)
    short = runs["plan"].with_data(runs["plan"].data.isel(time=slice(0, 20)))
    assert table(parsed(report(short, tmp_path / "r.html")), "summary")["path"] == ["Circle"]


def test_figures_are_images_that_parse(page):
    pictures = page.xpath("//figure/img")
    assert len(pictures) >= 5
    for shown in pictures:
        kind, _, data = shown.get("src").partition(";base64,")
        assert kind == "data:image/svg+xml"
        root = etree.fromstring(base64.b64decode(data))
        assert root.tag.endswith("svg")
        assert shown.get("alt")
        assert float(root.get("width").removesuffix("pt")) / 72 * 96 == pytest.approx(int(shown.get("width")), abs=1)


def test_a_figure_too_large_as_svg_is_a_png(runs, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.pictures._LARGEST", 0)
    large = picture(pc.error_figure(runs["plan"]), "errors")
    kind, _, data = large.href.partition(";base64,")
    assert kind == "data:image/png"
    image = Image.open(io.BytesIO(base64.b64decode(data)))
    assert image.width == pytest.approx(large.width / 96 * 200, abs=2)  # as wide on the page, 200 dots an inch


# --- settings ----------------------------------------------------------------------------------------------

scalars = st.one_of(st.booleans(), st.integers(-9, 9), st.none(), st.text(max_size=8), floats(-9, 9))
keys = st.text("abcxyz", min_size=1, max_size=3)
configs = st.dictionaries(keys, st.one_of(scalars, st.dictionaries(keys, st.one_of(scalars, st.lists(scalars)))))


@settings(max_examples=10)
@given(configs)
def test_equal_configurations_do_not_differ(config):
    assert not any(setting.differs for group in groups_of([config, config]) for setting in group.settings)


@settings(max_examples=10)
@given(configs, st.data())
def test_one_change_is_one_difference(config, data):
    key = data.draw(st.sampled_from(["a", "law"]))
    one, other = ({**config, "controller": {**(_table(config.get("controller"))), key: v}} for v in ("this", "that"))
    changed = [(group.title, s) for group in groups_of([one, other]) for s in group.settings if s.differs]
    assert [(title, s.name, s.values) for title, s in changed] == [("controller", key, ("this", "that"))]


def _table(value) -> dict:
    return value if isinstance(value, dict) else {}


@settings(max_examples=20)
@given(st.lists(floats(-9, 9), min_size=20, max_size=40))
def test_many_paths_are_told_together(numbers):
    config = {"controller": {"sequence": [{"controller": "Projection", "k_p": 8.0, "at": n} for n in numbers]}}
    said = {s.name: s.values[0] for group in groups_of([config]) for s in group.settings}
    assert said["number"] == str(len(numbers))
    assert said["k_p"] == "8"
    assert len(said) == 4


def test_differences_are_marked_in_the_page(page, runs):
    rows = page.xpath("//table[@id='settings']//tr[@class='differs']")
    marked = {words(row.find("th")).removesuffix(" ≠") for row in rows}
    first, second = (run.config["controller"] for run in runs.values())
    assert marked == {key for key in first.keys() | second.keys() if first.get(key) != second.get(key)}
    assert all(len(set(table(page, "settings")[name])) == 2 for name in marked)


# --- names -------------------------------------------------------------------------------------------------


def hostile_run(run: Run, name: str) -> Run:
    """The run with a name where names can be: joints, and texts of the configuration."""
    data = run.data.assign_coords(joint=[f"1 {name}", f"2 {name}"])
    config = run.config | {name: {name: name}, "controller": {"controller": name}, "experiment": name}
    return Run(data, config | {"versions": {name: name}}, RunContext.of(run.robot, run.task))


def skeleton(file: Path) -> list[tuple[str, tuple[str, ...]]]:
    """All elements with the names of their attributes."""
    return [(e.tag, tuple(sorted(e.attrib))) for e in parsed(file).iter() if isinstance(e.tag, str)]


@pytest.mark.usefixtures("no_figures")
def test_hostile_names_are_text(runs, arm, tmp_path):
    pages = []
    for name in ("plain", HOSTILE):
        robot = pc.load_robot(_renamed(arm, name))
        run = hostile_run(followed(robot, Circle(1.0, 2.0), duration=0.3), name)
        pages.append(report({name: run, f"2{name}": run}, tmp_path / f"{len(pages)}.html", title=name, command=name))
    assert skeleton(pages[0]) == skeleton(pages[1])
    said = words(parsed(pages[1]).body)
    assert said.count(" ".join(HOSTILE.split())) > 10


def _renamed(arm: RobotModel, name: str) -> str:
    root = etree.fromstring(arm.source.text.encode())
    root.set("name", name)
    for extension in root.xpath("pathcontrol"):  # which names joints, too
        root.remove(extension)
    for i, joint in enumerate(root.xpath("joint[@type='revolute' or @type='continuous']")):
        joint.set("name", f"{i + 1} {name}")
    return etree.tostring(root, encoding="unicode")


# --- arguments ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wrong", [{}, [1], None, {"a": 1}])
def test_what_is_no_run_is_refused(wrong, tmp_path):
    with pytest.raises(InputError, match="expected a Run"):
        report(wrong, tmp_path / "r.html")
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_a_robot_is_refused(runs, tmp_path):
    with pytest.raises(InputError, match="robot"):
        report(Run(runs["plan"].data, {}), tmp_path / "r.html")


def test_a_run_of_positions_only_has_a_report(runs, arm, tmp_path):
    run = runs["plan"]
    alone = Run.from_arrays(run.time, {"joint_1": "rad", "joint_2": "rad"}, {"q": run.array("q")}, {}, robot=arm)
    page = parsed(report(alone, tmp_path / "r.html"))
    assert table(page, "summary")["path"] == ["not known"]
    head = downloads(page)["signals.csv"].partition("\r\n")[0]
    assert head == "time [s],q joint_1 [rad],q joint_2 [rad]"


def test_a_run_without_a_path_has_the_metrics_that_need_none(runs, arm):
    run = runs["plan"]
    arrays = {name: run.array(name) for name in run.data.data_vars}
    alone = Run.from_arrays(run.time, {"joint_1": "rad", "joint_2": "rad"}, arrays, {}, robot=arm)
    found, full = measure(alone), measure(run)
    assert found.items() <= full.items()
    assert found.keys() >= {"e_p_peak", "e_v_rms", "tau_demand_peak"}


@pytest.mark.usefixtures("undrawn")
def test_arms_of_different_joints_stand_side_by_side(runs, tmp_path):
    one = pc.load_robot("cicese_2dof", lock={"joint_2": 0.0})
    line = pc.Line([0.0], [1.0], 1.0)
    law = pc.ComputedTorque(one, line, K_p=800.0, K_v=45.0)
    run = pc.simulate(law, [0.0], duration=0.5)
    page = parsed(report({"two": runs["plan"], HOSTILE: run}, tmp_path / "r.html"))
    captions = [words(caption) for caption in page.xpath("//figcaption")]
    assert {caption.partition(":")[0] for caption in captions} == {"two", " ".join(HOSTILE.split())}
    assert len(table(page, "summary")["robot"]) == 2
