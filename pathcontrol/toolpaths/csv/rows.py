"""The rows of a table of points, and the values in each."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field

from pathcontrol.errors import ToolpathError

#: names of the separators in messages; None stands for blanks
SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", None: "blanks"}
_UNIT_OF_LINES = re.compile(r"[Ss][Ee][Pp]=([;,\t])")
_MOST_COMMENTS, _LONGEST_COMMENT = 100, 500
_QUOTED_OR_WORD = re.compile(r'"[^"]*"|[^\s"]+')
_INSIDE = "\x1f"  # the ASCII unit separator, between the values of lines that had quotes


@dataclass
class Rows:
    """The lines of a table that are neither empty nor comments.

    Attributes:
        texts: the lines without comments.
        lines: their numbers.
        after_gap: which of them follow an empty line.
        comments: the comments before the first of them, each with its line.
        separator: the character between the values, None for blanks.
        between: how messages call it.
    """

    texts: list[str] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    after_gap: list[int] = field(default_factory=list)
    comments: list[tuple[int, str]] = field(default_factory=list)
    separator: str | None = None
    between: str = SEPARATORS[None]

    @classmethod
    def of(cls, lines: list[str], decimal: str | None = None) -> Rows:
        """Read the rows among the lines of a file, whose numbers have a decimal point, or a comma."""
        rows, gap, said = cls(), False, None
        for line, content in enumerate(lines, 1):
            if line == 1 and (found := _UNIT_OF_LINES.fullmatch(content.strip(" "))):
                said = found[1]  # Excel's way to say it
                continue
            text = _without_comment(content)
            if text.strip(",;\t "):
                if gap:
                    rows.after_gap.append(len(rows.texts))
                rows.texts.append(text)
                rows.lines.append(line)
            elif content.lstrip().startswith("#") and not rows.texts and len(rows.comments) < _MOST_COMMENTS:
                rows.comments.append((line, content.lstrip(" \t#")[:_LONGEST_COMMENT]))
            gap = not text.strip(",;\t ") and (gap or not content.strip(",;\t "))  # a comment is no gap, and ends none
        if not rows.texts:
            raise ToolpathError("there is no point in it, expected lines of x y z, or columns with names")
        rows._separate(said or separator_of(rows.texts[0], decimal))
        return rows

    def fields(self, text: str) -> list[str]:
        """Split a line into values."""
        return split(text, self.separator)

    def take_first(self) -> None:
        """Remove the first row, which is no point."""
        del self.texts[0], self.lines[0]
        self.after_gap = [row - 1 for row in self.after_gap if row]
        if not self.texts:
            raise ToolpathError("there is no point in it, only the names of columns")

    def trim(self, width: int) -> None:
        """Remove separators at the ends of lines that have more values than columns."""
        if self.separator is None:
            return
        for row, text in enumerate(self.texts):
            if text.endswith(self.separator):
                self.texts[row] = _trim(text, self.separator, width)

    def _separate(self, separator: str | None) -> None:
        """Split lines at a separator; quotes are replaced by another separator that is in no value."""
        self.separator, self.between = separator, SEPARATORS[separator]
        if any('"' in text for text in self.texts):
            self.texts = [_unquote(line, text, separator) for line, text in zip(self.lines, self.texts, strict=True)]
            self.separator = _INSIDE


def split(text: str, separator: str | None) -> list[str]:
    """Split a line into values."""
    return [value.strip() for value in text.split(separator)]


def separator_of(text: str, decimal: str | None = None) -> str | None:
    """Return the character between the values of a line; a comma only where it is not in the numbers."""
    candidates = ";\t" if decimal == "," and '"' not in text else ";\t,"
    return next((s for s in candidates if s in text), None)


def _without_comment(content: str) -> str:
    """Return the line without the comment after a # outside quotes, and without blanks around it."""
    if "#" not in content:
        return content.strip(" ")
    if '"' in content:
        pieces = re.split(r'("[^"]*")', content)
        place = next((k for k, piece in enumerate(pieces) if k % 2 == 0 and "#" in piece), None)
        if place is not None:
            pieces = [*pieces[:place], pieces[place].partition("#")[0]]
        return "".join(pieces).strip(" ")
    return content.partition("#")[0].strip(" ")


def _unquote(line: int, text: str, separator: str | None) -> str:
    """Return the values of a line with quotes, between unit separators."""
    if separator is None:
        values = [value.strip('"') for value in _QUOTED_OR_WORD.findall(text)]
    else:
        try:
            values = next(csv.reader([text], delimiter=separator, skipinitialspace=True))
        except csv.Error as error:
            raise ToolpathError(f"line {line}: {error}", line=int(line)) from None
    return _INSIDE.join(value.strip().replace(_INSIDE, " ") for value in values)


def _trim(text: str, separator: str, width: int) -> str:
    """Return the line without the empty values at its end beyond ``width``."""
    core, there = text.rstrip(separator + " "), text.count(separator)
    at_end, too_many = there - core.count(separator), there - (width - 1)
    return core + separator * (at_end - min(at_end, max(too_many, 0)))
