"""Advice in messages, worded for its reader: keyword arguments become options or keys of a file."""

from __future__ import annotations

import re
from collections.abc import Callable

#: returns what the reader calls an argument and its value, or None if the reader has no such argument
Speak = Callable[[str, str], str | None]

_WORD = re.compile(
    r"""(?<![\w=])'[^']*' | `[^`]*` | <[^>]*>                      # quoted text is left alone
    | (?<![-\w.&?\#/=$])(?<!\w\()(?P<name>[A-Za-z_]\w*)=(?!=)
      (?P<value>'[^']*'|\([^()]*\)|\[[^][]*\]|\{[^{}]*\}|-?[\w.…]+(?:(?<=[0-9.][eE])[-+][0-9]+)?(?:\([^()]*\))?)?
    """,
    re.VERBOSE,
)
_BREAK = re.compile(r"; |, | \(")
_END = re.compile(r"; |, |\n|$")
_SETTING = re.compile(
    r"""(?P<name>[a-z]\w*)\ =\                                   # as Python shows the value: a text, a list, …
    (?P<value>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*"|\([^()]*\)|\[[^][]*\]|\{[^{}]*\}|<[^<>]*>|[^,;'"([{<]+?)
    (?=[,;]|:\ )
    """,
    re.VERBOSE,
)


def reword_advice(message: str, speak: Speak) -> str:
    """Return ``message`` with each ``name=value`` replaced by what ``speak`` calls it.

    Where there is no such thing, the advice is left out, from the semicolon or comma before it to the one after it.
    """
    parts, end = [], 0
    for word in _WORD.finditer(message):
        if word["name"] is None or word.start() < end:
            continue
        said = speak(word["name"], (word["value"] or "").strip("'"))
        if said is not None:
            parts.append(message[end : word.start()] + said)
            end = word.end()
            continue
        starts = [found.start() for found in _BREAK.finditer(message, end, word.start())]
        starts = [start for start in starts if _depth(message[end:start]) <= 0]
        if starts:
            parts.append(message[end : starts[-1]])
            end = _end_of_advice(message, starts[-1], word.end())
    return "".join(parts) + message[end:]


def reword_setting(message: str, speak: Speak) -> str:
    """Return ``message`` with a leading ``name = value`` or ``name:`` replaced by what ``speak`` calls it."""
    if (named := re.match(r"([a-z]\w*)(?=: )", message)) and (said := speak(named[1], "")) is not None:
        return said + message[named.end() :]
    found = _SETTING.match(message)
    said = None if found is None else speak(found["name"], _unquote(found["value"]))
    return message if found is None or said is None else said + message[found.end() :]


def _unquote(value: str) -> str:
    """Return the text inside quotation marks, or the value itself."""
    return value[1:-1] if value[0] in "'\"" else value


def _end_of_advice(message: str, start: int, after: int) -> int:
    """Return the end of the advice that begins at ``start``: its closing bracket, or the end of the clause."""
    if message[start] == " ":
        return message.find(")", after) + 1 or len(message)
    ends = (found.start() for found in _END.finditer(message, after))
    return next((end for end in ends if _depth(message[start:end]) <= 0), len(message))


def _depth(text: str) -> int:
    """Return the number of brackets that are open at the end of ``text``."""
    return text.count("(") - text.count(")")
