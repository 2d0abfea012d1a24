"""Removal of remarks and line protocols that RS274/NGC does not know."""

from __future__ import annotations

import re

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.words import are_words
from pathcontrol.toolpaths.notes import Notes

_SIGN = re.compile(r"\A\[|//|\*|\A(?:[Nn][0-9]+[ \t]*)?[Mm]0*11[78](?![0-9.])")
_CHECKSUM = re.compile(r"\*[ \t]*[0-9]+\Z")
_COMMENT = "a comment of G-code stands after ; or in ( )"


def without_remarks(text: str, line: int, passed: Notes) -> str:
    """Return the line without text in [ ], a remark after //, a message, or a checksum, which move nothing.

    Raises:
        ToolpathError: there is such a thing in it, and it is to be refused; or a line after // could be a block that a
            switch of the machine skips.
    """
    found = _SIGN.search(text)
    if found is None:
        return text
    if found[0] == "[":
        return _without_brackets(text, line, passed)
    if found[0] == "//":
        return _without_slashes(text, line, passed)
    if found[0] == "*":
        return _without_checksum(text, line, passed)
    passed.unless_refused(
        "M117 or M118 with its text", line, f"{text[:40]!r} shows a text on a printer: write it as a comment"
    )
    return ""


def _without_brackets(text: str, line: int, passed: Notes) -> str:
    """Return the line without a text in brackets."""
    if not text.endswith("]"):
        return text
    passed.unless_refused(
        "a text in [ ]", line, f"{text[:40]!r} is not understood: {_COMMENT}, not in [ ]: write it so"
    )
    return ""


def _without_slashes(text: str, line: int, passed: Notes) -> str:
    """Return the line without a remark after //."""
    before, _, after = text.partition("//")
    if after.strip() and are_words(after):
        raise ToolpathError(
            f"{text[:40]!r} may be a comment, or a line that is carried out or not by a switch of the machine: delete "
            "it, or the //",
            value=text,
        )
    passed.unless_refused(
        "a text after //", line, f"{text[:40]!r} is not understood: {_COMMENT}, not after //: write it so"
    )
    return before.rstrip()


def _without_checksum(text: str, line: int, passed: Notes) -> str:
    """Return the line without its checksum."""
    found = _CHECKSUM.search(text)
    if found is None:
        return text
    passed.unless_refused("a checksum", line, f"{found[0][:20]!r}: checksums are not supported: delete them")
    return text[: found.start()].rstrip()
