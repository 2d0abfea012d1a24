"""What comes with the package: its citation, and what the shell completes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from patience import PATIENCE

ROOT = Path(__file__).parent.parent
PROGRAM = "import sys; sys.argv[0] = 'pathcontrol'; from pathcontrol.cli import main; main(prog_name='pathcontrol')"


def complete(*words: str) -> list[str]:
    """What Bash is offered for the last of some words."""
    line = {"COMP_WORDS": " ".join(("pathcontrol", *words)), "COMP_CWORD": str(len(words))}
    environment = os.environ | line | {"_PATHCONTROL_COMPLETE": "bash_complete"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=PATIENCE
    )
    return [entry.partition(",")[2] or entry for entry in done.stdout.split("\n") if entry]


@pytest.mark.parametrize(
    ("words", "offered"),
    [(("to",), ["toolpath"]), (("re",), ["report", "reproduce"]), (("toolpath", "--fe"), ["--feed"])],
)
def test_the_shell_completes_commands_and_options(words, offered):
    assert sorted(complete(*words)) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_lines_of_the_documentation_give_what_the_shells_run(shell):
    page = (ROOT / "docs" / "getting_started.md").read_text(encoding="utf-8")
    assert f"_PATHCONTROL_COMPLETE={shell}_source pathcontrol" in page
    environment = os.environ | {"_PATHCONTROL_COMPLETE": f"{shell}_source"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=PATIENCE
    )
    assert f"{shell}_complete" in done.stdout


def test_the_citation_has_what_exports_need():
    """As GitHub and cffconvert take it: authors, a title, a version and the date that gives the year."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert re.search(rf"^version: {re.escape(project['version'])}$", text, re.MULTILINE)
    assert re.search(r"^date-released: \d{4}-\d{2}-\d{2}$", text, re.MULTILINE)
    assert re.search(r"^cff-version: 1\.2\.0$", text, re.MULTILINE)
    assert f"license: {project['license']}" in text
    assert "family-names: Moreno" in text
    assert "family-names: Kelly" in text
