"""What comes with the package: its citation, and what the shell completes."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
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


def imported(path: Path) -> set[str]:
    """The top-level packages that a module imports anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module.partition(".")[0])
    return names - sys.stdlib_module_names - {"pathcontrol"}


def requirements(*extras: str) -> set[str]:
    """The names that pyproject.toml asks for, with those of some extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lists = [project["dependencies"], *(project["optional-dependencies"][extra] for extra in extras)]
    return {re.match(r"[\w.-]+", line)[0].lower().replace("_", "-") for lines in lists for line in lines}


def test_whatever_is_imported_is_asked_for():
    # their wheels install beside the packages, where Python does not see of which one they are
    providers = {"pinocchio": ["pin"], "example_robot_data": ["example-robot-data-loaders"]}
    providers |= {"rtde_control": ["ur-rtde"], "rtde_receive": ["ur-rtde"]} | packages_distributions()
    declared = requirements("robots", "mujoco", "cluster", "video", "sweep", "tune", "franka", "ur", "mcap", "mpc")
    used = set.union(*(imported(path) for path in (ROOT / "pathcontrol").rglob("*.py")))
    assert {"numpy", "pinocchio", "umsgpack", "cloudpickle"} <= used
    by = {name: {one.lower().replace("_", "-") for one in providers.get(name, [name])} for name in used}
    assert {name for name, packages in by.items() if not packages & declared} == set()
