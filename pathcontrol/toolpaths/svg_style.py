"""Style of SVG as far as it decides what is drawn and where: attributes, style attributes and style sheets."""

from __future__ import annotations

import re
from typing import Any

from pathcontrol.errors import ToolpathError

#: presentation attributes that have a say in the geometry
KNOWN = frozenset({"display", "visibility", "transform", "x", "y", "width", "height", "cx", "cy", "r", "rx", "ry"})
_REFUSED_ATTRIBUTES = frozenset({"clip-path", "mask", "transform-origin", "transform-box"})
#: properties that would change what is cut, and are not understood
REFUSED = frozenset({"d", "translate", "rotate", "scale", "offset-path", "zoom"}) | _REFUSED_ATTRIBUTES
_ATTRIBUTES = KNOWN | _REFUSED_ATTRIBUTES
_SELECTOR = re.compile(r"(\*|[a-zA-Z][\w-]*)?([.#][\w-]+)?")
_UNTIL_MARK = re.compile(r"[^{};]*")
_BRACE = re.compile("[{}]")
_DECIDES = re.compile(rf"(?<![\w-])({'|'.join(sorted(KNOWN | REFUSED))})\s*:")
_ATTRIBUTE, _INLINE = -1, 4  # ranks below and above those of selectors

#: by property, what decides between declarations (importance, rank, order), and the value
Declarations = dict[str, tuple[tuple[bool, int, int], str]]


class StyleSheet:
    """The rules of all style elements, by what they select: ``tag``, ``.class``, ``#id`` or ``tag.class``.

    Raises:
        ToolpathError: a rule that decides about geometry has another selector, or stands in a sheet to be fetched.
    """

    def __init__(self) -> None:
        self._rules: dict[str, Declarations] = {}
        self._count = 0

    def add(self, css: str) -> None:
        """The rules of one style element; later ones win."""
        text, at = _without_comments(css), 0
        while at < len(text):
            prelude = _UNTIL_MARK.match(text, at)
            assert prelude is not None
            head, at = prelude[0].strip(), prelude.end() + 1
            if head.startswith("@import"):
                raise ToolpathError(f"the style sheet has {head[:60]!r}, which is not fetched: write its rules here")
            if text[at - 1 : at] == "{":
                end = _block_end(text, at)
                self._rule(head, text[at:end])
                at = end + 1

    def of(self, element: Any, tag: str) -> dict[str, str]:
        """The properties that matter of an element, as attributes, sheets and its own style give them."""
        given = element.attrib
        found: Declarations = {name: ((False, _ATTRIBUTE, 0), given[name]) for name in _ATTRIBUTES.intersection(given)}
        if self._rules:
            for key in _keys(element, tag):
                _overlay(found, self._rules.get(key, {}))
        _overlay(found, _declarations(given.get("style", ""), _INLINE, 0))
        return {name: value for name, (_, value) in found.items()}

    def _rule(self, head: str, body: str) -> None:
        if head.startswith("@"):
            if _DECIDES.search(body):
                raise ToolpathError(f"the style sheet decides with {head[:60]!r} what is drawn: write it as attributes")
            return
        self._count += 1
        given = _declarations(body, 0, self._count)
        for selector in map(str.strip, head.split(",") if given else ()):
            match = _SELECTOR.fullmatch(selector)
            if match is None or not selector:
                raise ToolpathError(
                    f"the style sheet gives {', '.join(given)} to {selector[:60]!r}, "
                    "expected tag, .class, #id or tag.class: write it as attributes"
                )
            ranked = {
                name: ((important, _rank(match), order), value)
                for name, ((important, _, order), value) in given.items()
            }
            _overlay(self._rules.setdefault(selector.removeprefix("*") or "*", {}), ranked)


def _overlay(found: Declarations, more: Declarations) -> None:
    for name, declaration in more.items():
        if name not in found or declaration[0] >= found[name][0]:
            found[name] = declaration


def _declarations(body: str, rank: int, order: int) -> Declarations:
    """Of ``name: value; …`` the properties that matter."""
    found: Declarations = {}
    for part in body.split(";"):
        name, colon, value = part.partition(":")
        name = name.strip().lower()
        if colon and name in KNOWN | REFUSED:
            value, important, _ = value.partition("!")
            _overlay(found, {name: ((bool(important), rank, order), value.strip())})
    return found


def _rank(match: re.Match[str]) -> int:
    kind = (match[2] or " ")[0]
    return {"#": 3, ".": 2 if match[1] else 1}.get(kind, 0)


def _keys(element: Any, tag: str) -> list[str]:
    marks = [f".{name}" for name in (element.get("class") or "").split()]
    if element.get("id"):
        marks.append(f"#{element.get('id')}")
    return ["*", tag, *marks, *(tag + mark for mark in marks)]


def _without_comments(css: str) -> str:
    first, *others = css.split("/*")
    return first + "".join(" " + other.partition("*/")[2] for other in others)


def _block_end(text: str, at: int) -> int:
    """Index of the brace that closes the block begun before ``at``."""
    depth = 1
    for match in _BRACE.finditer(text, at):
        depth += 1 if match[0] == "{" else -1
        if depth == 0:
            return match.start()
    return len(text)
