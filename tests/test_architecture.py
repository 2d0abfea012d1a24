"""The floors of the house: imports run one way, and nothing imports itself, however far around."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "pathcontrol"
#: from the lowest to the highest; a package imports from its own floor and from those below
FLOORS = [
    "geometry",
    "robot",
    "tasks",
    "toolpaths",
    "profiles",
    "control",
    "engine",
    "cartesian",
    "simulation",
    "analysis",
    "hardware",
    "sweeps",
    "tuning",
    "comparison",
    "export",
    "view",
    "experiments",
    "cli",
]


def names() -> dict[str, Path]:
    """All modules of the package by their dotted names."""
    found = {".".join(path.relative_to(ROOT.parent).with_suffix("").parts): path for path in ROOT.rglob("*.py")}
    return {name.removesuffix(".__init__"): path for name, path in found.items()}


MODULES = names()


def imported(node: ast.AST) -> Iterator[str]:
    """What of the package an import statement names, modules or packages."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name in MODULES)
    elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
        for alias in node.names:
            inner = f"{node.module}.{alias.name}"
            yield inner if inner in MODULES else str(node.module)


@cache
def imports_of(name: str) -> set[str]:
    """What a module imports of the package: at its top, in functions, and for its types."""
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
    return {target for node in ast.walk(tree) for target in imported(node)} - {name}


def floor(name: str) -> int | None:
    """The floor of a module; ``None`` for what stands beside all of them, such as errors."""
    parts = name.split(".")
    return FLOORS.index(parts[1]) if len(parts) > 1 and parts[1] in FLOORS else None


def test_every_package_has_a_floor():
    assert {path.parent.name for path in ROOT.glob("*/__init__.py")} == set(FLOORS)


def test_no_module_imports_itself_around_a_corner():
    graph = {name: imports_of(name) for name in MODULES}
    list(TopologicalSorter(graph).static_order())  # raises CycleError, which names the circle


@pytest.mark.parametrize("name", sorted(MODULES))
def test_imports_run_down(name):
    mine = floor(name)
    if name in {"pathcontrol", "pathcontrol.__main__", "pathcontrol.figures"}:
        return  # they stand before the house
    for target in imports_of(name):
        theirs = floor(target)
        if mine is None:
            assert theirs is None, f"{name} stands below all floors and imports {target}"
        else:
            assert theirs is None or theirs <= mine, f"{name} imports {target}, which is on a floor above"


def test_a_module_is_found_by_its_name():
    count = Counter(path.name for path in MODULES.values())
    assert {name for name, times in count.items() if times > 1} <= {"__init__.py", "base.py", "reader.py"}


def test_saved_runs_find_classes_by_the_registry():
    storage = [name for name in MODULES if name.startswith("pathcontrol.simulation.storage")]
    used = {".".join(target.split(".")[:2]) for name in storage for target in imports_of(name)}
    assert storage
    assert used & {f"pathcontrol.{package}" for package in ("cartesian", "profiles", "toolpaths")} == set()


def test_only_robot_knows_pinocchio():
    knowing = {name.split(".")[1] for name, path in MODULES.items() if "import pinocchio" in path.read_text("utf-8")}
    assert knowing == {"robot"}
