"""The floors of the house: imports run one way, nothing imports itself, however far around, and all are asked for."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections import Counter, deque
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from importlib.metadata import packages_distributions
from pathlib import Path

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
Import = ast.Import | ast.ImportFrom
Documented = ast.Module | ast.ClassDef | ast.FunctionDef
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


def libraries_of(node: Import) -> set[str]:
    """The top-level packages that an import statement names."""
    whole = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [str(node.module)]
    return {one.split(".")[0] for one in whole}


@cache
def nodes_of(name: str) -> tuple[list[Import], list[Import], list[Documented]]:
    """All import statements of a module, those inside its functions, and what may have a docstring."""
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
    imports, inside, documented = list[Import](), list[Import](), list[Documented]()
    waiting: deque[tuple[ast.AST, bool]] = deque([(tree, False)])
    while waiting:
        node, in_function = waiting.popleft()
        if isinstance(node, Import):
            imports.append(node)
            inside += [node] * in_function
        elif isinstance(node, ast.stmt | ast.Module):  # no expression holds one of them
            if isinstance(node, Documented):
                documented.append(node)
            in_function = in_function or isinstance(node, ast.FunctionDef)
            waiting += ((child, in_function) for child in ast.iter_child_nodes(node) if not isinstance(child, ast.expr))
        elif isinstance(node, ast.ExceptHandler | ast.match_case):
            waiting += ((child, in_function) for child in node.body)
    return imports, inside, documented


@cache
def imports_of(name: str) -> set[str]:
    """What a module imports of the package: at its top, in functions, and for its types."""
    return {target for node in nodes_of(name)[0] for target in imported(node)} - {name}


def floor(name: str) -> int | None:
    """The floor of a module; ``None`` for what stands beside all of them, such as errors."""
    parts = name.split(".")
    return FLOORS.index(parts[1]) if len(parts) > 1 and parts[1] in FLOORS else None


def test_every_package_has_a_floor():
    assert {path.parent.name for path in ROOT.glob("*/__init__.py")} == set(FLOORS)


def test_no_module_imports_itself_around_a_corner():
    graph = {name: imports_of(name) for name in MODULES}
    list(TopologicalSorter(graph).static_order())  # raises CycleError, which names the circle


def test_imports_run_down():
    before = {"pathcontrol", "pathcontrol.__main__", "pathcontrol.figures"}  # they stand before the house
    upwards = []
    for name in MODULES.keys() - before:
        mine = floor(name)
        for target in imports_of(name):
            theirs = floor(target)
            if theirs is not None and (mine is None or theirs > mine):
                upwards.append(f"{name} imports {target}, which is on a floor above")
    assert upwards == []


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


def test_imports_inside_functions_are_counted():
    late: Counter[str] = Counter()
    libraries = set[str]()
    for name in MODULES:
        short = name.removeprefix("pathcontrol.")
        for node in nodes_of(name)[1]:
            libraries |= libraries_of(node) - {"pathcontrol"}
            late[short] += any(imported(node))
    commands = [name for name in late if name.startswith("cli.")]
    assert {name: count for name, count in late.items() if count and name not in commands} == LATE
    assert libraries - sys.stdlib_module_names == HEAVY


def docstrings() -> Iterator[tuple[str, str]]:
    """All docstrings of the package, each with its place."""
    for name in MODULES:
        for node in nodes_of(name)[2]:
            if text := ast.get_docstring(node):
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


def requirements(*extras: str) -> set[str]:
    """The names that pyproject.toml asks for, with those of some extras."""
    project = tomllib.loads((ROOT.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lists = [project["dependencies"], *(project["optional-dependencies"][extra] for extra in extras)]
    return {re.match(r"[\w.-]+", line)[0].lower().replace("_", "-") for lines in lists for line in lines}


def test_whatever_is_imported_is_asked_for():
    # their wheels install beside the packages, where Python does not see of which one they are
    providers = {"pinocchio": ["pin"], "example_robot_data": ["example-robot-data-loaders"]}
    providers |= {"rtde_control": ["ur-rtde"], "rtde_receive": ["ur-rtde"]} | packages_distributions()
    declared = requirements("robots", "mujoco", "cluster", "video", "sweep", "tune", "franka", "ur", "mcap", "mpc")
    used = {top for name in MODULES for node in nodes_of(name)[0] for top in libraries_of(node)}
    used -= sys.stdlib_module_names | {"pathcontrol"}
    assert {"numpy", "pinocchio", "umsgpack", "cloudpickle"} <= used
    by = {name: {one.lower().replace("_", "-") for one in providers.get(name, [name])} for name in used}
    assert {name for name, packages in by.items() if not packages & declared} == set()
