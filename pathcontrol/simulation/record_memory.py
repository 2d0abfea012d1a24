"""The memory of records, which is used again once nobody holds the run.

New pages take a tenth of the time of a compiled batch, and several times that where a virtual machine's host has to
find them first.
"""

from __future__ import annotations

import mmap
import sys
import weakref
from contextlib import suppress

import numpy as np

from pathcontrol._arrays import Array

_LARGE = 1 << 22  # bytes: the C library uses smaller blocks again by itself
_MOST = 1 << 28  # bytes that are kept while no run uses them
_kept: list[mmap.mmap] = []  # oldest first; each change is one operation, as runs may end in any thread


def new_block(samples: int, sample: np.dtype) -> Array:
    """Return an array of ``samples`` with any content; its memory is used again when no view of it is left."""
    size = samples * sample.itemsize
    if sys.platform != "linux" or size < _LARGE:
        return np.empty(samples, dtype=sample)
    memory = _take(size)
    block = np.frombuffer(memory, dtype=sample, count=samples)
    weakref.finalize(block, _keep, memory).atexit = False  # all views of the block refer to it
    return block


def _take(size: int) -> mmap.mmap:
    """Return kept memory of ``size`` bytes, or a little more, or new one."""
    for memory in list(_kept):
        if size <= len(memory) <= 2 * size:
            with suppress(ValueError):  # another thread has taken it
                _kept.remove(memory)
                return memory
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)  # which a fork does not share
    _advise(memory, mmap.MADV_HUGEPAGE)
    return memory


def _keep(memory: mmap.mmap) -> None:
    """Keep memory for the next run; until then the system may take its pages."""
    _advise(memory, mmap.MADV_FREE)
    _kept.append(memory)
    while sum(map(len, list(_kept))) > _MOST:
        with suppress(IndexError):
            _kept.pop(0)


def _advise(memory: mmap.mmap, advice: int) -> None:
    """Give the system advice on memory, which a kernel without that feature refuses."""
    with suppress(OSError):
        memory.madvise(advice)
