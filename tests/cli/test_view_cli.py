"""``pathcontrol view`` and ``report``, and ``--open``: from saved runs to pages."""

from __future__ import annotations

import json
import shlex
import shutil
import webbrowser
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from hypothesis import given
from hypothesis import strategies as st
from lxml import html

import pathcontrol as pc
from pathcontrol import Circle, RobotModel, Run
from pathcontrol.cli import main
from pathcontrol.cli.saved import names


@pytest.fixture(scope="module")
def run(arm: RobotModel, circle: Circle) -> Run:
    law = pc.Projection(arm, circle, k_p=800.0, K_v=[45.0, 100.0])
    return pc.simulate(law, [[0.7, 1.2], [1.0, 0.2]], duration=0.2)


@pytest.fixture(autouse=True)
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of reports take most of the time, and nothing here is about them."""
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])


@pytest.fixture(scope="module")
def saved(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the run in two places, and once without its robot."""
    folder = tmp_path_factory.mktemp("saved")
    for name in ("first.nc", "results/mine/run.nc"):
        run.save(folder / name)
    Run(run.data, run.config).save(folder / "bare.nc")
    return folder


@pytest.fixture
def folder(saved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with those files."""
    shutil.copytree(saved, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The addresses that the default browser is asked to open."""
    asked: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: bool(asked.append(address)) or True)
    return asked


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def done(*arguments: str | Path) -> dict:
    """What a command says with --json."""
    result = call(*arguments, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def title(page: Path) -> str:
    return html.document_fromstring(page.read_text(encoding="utf-8")).findtext(".//title")


# --- view --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("named", "page"),
    [
        (["first.nc"], "first.html"),
        (["results/mine"], "results/mine/run.html"),
        (["results/mine/run.nc", "first.nc"], "results/mine/comparison.html"),
        (["first.nc", "--out", "deep/er/a.html"], "deep/er/a.html"),
    ],
)
def test_the_page_is_written_beside_the_run_or_where_asked(folder, named, page):
    assert done("view", *named)["written"] == {"html": page}
    assert "cicese_2dof" in title(folder / page)


def test_it_says_what_it_wrote(folder):
    said = call("view", "first.nc").stdout
    assert "first.html" in said
    assert "Projection" in said
    assert "first" in call("report", "first.nc", "results/mine").stdout


def test_options_are_those_of_record(folder):
    run = Run.load("first.nc")
    done("view", "first.nc", "--rollout", "1", "--tool", "link_1", "--out", "cli.html")
    own = pc.record(run, rollout=1, tool="link_1").save(folder / "own.html")
    assert Path("cli.html").read_bytes() == own.read_bytes()
    done("view", "first.nc", "results/mine", "--layout", "ghosted", "--out", "cli.html")
    own = pc.record({"first": run, "mine": Run.load("results/mine/run.nc")}, layout="ghosted").save(folder / "own.html")
    assert Path("cli.html").read_bytes() == own.read_bytes()


def test_open_opens_the_page(folder, opened):
    for command in ("view", "report"):
        (page,) = done(command, "first.nc", "--open")["written"].values()
        assert opened.pop() == (folder / page).as_uri()
    assert done("view", "first.nc")
    assert opened == []


def test_without_a_browser_it_says_what_to_open(folder, monkeypatch):
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    result = call("view", "first.nc", "--open")
    assert result.exit_code == 0
    assert "open first.html" in result.stderr


def test_run_open_writes_the_page_that_the_file_does_not_ask_for(folder, opened):
    text = '[robot]\nsource = "cicese_2dof"\n[task]\ntype = "line"\nstart = [0.0, 0.0]\nend = [0.1, 0.1]\nspeed = 1.0\n'
    text += '[controller]\ntype = "computed_torque"\nK_p = 800.0\nK_v = 45.0\n[plant]\nfriction = "none"\n'
    Path("mine.toml").write_text(text, encoding="utf-8")
    assert "html" not in done("run", "mine.toml")["written"]
    written = done("run", "mine.toml", "--open")["written"]
    assert opened == [(folder / written["html"]).as_uri()]
    assert "cicese_2dof" in title(folder / written["html"])
    # and the report of that run tells the file
    page = html.document_fromstring(Path(done("report", "results/mine")["written"]["report"]).read_text("utf-8"))
    assert text in [pre.text for pre in page.xpath("//pre")]


def test_reproduce_open_opens_both_pages(tmp_path, opened, monkeypatch):
    from pathcontrol.experiments import reproduce

    monkeypatch.setattr(reproduce, "reproduce", lambda out: {"seconds": 0.0})
    assert call("reproduce", "--out", tmp_path, "--open", "--json").exit_code == 0
    assert opened == [(tmp_path / f"{name}.html").as_uri() for name in ("extended_motion_plan", "projection")]


# --- report ------------------------------------------------------------------------------------------------


def test_the_report_says_the_command_that_makes_it_again(folder):
    Path("name of it").mkdir()
    written = done("report", "first.nc", "results/mine", "--title", "it's & that", "--out", "name of it/r.html")
    page = Path(written["written"]["report"])
    first = page.read_text(encoding="utf-8")
    command = html.document_fromstring(first).xpath("//pre[@id='made-by']")[0].text
    assert title(page) == "it's & that"
    assert list(written["runs"]) == ["first", "mine"]
    program, *arguments = shlex.split(command)
    assert program == "pathcontrol"
    page.unlink()
    assert call(*arguments).exit_code == 0
    assert page.read_text(encoding="utf-8") == first


def test_a_run_without_its_robot_needs_one(folder):
    refused = call("report", "bare.nc")
    assert refused.exit_code == 2
    assert "'bare.nc'" in refused.stderr
    assert "--robot FILE" in refused.stderr
    assert done("report", "bare.nc", "--robot", "cicese_2dof")["written"] == {"report": "report.html"}
    assert done("view", "bare.nc", "--robot", "cicese_2dof")["written"] == {"html": "bare.html"}


# --- errors ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["view", "report"])
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.nc"], ["no file", "'none.nc'"]),
        (["text.nc"], ["'text.nc'", "not a run"]),
        (["empty"], ["'empty'", "run.nc"]),
        (["many"], ["'many'", "many/a.nc", "many/b.nc"]),
        (["first.nc", "./first.nc"], ["'first.nc'", "once"]),
        (["first.nc", "--out", "empty"], ["empty"]),
        (["first.nc", "--layout", "round"], ["'round'", "beside", "ghosted"]),
        (["bare.nc", "--robot", "no_such_robot"], ["no_such_robot", "cicese_2dof"]),
        ([], ["RUN"]),
    ],
)
def test_errors_name_the_value_and_write_nothing(folder, command, arguments, said):
    Path("text.nc").write_text("no run", encoding="utf-8")
    for name in ("empty", "many"):
        Path(name).mkdir()
    for name in "ab":
        shutil.copy("first.nc", f"many/{name}.nc")
    before = sorted(folder.rglob("*"))
    result = call(command, *arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert all(word in result.stderr for word in said), result.stderr
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rollout", "7"], ["7", "has 2"]),
        (["--tool", "nose"], ["nose", "tool"]),
        (["--mp4", "a.avi"], ["a.avi", ".mp4"]),
    ],
)
def test_errors_of_view(folder, arguments, said):
    result = call("view", "first.nc", *arguments)
    assert result.exit_code == 2
    assert all(word in result.stderr for word in said), result.stderr


# --- names -------------------------------------------------------------------------------------------------

_parts = st.sampled_from(["a", "b", "run", "c d"])
_files = st.lists(
    st.builds(lambda folders, stem: Path("/", *folders, f"{stem}.nc"), st.lists(_parts, max_size=3), _parts),
    min_size=1,
    max_size=5,
    unique=True,
)


@given(_files)
def test_names_tell_runs_apart_and_are_the_ends_of_their_paths(files):
    whole = [file.parent if file.name == "run.nc" and file.parent.name else file.with_suffix("") for file in files]
    if len(set(whole)) < len(whole):
        return  # /a/run.nc and /a.nc
    called = names(files)
    assert len(set(called)) == len(called)
    for name, path in zip(called, whole, strict=True):
        assert f"/{path}".endswith(f"/{name}")
        shorter = name.partition("/")[2]
        if shorter:  # no folder is said that is not needed
            assert sum(f"/{other}".endswith(f"/{shorter}") for other in whole) > 1
