"""The style of SVG, as far as it affects geometry: attributes, style attributes and style sheets.

tinycss2 parses the sheets and cssselect2 matches their selectors. Both are bounded here, for a hostile sheet of a few
kilobytes could keep them busy for hours.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import tinycss2
from cssselect2 import ElementWrapper, Matcher, SelectorError, compile_selector_list

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.svg.paint import PAINT, is_valid

#: properties that affect the geometry
KNOWN = frozenset({"display", "visibility", "transform", "x", "y", "width", "height", "cx", "cy", "r", "rx", "ry"})
_CLIPS = frozenset({"clip-path", "mask"})
_REFUSED_ATTRIBUTES = frozenset({"transform-origin", "transform-box"})
#: properties that would change what is cut, and are not understood
REFUSED = frozenset({"d", "translate", "rotate", "scale", "offset-path", "zoom"}) | _REFUSED_ATTRIBUTES
_ATTRIBUTES = KNOWN | PAINT | _CLIPS | _REFUSED_ATTRIBUTES
_PROPERTIES = KNOWN | PAINT | _CLIPS | REFUSED
_DECIDES = re.compile(
    rf"(?<![\w-])(?:(?:{'|'.join(sorted(KNOWN | REFUSED | _CLIPS))})\s*:"
    rf"|(?:{'|'.join(sorted(PAINT))})\s*:\s*(?:none|transparent|0))"
)
_PLAIN = re.compile(r"[^\"'\\(){}\[\]@!/]*")  # declarations that can be split without a parser
_EMBEDDED = re.compile(r"url\(\s*[\"']?data:[^)]*\)")
_SLOW = re.compile("has|nth|of-type|only|last")  # pseudo-classes that look at all siblings or descendants
_LONGEST, _MOST_SELECTORS, _MOST_STEPS, _MOST_FOR_SLOW = 500_000, 10_000, 20_000_000, 2_000
_SCREEN = re.compile("(?:only )?(?:all|screen)?")

#: importance, specificity and order, which decide between declarations of one property
Rank = tuple[bool, tuple[int, ...], int]
#: rank and value by property
Declarations = dict[str, tuple[Rank, str]]
_ATTRIBUTE, _INLINE = (-1,), (9,)  # below and above the specificity of all selectors


class StyleSheet:
    """The rules of all style elements that affect the geometry.

    Raises:
        ToolpathError: it is not known whether a rule applies, or stands in a sheet to be fetched; there is too much.
    """

    def __init__(self) -> None:
        self._matcher = _Matcher()
        self._length = self._selectors = 0
        self._slow = False
        self._found: dict[Any, Declarations] = {}

    def add(self, css: str, media: str = "all") -> None:
        """Add the rules of one style element; later ones win."""
        css = _EMBEDDED.sub("url()", css)
        self._length += len(css)
        if self._length > _LONGEST:
            raise ToolpathError(
                f"the style sheet has more than {_LONGEST} characters; write styles as attributes", limit=_LONGEST
            )
        self._add(tinycss2.parse_stylesheet(css, skip_comments=True, skip_whitespace=True), f"@media {media}", 0)

    def match(self, root: Any) -> None:
        """Find the rules of each element of a document, once all are added."""
        if not self._selectors:
            return
        for count, element in enumerate(_Element.from_xml_root(root).iter_subtree()):
            if self._slow and count > _MOST_FOR_SLOW:
                raise ToolpathError(
                    "the style sheet counts siblings in too large a drawing; write styles as attributes"
                )
            matches = [match for match in self._matcher.match(element) if match[2] is None]
            for specificity, order, _, payload in matches:
                found = self._found.setdefault(element.etree_element, {})
                _overlay(found, {name: ((rank[0], specificity, order), v) for name, (rank, v) in payload.items()})

    def of(self, element: Any) -> dict[str, str]:
        """Return the relevant properties of an element, from attributes, sheets and its own style."""
        given = element.attrib
        names = [name for name in given if name in _ATTRIBUTES and is_valid(name, given[name])]
        found: Declarations = {name: ((False, _ATTRIBUTE, 0), given[name]) for name in names}
        _overlay(found, self._found.get(element, {}))
        if "style" in given:
            _overlay(found, _declarations(given["style"]))
        return {name: value for name, (_, value) in found.items()}

    def _add(self, rules: list[Any], media: str, depth: int) -> None:
        query = media.removeprefix("@media").strip().lower()
        if depth > 4 or not _SCREEN.fullmatch(query):
            _refuse_condition(_text(rules), media)
            return
        for rule in rules:
            if rule.type == "qualified-rule":
                self._add_rule(rule)
            elif rule.type == "at-rule":
                self._add_at_rule(rule, depth)

    def _add_at_rule(self, rule: Any, depth: int) -> None:
        head = f"@{rule.at_keyword} {_text(rule.prelude).strip()}".strip()
        if rule.lower_at_keyword == "import":
            raise ToolpathError(
                f"the style sheet has {head[:60]!r}, which is not fetched: write its rules here", value=head
            )
        if rule.lower_at_keyword == "media" and rule.content is not None and depth < 4:
            inside = tinycss2.parse_rule_list(rule.content, skip_comments=True, skip_whitespace=True)
            self._add(inside, head, depth + 1)
        elif rule.content is not None:
            _refuse_condition(_text(rule.content), head)

    def _add_rule(self, rule: Any) -> None:
        given = _parse_rule(rule.content)
        if not given:
            return
        head = _text(rule.prelude).strip()
        self._selectors += 1 + head.count(",")
        if self._selectors > _MOST_SELECTORS:
            raise ToolpathError(
                f"the style sheet has over {_MOST_SELECTORS} selectors; write styles as attributes",
                limit=_MOST_SELECTORS,
            )
        self._slow |= bool(_SLOW.search(head))
        try:
            selectors = compile_selector_list(rule.prelude)
        except (SelectorError, SyntaxError, RecursionError, MemoryError) as error:
            raise ToolpathError(
                f"the style sheet gives {', '.join(given)} to {head[:60]!r}, which is no selector that is understood: "
                "write it as attributes",
                value=head,
            ) from error
        for selector in selectors:
            self._matcher.add_selector(selector, given)


class _Matcher(Matcher):
    """A matcher of selectors that stops when it has tried too many."""

    def __init__(self) -> None:
        super().__init__()
        self._tried = 0

    def add_relevant_selectors(self, element: Any, selectors: Any, relevant_selectors: Any) -> None:
        self._tried += len(selectors)
        _check_steps(self._tried)
        super().add_relevant_selectors(element, selectors, relevant_selectors)


class _Element(ElementWrapper):
    """An element that counts how often selectors look at ancestors and siblings in its document."""

    def __init__(self, etree_element: Any, parent: Any, *args: Any, **options: Any) -> None:
        super().__init__(etree_element, parent, *args, **options)
        self._steps: list[int] = [0] if parent is None else parent._steps

    @property
    def ancestors(self) -> Iterator[Any]:
        element = self.parent
        while element is not None:
            self._step()
            yield element
            element = element.parent

    @property
    def previous_siblings(self) -> Iterator[Any]:
        element = self.previous
        while element is not None:
            self._step()
            yield element
            element = element.previous

    def _step(self) -> None:
        self._steps[0] += 1
        _check_steps(self._steps[0])


def _check_steps(steps: int) -> None:
    """Check that matching of selectors has not taken too many steps."""
    if steps > _MOST_STEPS:
        raise ToolpathError("the style sheet takes too long to match its selectors; write styles as attributes")


def _refuse_condition(text: str, head: str) -> None:
    """Refuse a conditional rule that affects the geometry."""
    if _DECIDES.search(text):
        raise ToolpathError(
            f"the style sheet decides with {head[:60]!r} what is drawn: write it as attributes", value=head
        )


def _text(nodes: Any) -> str:
    """Write parsed CSS as text."""
    try:
        return tinycss2.serialize([node for node in nodes if node.type != "error"])
    except RecursionError as error:
        raise ToolpathError("the style has brackets nested too deep; write it as attributes") from error
    except TypeError as error:  # an error further inside
        raise ToolpathError(f"the style is no CSS: {error}; write it as attributes") from error


def _overlay(found: Declarations, more: Declarations) -> None:
    """Add declarations to those found; of equal names the higher rank wins."""
    for name, declaration in more.items():
        if name not in found or declaration[0] >= found[name][0]:
            found[name] = declaration


@lru_cache(maxsize=4096)
def _declarations(text: str) -> Declarations:
    """Parse a style attribute."""
    if not _PLAIN.fullmatch(text):
        return _parse_rule(text)
    pairs = (part.partition(":") for part in text.split(";"))
    found: Declarations = {}
    for name, colon, value in pairs:
        if colon:
            _overlay(found, _keep(name.strip().lower(), value.strip(), False))
    return found


def _parse_rule(content: Any) -> Declarations:
    """Return the relevant declarations in the content of a rule."""
    found: Declarations = {}
    for node in tinycss2.parse_blocks_contents(content, skip_comments=True, skip_whitespace=True):
        if node.type == "declaration" and all(token.type != "error" for token in node.value):
            value = _text([token for token in node.value if token.type != "comment"])
            _overlay(found, _keep(node.lower_name, value.strip(), node.important))
        elif node.type in ("qualified-rule", "at-rule") and node.content is not None:
            _refuse_condition(_text(node.content), _text(node.prelude).strip())
    return found


def _keep(name: str, value: str, important: bool) -> Declarations:
    """Return a valid inline declaration of a relevant property, else nothing."""
    if name not in _PROPERTIES or not is_valid(name, value):
        return {}
    return {name: ((important, _INLINE, 0), value)}
