"""A film in the form that a page reads: a header that describes it, and binary numbers behind it."""

from __future__ import annotations

import base64
import gzip
import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_TYPES = {"f4": np.float32, "u4": np.uint32, "u1": np.uint8}
_ALIGNMENT = 8  # bytes, so that typed arrays of JavaScript can lie on it


@dataclass(eq=False)
class Film:
    """Header and blocks of binary numbers, to be packed into one text.

    Packed and unzipped it is: the length of the header in bytes (4 bytes, little-endian), the header as JSON, spaces up
    to a multiple of 8 bytes, then the blocks. A block is referred to by ``{"at", "count", "type"}``: its first
    byte counted from the first block's, the number of its elements, and ``f4``, ``u4`` or ``u1``.

    Attributes:
        header: anything that JSON can hold, and references to blocks.
    """

    header: dict[str, Any] = field(default_factory=dict, repr=False)
    _blocks: list[bytes] = field(default_factory=list, repr=False)
    _size: int = 0

    def block(self, values: Any, kind: str = "f4") -> dict[str, Any]:
        """Keep numbers, flattened in C order, or bytes with ``u1``; return the reference to them."""
        raw = values if isinstance(values, bytes) else np.asarray(values, dtype=_TYPES[kind]).tobytes()
        reference = {"at": self._size, "count": len(raw) // np.dtype(_TYPES[kind]).itemsize, "type": kind}
        raw += b"\0" * (-len(raw) % _ALIGNMENT)
        self._blocks.append(raw)
        self._size += len(raw)
        return reference

    def pack(self) -> bytes:
        """Return all of it, compressed; the same film gives the same bytes."""
        header = json.dumps(self.header, allow_nan=False).encode()
        header += b" " * (-(4 + len(header)) % _ALIGNMENT)
        whole = b"".join([len(header).to_bytes(4, "little"), header, *self._blocks])
        return gzip.compress(whole, compresslevel=6, mtime=0)

    def text(self) -> str:
        """Return all of it in base64, which can contain no markup."""
        return base64.b64encode(self.pack()).decode()
