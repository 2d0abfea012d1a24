"""Words of G-code, a letter and a number each, which form the block of a line."""

from __future__ import annotations

import re
from typing import NamedTuple

from pathcontrol.errors import ToolpathError

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
#: the exponent that Python and printf write, e and a sign: it is never tried as a word of its own, an E word
_EXPONENT = r"(?:e[-+][0-9]+|(?!e[-+][0-9]))"
#: the line that only marks a program's beginning or its end, and the one that only names it
PERCENT, PROGRAM_NAME = re.compile(r"%[ \t]*[0-9]*"), re.compile(r"[Oo:][ \t]*[0-9]+")

_WORD = re.compile(rf"([A-Za-z])[ \t]*({_NUMBER}{_EXPONENT})")
_BLOCK = re.compile(
    rf"[ \t]*(?:[A-Za-z][ \t]*{_NUMBER}{_EXPONENT}[ \t]*)*"
)  # unambiguous, so that matching takes linear time


def _optional(letters: str, value: str) -> str:
    """Return the pattern of a word that may be missing, whose value is a group."""
    return rf"(?:[{letters}][ \t]*({value})[ \t]*)?"


#: a line with at most the end of a straight move: the digit of G0 or G1, then X, Y, Z and F
PLAIN = re.compile(
    r"[ \t]*(?:[Nn][ \t]*[0-9]+[ \t]*)?(?:[Gg]0*([01])(?![0-9.])[ \t]*)?"
    + "".join(_optional(axis + axis.lower(), _NUMBER) for axis in "XYZ")
    + _optional("Ff", _NUMBER)
)

#: the meaning of the first character that fits into no word
_REASONS = {
    "#": "parameters are not supported: write the numbers",
    "=": "parameters are not supported: write the numbers",
    "[": "expressions are not supported: write the numbers",
    "]": "expressions are not supported: write the numbers",
    "(": "a comment begins with ( inside a comment, or does not end",
    ")": "a comment ends with ) that has not begun",
    "/": "whether a line with / is carried out depends on a switch of the machine: delete the line, or the /",
    "*": "checksums are not supported: delete them",
    "%": "a % must stand alone in its line",
}


class Block(NamedTuple):
    """The words of a line of a program.

    Attributes:
        g: numbers of its G words times ten: 901 for G90.1.
        m: numbers of its M words.
        words: its other words.
        label: its line number, as ``"N20"``, or an empty string.
    """

    g: list[int]
    m: list[int]
    words: dict[str, float]
    label: str


def without_comments(line: str) -> str:
    """Return the line without the text in parentheses or after a semicolon."""
    return _COMMENT.sub(" ", line) if "(" in line or ";" in line else line


def are_words(text: str) -> bool:
    """Return whether a text consists of words only."""
    return bool(_BLOCK.fullmatch(text))


def parse(text: str) -> Block:
    """Parse the words of a line without comments.

    Raises:
        ToolpathError: something in it is no word, or a letter that must not is there twice.
    """
    if not _BLOCK.fullmatch(text):
        raise _mistake(text)
    block = Block([], [], {}, "")
    for spelled, digits in _WORD.findall(text):
        letter = spelled.upper()
        if "e" in digits and (spelled.islower() or letter in "GMNO"):
            raise ToolpathError(_two_readings(spelled + digits), value=spelled + digits)
        if letter == "G":
            block.g.append(_code(letter, digits, 10))
        elif letter == "M":
            block.m.append(_code(letter, digits, 1))
        elif letter in block.words or (letter == "N" and (block.label or block.words or block.g or block.m)):
            raise ToolpathError(
                f"{letter}{digits[:20]} is not the first {'word' if letter == 'N' else letter} of the line",
                value=letter + digits,
            )
        elif letter == "N":
            block = block._replace(label=f"N{digits[:20]}")
        else:
            block.words[letter] = float(digits)
    return block


def _two_readings(word: str) -> str:
    """Return what is wrong with a number that has an exponent, or is followed by a word E."""
    return (
        f"{word[:30]} may be a number with an exponent, which G-code does not have, or two words, the second an "
        "extruder's: write the number out, or a blank before E"
    )


def _code(letter: str, digits: str, tenths: int) -> int:
    """Return the number of a G or M word, times ten where tenths are allowed."""
    number = float(digits) * tenths
    if not 0 <= number < 10_000 or abs(number - round(number)) > 1e-3:
        raise ToolpathError(f"{letter}{digits[:20]} is not understood", value=letter + digits)
    return round(number)


def _mistake(text: str) -> ToolpathError:
    """Return the error about a text where a word is expected."""
    good = _BLOCK.match(text)
    rest = text[good.end() if good else 0 :]
    culprit = rest[1:].lstrip()[:1] if rest[:1].isalpha() else rest[:1]
    if text.lstrip()[:1] in "Oo":
        reason = "subprograms and control flow are not supported: let the CAM program write every move"
    else:
        reason = _REASONS.get(culprit, "expected words, each a letter and a number such as X10.5")
    return ToolpathError(f"{rest[:20]!r} is not understood: {reason}", value=rest)
