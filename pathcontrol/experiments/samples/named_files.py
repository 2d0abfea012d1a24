"""The files that an experiment reads: those that it names, and those that its Python files name."""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

_LONGEST = 1000


def find_files(value: Any, folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield names and paths of the files that texts in a value are, relative to ``folder``; ``FILE.py:Name`` is one."""
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from find_files(item, folder)
    elif isinstance(value, str) and (path := _file(folder, re.sub(r"(\.py):\w+$", r"\1", value))):
        yield value, path
        if path.suffix == ".py":
            yield from ((f"{value}: {name}", file) for name, file in _in_python(path))


def _in_python(path: Path) -> Iterator[tuple[str, Path]]:
    """Yield the names and paths of files beside a Python file that are texts in it."""
    try:
        nodes = list(ast.walk(ast.parse(path.read_bytes())))
    except (SyntaxError, ValueError):
        return  # it is refused where it is run
    texts = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    for text in dict.fromkeys(texts):
        if (file := _file(path.parent, text)) and file != path:
            yield text, file


def _file(folder: Path, name: str) -> Path | None:
    if not name or len(name) > _LONGEST or "\0" in name:
        return None
    try:
        return folder / name if (folder / name).is_file() else None
    except OSError:  # too long for a name
        return None


def make_relative(value: Any, folder: Path) -> Any:
    """Return the same value, with names relative to ``folder`` in the place of whole paths."""
    if isinstance(value, Mapping):
        return {name: make_relative(item, folder) for name, item in value.items()}
    if isinstance(value, list):
        return [make_relative(item, folder) for item in value]
    named = isinstance(value, str) and Path(value).is_absolute() and list(find_files(value, folder))
    return os.path.relpath(value, folder) if named else value
