"""Traversal of a DXF drawing: modelspace in its order, and the blocks inserted in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.dxf.values import common, layer_of, number, object_axes, vector
from pathcontrol.toolpaths.notes import Notes

_MOST_INSERTS = 64  # depth of nesting
_MOST_ENTITIES = 200_000
_EXTERNAL = 4  # a block that stands for another file


class Drawn(NamedTuple):
    """An entity that is drawn.

    Attributes:
        entity: as ezdxf has it.
        layer: its layer; of one on layer 0 in a block, that of the insert.
        matrix: map from its coordinates to those of the drawing, (4, 4).
    """

    entity: Any
    layer: str
    matrix: Array


class Entities:
    """An iterator over the entities of a drawing, inserted blocks included.

    Args:
        source: the file, for errors.
        document: the drawing.
        frozen: whether nothing on a layer is drawn, not even the inserts on it.
        passed: takes note of entities that are marked as invisible.
    """

    def __init__(self, source: str, document: Any, frozen: Callable[[str], bool], passed: Notes) -> None:
        self.source = source
        self._document, self._frozen, self._passed = document, frozen, passed
        self._count = 0

    def __iter__(self) -> Iterator[Drawn]:
        return self._inside(self._document.modelspace(), np.eye(4), None, 0)

    @contextmanager
    def at(self, entity: Any, layer: str) -> Iterator[None]:
        """Name the entity in errors that arise inside the block."""
        try:
            yield
        except Exception as error:  # ezdxf raises whatever its parts raise on malformed entities
            name = f"{entity.dxftype()} {entity.dxf.get('handle') or ''}".strip()
            raise ToolpathError(f"{self.source}, {name} on layer {layer!r}: {error}", file=str(self.source)) from error

    def _inside(self, layout: Any, matrix: Array, parent: str | None, depth: int) -> Iterator[Drawn]:
        for entity in layout:
            self._counted()
            layer = layer_of(entity)
            layer = parent if layer == "0" and parent is not None else layer
            if entity.dxftype() == "ATTDEF" and depth:
                continue
            if common(entity, "invisible", 0):
                self._passed.pass_over("an invisible entity", f"{entity.dxftype()} on layer {layer!r}")
                continue
            if entity.dxftype() != "INSERT":
                yield Drawn(entity, layer, matrix)
            elif not self._frozen(layer):
                yield from self._inserted(entity, matrix, layer, depth)

    def _inserted(self, insert: Any, matrix: Array, layer: str, depth: int) -> Iterator[Drawn]:
        """Yield the entities of the block, once for each place in the rows and columns of the insert."""
        with self.at(insert, layer):
            block = self._block(insert, depth)
            vector(insert, "insert"), vector(block.block, "base_point")  # are finite
            places = _places(insert)
            attributes = [a for a in insert.attribs if not (a.is_invisible or a.dxf.get("invisible", 0))]
        for place in places:
            self._counted()
            yield from self._inside(block, matrix @ place, layer, depth + 1)
        yield from (Drawn(attribute, layer_of(attribute), matrix) for attribute in attributes)

    def _block(self, insert: Any, depth: int) -> Any:
        name = str(insert.dxf.get("name", ""))
        if depth == _MOST_INSERTS:
            raise ToolpathError(
                f"more than {_MOST_INSERTS} blocks inside each other; is {name!r} inserted in itself?",
                value=name,
                limit=_MOST_INSERTS,
            )
        block = self._document.blocks.get(name)
        if block is None:
            raise ToolpathError(f"it inserts block {name!r}, which is not in the file", value=name)
        if block.block.dxf.get("flags", 0) & _EXTERNAL:
            raise ToolpathError(
                f"block {name!r} is in another file, which is not fetched: bind the reference", value=name
            )
        return block

    def _counted(self) -> None:
        self._count += 1
        if self._count > _MOST_ENTITIES:
            raise ToolpathError(
                f"{self.source} draws more than {_MOST_ENTITIES} entities; split the drawing",
                limit=_MOST_ENTITIES,
                file=self.source,
            )


def _places(insert: Any) -> Iterator[Array]:
    """Return the maps of a block's coordinates to those it is inserted in, (4, 4) each."""
    for name in ("xscale", "yscale", "zscale"):
        number(insert, name)
    axes, angle = object_axes(insert), np.radians(number(insert, "rotation"))
    across = number(insert, "column_spacing") * axes @ [np.cos(angle), np.sin(angle), 0.0]
    along = number(insert, "row_spacing") * axes @ [-np.sin(angle), np.cos(angle), 0.0]
    columns, rows = (max(1, int(number(insert, name))) for name in ("column_count", "row_count"))
    first = np.reshape([*insert.matrix44()], (4, 4)).T  # ezdxf multiplies rows from the left
    return (_shifted(first, row * along + column * across) for row in range(rows) for column in range(columns))


def _shifted(matrix: Array, shift: Array) -> Array:
    """Return an affine map, followed by a shift."""
    return np.column_stack([matrix[:, :3], matrix[:, 3] + [*shift, 0.0]])
