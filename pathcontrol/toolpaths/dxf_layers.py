"""Layers of DXF drawings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pathcontrol.errors import UnknownNameError
from pathcontrol.toolpaths.dxf_values import layer_of

_SHOWN = 20


class Layers:
    """Which layers of a drawing are read.

    Attributes:
        names: all layers, by name in lower case, as they compare in DXF.
    """

    def __init__(self, document: Any, chosen: Sequence[str] | None) -> None:
        self._table = {layer.dxf.name.lower(): layer for layer in document.layers}
        self.names = {key: layer.dxf.name for key, layer in self._table.items()}
        for layout in (document.modelspace(), *document.blocks):
            for entity in layout:
                name = layer_of(entity)
                self.names.setdefault(name.lower(), name)
        self._chosen = None if chosen is None else {str(name).lower() for name in chosen}
        unknown = [] if chosen is None else [name for name in chosen if str(name).lower() not in self.names]
        if unknown:
            raise UnknownNameError(
                f"layers: there is no layer {str(unknown[0])[:60]!r}, expected some of {self.listed}"
            )

    @property
    def listed(self) -> str:
        """Their names, for errors."""
        names = [repr(name[:60]) for name in self.names.values()]
        return ", ".join(names[:_SHOWN] + ["…"] * (len(names) > _SHOWN))

    def frozen(self, layer: str) -> bool:
        """Whether nothing on it is drawn; a layer that is asked for is read even so."""
        if self._chosen is not None or layer.lower() not in self._table:
            return False
        return bool(self._table[layer.lower()].is_frozen())

    def read(self, layer: str) -> bool:
        """Whether what is on it is read."""
        if self._chosen is not None:
            return layer.lower() in self._chosen
        return not self.frozen(layer) and not (layer.lower() in self._table and self._table[layer.lower()].is_off())
