"""The part of an XML file before its first element, skipped in time linear in its length."""

from __future__ import annotations

import re

COMMENT, INSTRUCTION = ("<!--", "-->"), ("<?", "?>")

_BLANK = re.compile(r"\ufeff?\s*")
_SPACE = re.compile(r"\s*")


def end_of_prolog(text: str, *skipped: tuple[str, str]) -> int:
    """Return the position of the first text that is neither blank nor one of ``skipped``, each a (begin, end).

    A byte order mark at the very start is passed over too. What has no end is not skipped.
    """
    position, found = _match_end(_BLANK, text, 0), True
    while found:
        found = False
        for begin, end in skipped:
            if text.startswith(begin, position) and (last := text.find(end, position + len(begin))) >= 0:
                position, found = _match_end(_SPACE, text, last + len(end)), True
    return position


def _match_end(blank: re.Pattern[str], text: str, position: int) -> int:
    """Return the end of the run of blanks that begins at ``position``."""
    match = blank.match(text, position)
    return position if match is None else match.end()
