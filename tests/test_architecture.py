"""The floors of the house: imports run one way, and nothing imports itself, however far around."""

from __future__ import annotations

import ast
import re
import sys
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
#: modules that import parts of the package inside functions, as these load what few calls need; commands all do
LATE = {
    "analysis.contours": 2,
    "analysis.tool_metrics": 1,
    "cartesian.recognition": 1,
    "experiments.outputs": 4,
    "experiments.reproduce": 4,
    "experiments.sensitivity_page": 3,
    "robot.loading": 1,
    "simulation.context": 5,
    "simulation.run": 1,
    "simulation.storage.run_file": 4,
    "sweeps.cluster.connection": 1,
    "sweeps.cluster.dispatch": 1,
    "tasks.spline": 1,
    "view.animation.animation": 1,
    "view.animation.scene.desired_path": 1,
    "view.bodies.body_visuals": 1,
    "view.report.pictures": 13,
    "view.report.report": 3,
    "view.video": 1,
}
#: libraries that are imported inside functions, as they take long to load or are extras; others load by ``load_extra``
HEAVY = {
    "distributed",
    "example_robot_data",
    "ezdxf",
    "imageio_ffmpeg",
    "lxml",
    "mcap",
    "numpy",
    "playwright",
    "pyarrow",
    "pymoo",
    "rich",
    "scipy",
    "sympy",
    "xarray",
}
QUESTIONS = ("What ", "Which ", "Where ", "How ", "Whether ")


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
def tree_of(name: str) -> ast.Module:
    """The syntax tree of a module."""
    return ast.parse(MODULES[name].read_text(encoding="utf-8"))


@cache
def imports_of(name: str) -> set[str]:
    """What a module imports of the package: at its top, in functions, and for its types."""
    return {target for node in ast.walk(tree_of(name)) for target in imported(node)} - {name}


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


def test_no_module_is_too_long():
    lengths = {name: path.read_text(encoding="utf-8").count("\n") for name, path in MODULES.items()}
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_saved_runs_find_classes_by_the_registry():
    storage = [name for name in MODULES if name.startswith("pathcontrol.simulation.storage")]
    used = {".".join(target.split(".")[:2]) for name in storage for target in imports_of(name)}
    assert storage
    assert used & {f"pathcontrol.{package}" for package in ("cartesian", "profiles", "toolpaths")} == set()


def test_only_robot_knows_pinocchio():
    knowing = {name.split(".")[1] for name, path in MODULES.items() if "import pinocchio" in path.read_text("utf-8")}
    assert knowing == {"robot"}


def imports_in_functions(name: str) -> Iterator[ast.Import | ast.ImportFrom]:
    """The import statements inside the functions of a module."""
    functions = [node for node in ast.walk(tree_of(name)) if isinstance(node, ast.FunctionDef)]
    found = {node for function in functions for node in ast.walk(function)}
    yield from (node for node in found if isinstance(node, ast.Import | ast.ImportFrom))


def test_imports_inside_functions_are_counted():
    late: Counter[str] = Counter()
    libraries = set()
    for name in MODULES:
        short = name.removeprefix("pathcontrol.")
        for node in imports_in_functions(name):
            whole = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [str(node.module)]
            libraries |= {one.split(".")[0] for one in whole} - {"pathcontrol"}
            late[short] += any(imported(node))
    commands = [name for name in late if name.startswith("cli.")]
    assert {name: count for name, count in late.items() if count and name not in commands} == LATE
    assert libraries - sys.stdlib_module_names == HEAVY


def docstrings() -> Iterator[tuple[str, str]]:
    """All docstrings of the package, each with its place."""
    for name in MODULES:
        for node in ast.walk(tree_of(name)):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
                yield f"{name}: {getattr(node, 'name', '')}", text


def test_docstrings_begin_with_a_sentence_on_one_line():
    for place, text in docstrings():
        first, *more = text.split("\n")
        assert not first.startswith(QUESTIONS), f"{place}: {first}"
        assert not more or not more[0], f"{place}: its first sentence goes on"


def test_the_recipes_of_contributing_name_what_there_is():
    text = (ROOT.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    flat = re.sub(r"\s+", " ", text)
    for place in set(re.findall(r"`([\w/.]+(?:/|\.pyi?|\.hpp|\.md))`", flat)) - {"src/", "reader.py", "base.py"}:
        assert any((root / place).exists() for root in (ROOT, ROOT.parent)), place
    named = re.findall(r"`(\w+)` (?:in|of) `([\w/.]+\.(?:pyi?|hpp))`", flat)
    assert len(named) > 10
    for name, place in named:
        assert re.search(rf"\b{name}\b", (ROOT / place).read_text(encoding="utf-8")), f"{name} in {place}"
