"""The choice of layers and groups of an SVG drawing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pathcontrol.errors import UnknownNameError
from pathcontrol.toolpaths.svg.document import Document, tag_of

_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_SHOWN = 20


class Chosen:
    """The elements of a drawing that are read: all, or those with given names and their content.

    A name is the label of a layer, as Inkscape and Illustrator write it, or the id of any element.

    Args:
        document: the drawing.
        names: the names; None for all.

    Raises:
        UnknownNameError: nothing in the drawing has one of the names.
    """

    def __init__(self, document: Document, names: Sequence[str] | None) -> None:
        self.all = names is None
        self._elements: set[Any] = set()
        for name in names or ():
            found = [element for element in document.root.iter("*") if name in _names(element)]
            if not found:
                raise UnknownNameError(
                    f"layers: there is no layer or id {str(name)[:60]!r}, expected some of {_list_names(document)}",
                    argument="layers",
                    value=name,
                )
            self._elements.update(found)

    def named(self, element: Any) -> bool:
        """Return whether an element itself was asked for."""
        return element in self._elements


def layer_name(element: Any) -> str:
    """Return the name of a layer of Inkscape, empty if the element is none."""
    if element.get(f"{_INKSCAPE}groupmode") != "layer":
        return ""
    return element.get(f"{_INKSCAPE}label") or element.get("id") or ""


def _names(element: Any) -> list[str | None]:
    names = [element.get("id")]
    if tag_of(element) == "g":
        names += [element.get(f"{_INKSCAPE}label"), element.get("data-name")]
    return names


def _list_names(document: Document) -> str:
    """Return the names of the layers and groups, for errors; of all elements where there are none."""
    elements = [element for element in document.root.iter("*") if tag_of(element) is not None]
    groups = [element for element in elements if tag_of(element) == "g"] or elements
    names = {element: [name for name in _names(element)[::-1] if name] for element in groups}
    listed = list(dict.fromkeys(repr(found[0][:60]) for found in names.values() if found))
    return ", ".join(listed[:_SHOWN] + ["…"] * (len(listed) > _SHOWN)) or "none: its elements have no names"
