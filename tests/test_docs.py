"""What the documentation says: its Python runs and prints what it says it prints, its TOML files are experiments.

The ``python`` blocks of a page are run in order, in one namespace and in an empty folder. A ``text`` block right
after one is what it prints. A block that begins with ``# NAME.py`` is also the file of that name. Figures are drawn
once, as SVG, where a block does not tell of its files: tests of figures hold their formats to one another.
"""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

import pytest

import pathcontrol
from pathcontrol.errors import PathControlWarning
from pathcontrol.experiments.runner import load_setup
from pathcontrol.simulation.run import VARIABLES

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted(
    name
    for page in DOCS.rglob("*.md")
    if not (name := page.relative_to(DOCS).with_suffix("").as_posix()).startswith("_")  # not of a build
)
#: words of the warnings that a page speaks of; no other page gives any
WARNED = {"ensembles": "need a period below", "profiles": "the arm did not move"}
FORMATS = pathcontrol.save_figure.__defaults__[0]
NEEDS = {"robots": "example_robot_data", "path_tool_curve": "example_robot_data"}

_BLOCK = re.compile(r"^```(python|text|toml)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Block(NamedTuple):
    language: str
    line: int
    text: str
    output: str | None


def blocks(page: str) -> list[Block]:
    """The blocks of a page that can be run, each with what it is said to print."""
    source = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    found = list(_BLOCK.finditer(source))
    return [
        Block(m[1], source.count("\n", 0, m.start()) + 1, m[2], _output(source, m, after))
        for m, after in zip_longest(found, found[1:])
        if m[1] != "text"
    ]


def _output(source: str, block: re.Match, after: re.Match | None) -> str | None:
    follows = after is not None and after[1] == "text" and not source[block.end() : after.start()].strip()
    return after[2] if follows else None


def assert_printed(printed: str, said: str, where: str) -> None:
    """The same words, and numbers that differ by 2 % or a unit of the last digit at most."""
    message = f"{where} prints:\n{printed}"
    assert _NUMBER.sub("#", printed).split() == _NUMBER.sub("#", said).split(), message
    for got, want in zip(_NUMBER.findall(printed), _NUMBER.findall(said), strict=True):
        decimals = re.match(r"[-+]?\d+\.?(\d*)", want)[1]
        unit = 10.0 ** (int(want.partition("e")[2] or 0) - len(decimals)) if decimals else 0.0
        assert abs(float(got) - float(want)) <= max(0.02 * abs(float(want)), 1.01 * unit), message


def _compiled(block: Block, page: str):
    # blank lines, so that a traceback gives the line of the page
    return compile("\n" * block.line + block.text, f"docs/{page}.md", "exec", dont_inherit=True)


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)])
def test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch):
    if page in NEEDS:
        pytest.importorskip(NEEDS[page])
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": page}
    warnings.simplefilter("error", PathControlWarning)
    if page in WARNED:
        warnings.filterwarnings("ignore", f".*{WARNED[page]}", PathControlWarning)
    for block in blocks(page):
        where = f"docs/{page}.md:{block.line}"
        if block.language == "toml":
            Path("experiment.toml").write_text(block.text, encoding="utf-8")
            load_setup("experiment.toml")
            continue
        if name := re.match(r"# (\w+\.py)\n", block.text):
            Path(name[1]).write_text(block.text, encoding="utf-8")
        printed = io.StringIO()
        formats = FORMATS if ".png" in (block.output or "") else ("svg",)
        monkeypatch.setattr(pathcontrol.save_figure, "__defaults__", (formats,))
        with contextlib.redirect_stdout(printed):
            exec(_compiled(block, page), namespace)
        assert_printed(printed.getvalue(), block.output or "", where)


def test_every_output_follows_its_code():
    for page in PAGES:
        source = (DOCS / f"{page}.md").read_text(encoding="utf-8")
        told = sum(block.output is not None for block in blocks(page))
        assert source.count("\n```text\n") == told, f"docs/{page}.md has output that belongs to no code"


def test_the_table_of_variables_is_that_of_a_run():
    source = (DOCS / "getting_started.md").read_text(encoding="utf-8")
    for name, (dimensions, unit, meaning) in VARIABLES.items():
        assert f"| `{name}` | {', '.join(dimensions)} | {unit} | {meaning} |" in source


def test_every_public_name_is_in_the_api_page():
    source = (DOCS / "api.md").read_text(encoding="utf-8")
    modules = set(re.findall(r"automodule:: (\S+)", source))
    for name in set(pathcontrol.__all__) - {"analysis", "figures"}:  # packages, whose functions are there as well
        module = getattr(pathcontrol, name).__module__
        assert module in modules or re.search(rf"{module}\.{name}$", source, re.MULTILINE), f"api.md lacks {name}"


def test_every_finding_is_in_the_robots_page():
    source = (DOCS / "robots.md").read_text(encoding="utf-8")
    code = "".join(file.read_text() for file in (DOCS.parent / "pathcontrol" / "robot" / "urdf").rglob("*.py"))
    codes = set(re.findall(r'Finding\([^"]*(?:"(?:error|warning|note)", )?"([a-z-]+)"', code)) - {"error", "warning"}
    assert len(codes) > 30
    assert {name for name in codes if f"`{name}`" not in source} == set()


def test_every_source_of_the_engine_is_in_its_page():
    listed = re.findall(r"^\| `(\w+\.[ch]pp)` \|", (DOCS / "engine.md").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(
        file.name for file in (Path(pathcontrol.__file__).parent / "engine" / "src").glob("*.?pp")
    )


def test_pages_load_nothing_from_the_network():
    """Formulas and the gallery are to be read offline; links may lead anywhere."""
    configuration = (DOCS / "conf.py").read_text(encoding="utf-8")
    path = re.search(r'^mathjax_path = "(.*)"$', configuration, re.MULTILINE)
    assert path, "MathJax would come from the network"
    assert "//" not in path[1]
    for page in DOCS.rglob("*.md"):
        if "_build" not in page.parts:
            loaded = re.findall(r'src="([^"]*)"|!\[[^]]*\]\(([^)]*)\)', page.read_text(encoding="utf-8"))
            assert not [a or b for a, b in loaded if re.match(r"(https?:)?//", a or b)], page
