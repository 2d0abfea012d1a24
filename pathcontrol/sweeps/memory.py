"""Make glibc keep freed array memory for reuse (mallopt); Dask starts workers with the opposite setting."""

from __future__ import annotations

import ctypes
from contextlib import suppress

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # glibc's names for what mallopt sets
_KEPT, _LARGE = 256 << 20, 32 << 20  # bytes


def keep_freed_memory() -> None:
    """Keep up to 256 MiB of freed memory for the next arrays; arrays above 32 MiB are returned at once.

    Dask starts its workers with a ``malloc`` that gives everything back, and fetches the memory of every array anew,
    page by page. Without glibc nothing is changed.
    """
    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_TRIM_THRESHOLD, _KEPT)
        mallopt(_MMAP_THRESHOLD, _LARGE)
