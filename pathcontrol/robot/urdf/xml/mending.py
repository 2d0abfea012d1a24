"""Repair of slightly malformed XML, as most readers of URDF accept it, with warnings that name the line.

Every line of the mended text is the same line of the text that was given.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from lxml import etree

from pathcontrol.robot.urdf.checks.finding import Finding, quote
from pathcontrol.robot.urdf.xml.prolog import COMMENT, end_of_prolog

_DECLARATION = re.compile(r"<\?xml\s(?P<inside>.*?)\?>", re.DOTALL)
_VERSION = re.compile(r"""version\s*=\s*["']([^"']*)["']""")
_ROOT = re.compile(r"<[A-Za-z_][^\s/>]*")
_PREFIX = re.compile(r"Namespace prefix (\S+) (?:for \S+ )?on \S+ is not defined")
_MOST_PREFIXES = 50

_UNDECLARED = "undeclared:"  # the namespace of a prefix that is not declared


def mend(text: str) -> tuple[str, list[Finding]]:
    """Repair the declaration, comments and prefixes of a text; return it with the findings."""
    findings: list[Finding] = []
    for repair in (_without_declaration, _without_comments, _with_prefixes):
        text, found = repair(text)
        findings += found
    return text, findings


def parser(*, recover: bool = False) -> etree.XMLParser:
    """Return a parser that touches neither the network, nor any other file, nor any entity."""
    return etree.XMLParser(
        encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, recover=recover
    )


def _without_declaration(text: str) -> tuple[str, list[Finding]]:
    """Blank an XML declaration that is wrong or misplaced."""
    start = end_of_prolog(text, COMMENT)
    found = _DECLARATION.match(text, start)
    if found is None:
        return text, []
    before = text[:start]
    line = _line(text, found.start("inside"))
    said = []
    if before.strip("\ufeff") or before.count("\ufeff") != len(before):
        said.append(f"line {line}: <?xml ...?> is not at the very start of the file; remove what stands before it")
    version = _VERSION.search(found["inside"])
    if version is not None and version[1] not in ("1.0", "1.1"):
        said.append(f"line {line}: there is no XML version {quote(version[1])}; write 1.0")
    end = found.end()
    return before + _blank(text[start:end]) + text[end:], [_finding("xml-declaration", message) for message in said]


def _without_comments(text: str) -> tuple[str, list[Finding]]:
    """Blank all comments if one of them has a '--' inside."""
    comments = list(_comments(text))
    bad = [start for start, end in comments if "--" in text[start + 4 : end - 2]]  # also where it ends in --->
    if not bad:
        return text, []
    where = f"line {_line(text, bad[0])}{_and_others(len(bad) - 1)}"
    message = f"{where}: '--' inside of a comment, which XML forbids; write '- -'"
    pieces, position = [], 0
    for start, end in comments:
        pieces += [text[position:start], _blank(text[start:end])]
        position = end
    return "".join([*pieces, text[position:]]), [_finding("xml-comment", message)]


def _comments(text: str) -> Iterator[tuple[int, int]]:
    """Yield the begin and the end of each comment."""
    start = text.find("<!--")
    while start >= 0 and (end := text.find("-->", start + 4)) >= 0:
        yield start, end + 3
        start = text.find("<!--", end + 3)


def _with_prefixes(text: str) -> tuple[str, list[Finding]]:
    """Declare a namespace for each prefix that has none."""
    findings: list[Finding] = []
    root = _ROOT.search(text, _prolog(text))
    while root is not None and len(findings) < _MOST_PREFIXES:
        new = dict(_undeclared(text))
        if not new:
            break
        declared = "".join(f' xmlns:{prefix}="{_UNDECLARED}{prefix}"' for prefix in new)
        text = text[: root.end()] + declared + text[root.end() :]
        findings += [_prefix(prefix, line) for prefix, line in new.items()]
    return text, findings


def _prolog(text: str) -> int:
    """Return the end of the comments before the first element."""
    end = 0
    for start, after in _comments(text):
        if _ROOT.search(text, end, start):
            break
        end = after
    return end


def _undeclared(text: str) -> Iterator[tuple[str, int]]:
    """Yield the prefixes without a namespace that the parser reports, with their lines, the last first."""
    reading = parser(recover=True)
    try:
        etree.fromstring(text.encode(), reading)
    except etree.XMLSyntaxError:  # nothing could be recovered
        return
    for error in reversed(reading.error_log):
        if found := _PREFIX.match(error.message):
            yield found[1], error.line


def _prefix(prefix: str, line: int) -> Finding:
    message = f"line {line}: the prefix {quote(prefix + ':')} is declared nowhere; add xmlns:{prefix}=... to <robot>"
    return _finding("xml-prefix", message)


def _finding(code: str, message: str) -> Finding:
    return Finding("warning", code, "file", message)


def _blank(text: str) -> str:
    """Return as many line breaks as a text has, at least one space."""
    return "\n" * text.count("\n") or " "


def _line(text: str, position: int) -> int:
    """Return the number of the line that holds a position."""
    return text.count("\n", 0, position) + 1


def _and_others(count: int) -> str:
    return f" and {count} more" if count else ""
