"""Checks of the shapes and meshes of a robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path

from lxml import etree

from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf.checks.finding import Finding, quote
from pathcontrol.robot.urdf.elements import place_of
from pathcontrol.robot.urdf.mesh_files import find_mesh, has_candidates
from pathcontrol.robot.urdf.mesh_names import is_local
from pathcontrol.robot.urdf.numbers import POSE, read_numbers

_SHAPES: dict[str, dict[str, int]] = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
}


def check_shapes(root: etree._Element) -> Iterator[Finding]:
    """Check that every shape can be read; readers leave out one that cannot, and all after it in its link."""
    for link in root.iterfind("link"):
        for holder in link.iterchildren("visual", "collision"):
            for problem in _shape_problems(holder):
                message = f"{problem}; it and every <{holder.tag}> after it are left out, correct it"
                yield Finding("warning", "shape-unreadable", place_of(link), message)


def check_meshes(root: etree._Element, base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Finding]:
    """Check that every mesh that is drawn is found, without fetching any; missing collision meshes are counted."""
    problem = cache(lambda name: _mesh_problem(name, base_dir, package_dirs))
    yield from _check_drawn(root, problem)
    names = dict.fromkeys(mesh.get("filename", "") for mesh in root.iterfind("link/collision/geometry/mesh"))
    missing = [name for name in names if problem(name)]
    if missing:
        count = f"{len(missing)} of {len(names)} collision meshes"
        message = f"{count} cannot be read, {quote(missing[0])} first; they are never drawn or needed"
        yield Finding("note", "collision-mesh-missing", "robot", message)


def _check_drawn(root: etree._Element, problem: Callable[[str], str | None]) -> Iterator[Finding]:
    """Check the meshes of visuals."""
    for link in root.iterfind("link"):
        for name in dict.fromkeys(mesh.get("filename", "") for mesh in link.iterfind("visual/geometry/mesh")):
            if name and (reason := problem(name)):
                code = "mesh-missing" if is_local(name) else "mesh-remote"
                yield Finding("warning", code, place_of(link), f"mesh {quote(name)}: {reason}")


def _mesh_problem(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> str | None:
    """Return the reason why a mesh cannot be read; ``None`` if it can, or if there is no folder to look in."""
    try:
        find_mesh(name, base_dir, package_dirs)
    except UrdfError as error:
        homeless = is_local(name) and not has_candidates(name, base_dir, package_dirs)
        return None if homeless else str(error)
    return None


def _shape_problems(holder: etree._Element) -> Iterator[str]:
    """Yield the faults of a ``<visual>`` or ``<collision>``."""
    for origin in holder.findall("origin")[:1]:
        yield from _bad_numbers(origin, POSE)
    shape = next(holder.iterfind("geometry/*"), None)
    if shape is None or shape.tag not in _SHAPES:
        tag = "nothing" if shape is None else f"<{shape.tag}>"
        yield f"<geometry> holds {tag}, expected one of {', '.join(_SHAPES)}"
        return
    required = ("filename",) if shape.tag == "mesh" else tuple(_SHAPES[shape.tag])
    yield from (f"<{shape.tag}> lacks {name}" for name in required if not shape.get(name))
    yield from _bad_numbers(shape, _SHAPES[shape.tag])


def _bad_numbers(element: etree._Element, lengths: dict[str, int]) -> Iterator[str]:
    """Yield the attributes of an element that are not the numbers expected."""
    for name, length in lengths.items():
        text = element.get(name)
        if text and read_numbers(text, length) is None:
            yield f"{name} of <{element.tag}> is {quote(text)}, expected {length} finite number(s)"
