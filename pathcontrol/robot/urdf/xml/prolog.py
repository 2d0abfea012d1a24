"""What may stand before the first element of an XML file, passed over in time linear in its length."""

from __future__ import annotations

import re

COMMENT, INSTRUCTION = ("<!--", "-->"), ("<?", "?>")

_BLANK = re.compile(r"\ufeff?\s*")
_SPACE = re.compile(r"\s*")


def end_of_prolog(text: str, *skipped: tuple[str, str]) -> int:
    """Return where the first thing begins that is neither blank nor one of ``skipped``, each by its begin and its end.

    A byte order mark at the very start is passed over too. What has no end is not skipped.
    """
    position, found = _matched(_BLANK, text, 0), True
    while found:
        found = False
        for begin, end in skipped:
            if text.startswith(begin, position) and (last := text.find(end, position + len(begin))) >= 0:
                position, found = _matched(_SPACE, text, last + len(end)), True
    return position


def _matched(blank: re.Pattern[str], text: str, position: int) -> int:
    """Return where a run of blanks ends that begins at ``position``; every text matches."""
    match = blank.match(text, position)
    return position if match is None else match.end()
