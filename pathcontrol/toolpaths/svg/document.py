"""SVG documents, parsed without reading any other file, with look-up of elements and styles."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.svg.shapes import Attributes
from pathcontrol.toolpaths.svg.style_sheet import StyleSheet
from pathcontrol.toolpaths.text import read_text

_LONGEST = 300  # characters of a message of the parser that are shown
_NAMESPACES = ("", "http://www.w3.org/2000/svg")
_MOST_ELEMENTS = 1_000_000
_SERVER = re.compile(
    r"""url\(\s*["']?(?P<link>[^"')]*?)["']?\s*\)(?P<otherwise>.*)""", re.DOTALL
)  # of a gradient or pattern
_HREF = ("href", "{http://www.w3.org/1999/xlink}href")


class Document:
    """A parsed SVG file.

    Attributes:
        path: its name, for errors.
        root: the outermost element.

    Raises:
        ToolpathError: it cannot be read, is no SVG, or defines entities.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        text = read_text(path, "an SVG drawing")
        self.path = os.fspath(path)
        self.root = self._parsed(text)
        self._targets: dict[str, Any] = {}
        self._sheet = StyleSheet()
        self._styles: dict[Any, dict[str, str]] = {}
        for count, element in enumerate(self.root.iter("*")):
            if count == _MOST_ELEMENTS:
                raise ToolpathError(
                    f"{self.path} has more than {_MOST_ELEMENTS} elements; split it into several files",
                    limit=_MOST_ELEMENTS,
                    file=str(self.path),
                )
            if element.get("id") is not None:
                self._targets.setdefault(element.get("id"), element)
            if tag_of(element) == "style" and element.get("type") in (None, "", "text/css"):
                with self.at(element):
                    self._sheet.add("".join(element.itertext()), element.get("media") or "all")
        self._sheet.match(self.root)

    @contextmanager
    def at(self, element: Any) -> Iterator[None]:
        """Name the element in errors that arise inside the block."""
        try:
            yield
        except (InputError, ToolpathError) as error:
            where = error.details_with(file=str(self.path), line=element.sourceline)
            raise ToolpathError(
                f"{self.path}, line {element.sourceline}, {label_of(element)}: {error}", **where
            ) from error

    def style(self, element: Any) -> dict[str, str]:
        """Return the properties of an element that affect the geometry."""
        if element not in self._styles:
            style = self._sheet.of(element)
            painted = {name: self._paint(style[name]) for name in ("fill", "stroke") if name in style}
            self._styles[element] = style | painted
        return self._styles[element]

    def attributes(self, element: Any) -> Attributes:
        """Return the attributes of an element, or the values of its style in their place."""
        style = self.style(element)
        return lambda name: style.get(name, element.get(name))

    def target(self, element: Any) -> Any:
        """Return the element that a use element refers to."""
        return self.linked(next((element.get(name) for name in _HREF if element.get(name) is not None), ""))

    def linked(self, link: str) -> Any:
        """Return the element of this file that ``#id`` stands for."""
        if link.startswith("#") and link[1:] in self._targets:
            return self._targets[link[1:]]
        raise ToolpathError(f"it refers to {link[:60]!r}, expected # and the id of an element in this file", value=link)

    def _paint(self, value: str) -> str:
        """Return a paint; a reference to nothing in this file is replaced by its fallback, or none."""
        found = _SERVER.fullmatch(value.strip())
        if found is None or not found["link"].startswith("#") or found["link"][1:] in self._targets:
            return value
        return found["otherwise"].strip() or "none"

    def _parsed(self, text: str) -> Any:
        from lxml import etree

        entity = text.find("<!ENTITY")
        if entity >= 0:
            line = text.count("\n", 0, entity) + 1
            raise ToolpathError(
                f"{self.path}, line {line}: definitions of entities are refused; save the drawing as plain SVG",
                file=str(self.path),
                line=line,
            )
        parser = etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False)
        try:
            root = etree.fromstring(text.encode("utf-8", "replace"), parser)
        except etree.XMLSyntaxError as error:
            raise ToolpathError(
                f"{self.path} {_refusal(str(error))}", file=str(self.path), line=error.lineno
            ) from error
        if tag_of(root) != "svg":
            raise ToolpathError(
                f"{self.path} begins with the element {str(root.tag)[:60]!r}, expected svg",
                value=str(root.tag),
                file=str(self.path),
            )
        if any(node.target == "xml-stylesheet" for node in root.itersiblings(etree.PI, preceding=True)):
            raise ToolpathError(
                f"{self.path} has its style in another file, which is not fetched; write it in", file=str(self.path)
            )
        return root


def _refusal(message: str) -> str:
    """Rephrase an error of the XML parser in terms of the drawing."""
    if "depth" in message:
        return "has elements nested more than 256 deep; ungroup them"
    if "XML_PARSE_HUGE" in message:
        return "has an attribute of more than 10 MB; split the path"
    if len(message) > _LONGEST:  # it repeats names and values of the file, and ends with the line
        message = f"{message[: _LONGEST // 2]} … {message[-_LONGEST // 4 :]}"
    return f"is no well-formed SVG drawing: {message}"


def tag_of(element: Any) -> str | None:
    """Return the name of an SVG element; None for comments and for data of other programs."""
    if not isinstance(element.tag, str):
        return None
    namespace, _, name = element.tag.removeprefix("{").rpartition("}")
    return name if namespace in _NAMESPACES else None


def label_of(element: Any) -> str:
    """Return an element's tag and its id, if it has one, for messages."""
    identity = element.get("id")
    return f"{tag_of(element)}" if identity is None else f"{tag_of(element)} {identity[:60]!r}"
