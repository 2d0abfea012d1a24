"""Layers of DXF drawings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pathcontrol.errors import UnknownNameError
from pathcontrol.toolpaths.dxf.values import common, layer_of
from pathcontrol.toolpaths.notes import Notes

_SHOWN = 20
_SOLID = ("continuous", "bylayer", "byblock", "")


class Layers:
    """The layers of a drawing, and the choice of those that are read.

    Args:
        document: the drawing.
        chosen: names of layers, or None for all that are seen and plotted.
        passed: takes note of the layers that are left out.

    Attributes:
        names: all layers, by name in lower case, as they compare in DXF.
        types: of all entities.
    """

    def __init__(self, document: Any, chosen: Sequence[str] | None, passed: Notes) -> None:
        self._passed = passed
        self.types: set[str] = set()
        self._table = {layer.dxf.name.lower(): layer for layer in document.layers}
        self.names = {key: layer.dxf.name for key, layer in self._table.items()}
        for layout in (document.modelspace(), *document.blocks):
            for entity in layout:
                name = layer_of(entity)
                self.types.add(entity.dxftype())
                self.names.setdefault(name.lower(), name)
        self._chosen = None if chosen is None else {str(name).lower() for name in chosen}
        unknown = [] if chosen is None else [name for name in chosen if str(name).lower() not in self.names]
        if unknown:
            raise UnknownNameError(
                f"layers: there is no layer {str(unknown[0])[:60]!r}, expected some of {self.listed}",
                argument="layers",
                value=unknown[0],
            )

    @property
    def listed(self) -> str:
        """The names of the layers, for errors."""
        names = [repr(name[:60]) for name in self.names.values()]
        return ", ".join(names[:_SHOWN] + ["…"] * (len(names) > _SHOWN))

    def frozen(self, layer: str) -> bool:
        """Return whether nothing on a layer is drawn; one that is asked for is read even so."""
        if self._chosen is not None or layer.lower() not in self._table:
            return False
        return bool(self._table[layer.lower()].is_frozen())

    def read(self, layer: str) -> bool:
        """Return whether the content of a layer is read."""
        if self._chosen is not None:
            return layer.lower() in self._chosen
        reason = self._unseen(layer.lower())
        if reason:
            self._passed.pass_over(f"an entity on layer {layer!r}, which {reason},", "layers= reads it if it is named")
        return not reason

    def dashes(self, entity: Any, layer: str) -> str:
        """Return the name of the line type of an entity, empty for a solid line."""
        name = str(common(entity, "linetype", "ByLayer"))
        if name.lower() == "bylayer" and layer.lower() in self._table:
            name = str(self._table[layer.lower()].dxf.get("linetype", ""))
        return "" if name.lower() in _SOLID else name

    def _unseen(self, layer: str) -> str:
        """Return the reason why a layer is invisible, empty if it is visible."""
        if layer == "defpoints":
            return "is never plotted"
        entry = self._table.get(layer)
        if entry is None:
            return ""
        if entry.is_frozen() or entry.is_off():
            return "is frozen" if entry.is_frozen() else "is off"
        return "" if entry.dxf.get("plot", 1) else "is not to be plotted"
