"""Advice in messages, said in the words of whoever reads it: keyword arguments as options, or as keys of a file."""

from __future__ import annotations

import re
from collections.abc import Callable

#: what an argument and its value are called, or None where there is no such thing
Speak = Callable[[str, str], str | None]

_WORD = re.compile(
    r"""(?<![\w=])'[^']*' | `[^`]*` | <[^>]*>                      # what is quoted is not ours
    | (?<![-\w.&?\#/=$])(?<!\w\()(?P<name>[A-Za-z_]\w*)=(?!=)
      (?P<value>'[^']*'|\([^()]*\)|\[[^][]*\]|\{[^{}]*\}|[\w.…]+(?:\([^()]*\))?)?
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


def in_words_of(message: str, speak: Speak) -> str:
    """Return ``message`` with ``name=value`` as ``speak`` calls it.

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


def setting_in_words_of(message: str, speak: Speak) -> str:
    """Return ``message`` with the ``name = value`` or ``name:`` at its beginning as ``speak`` calls it."""
    if (named := re.match(r"([a-z]\w*)(?=: )", message)) and (said := speak(named[1], "")) is not None:
        return said + message[named.end() :]
    found = _SETTING.match(message)
    said = None if found is None else speak(found["name"], _unquoted(found["value"]))
    return message if found is None or said is None else said + message[found.end() :]


def _unquoted(value: str) -> str:
    """The text in quotation marks, or the value itself."""
    return value[1:-1] if value[0] in "'\"" else value


def _end_of_advice(message: str, start: int, after: int) -> int:
    """Where the advice from ``start`` on ends, ``after`` the word in it: at its bracket, or with the clause."""
    if message[start] == " ":
        return message.find(")", after) + 1 or len(message)
    ends = (found.start() for found in _END.finditer(message, after))
    return next((end for end in ends if _depth(message[start:end]) <= 0), len(message))


def _depth(text: str) -> int:
    """How many brackets are open at the end of ``text``."""
    return text.count("(") - text.count(")")
