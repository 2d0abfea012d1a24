"""Decoding of the bytes of a URDF file to text."""

from __future__ import annotations

import codecs
import re

from pathcontrol.errors import UrdfError, warn

_DECLARED = re.compile(rb"""\s*<\?xml[^>]{0,200}?encoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def decode(data: bytes, name: str) -> str:
    """Decode the file ``name``: UTF-8 or UTF-16, else the encoding it declares, else ISO-8859-1.

    What is not Unicode is taken with a warning that names the first line that is not.

    Raises:
        UrdfError: it is no text.
    """
    for mark, encoding in _MARKS.items():
        if data.startswith(mark):
            return _decode_strictly(data, encoding, name)
    if b"\0" in data:
        raise UrdfError(f"{name!r} holds NUL bytes and is no text; expected a URDF, saved as UTF-8", value=name)
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        text, encoding = _decode_as_declared(data)
        warn(
            f"{name}: line {data[: error.start].count(10) + 1}: this is not UTF-8 and is read as {encoding}; "
            "save the file as UTF-8"
        )
        return text


def _decode_strictly(data: bytes, encoding: str, name: str) -> str:
    """Decode a text whose byte order mark says its encoding."""
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise UrdfError(f"{name!r} is not a text file in {encoding.upper()[:6]}: {error}", value=name) from error


def _decode_as_declared(data: bytes) -> tuple[str, str]:
    """Decode a text that is not UTF-8; return the text and the encoding."""
    found = _DECLARED.match(data)
    declared = "ISO-8859-1" if found is None else found[1].decode()
    try:
        return data.decode(declared), declared
    except (LookupError, UnicodeError):
        return data.decode("iso-8859-1"), "ISO-8859-1"
