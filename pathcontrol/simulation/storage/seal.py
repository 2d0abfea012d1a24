"""The checksums of a saved run: one of all its bytes at its end, and others of its arrays and texts inside.

HDF5 ignores what follows its own end, so that the first one is checked before any other code looks at bytes that may be
damaged. A program that changes the file cuts it off; then the inner ones tell whether the numbers are still the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError

_MARK = b"\npathcontrol sha256 "
_LENGTH = len(_MARK) + 64 + 1
_PIECE = 1 << 20


def seal(content: bytes | memoryview) -> bytes:
    """Return the checksum that is to follow ``content`` in a file."""
    return _MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"


def check_seal(path: Path) -> None:
    """Check the content of a file that ends with a checksum.

    Raises:
        InputError: it is not.
    """
    size = path.stat().st_size - _LENGTH
    if size < 0:
        return
    with path.open("rb") as file:
        file.seek(size)
        end = file.read()
        if not end.startswith(_MARK):
            return
        file.seek(0)
        found, left = hashlib.sha256(), size
        while piece := file.read(min(_PIECE, left)):
            found.update(piece)
            left -= len(piece)
    if end[len(_MARK) : -1] != found.hexdigest().encode():
        raise InputError("it is damaged: its bytes are not those that were written; take another copy of it")


def digest_of(arrays: Mapping[str, Array], text: str) -> str:
    """Return the SHA-256 of named arrays of numbers or texts, (...) each, and a text, independent of their storage."""
    found = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        if array.dtype.kind not in "biuf":
            found.update(json.dumps([name, array.tolist()]).encode())
            continue
        if array.dtype.kind == "f":
            array = np.where(np.isnan(array), np.nan, array)  # NaN has many bit patterns
        found.update(json.dumps([name, array.dtype.str, list(array.shape)]).encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()
