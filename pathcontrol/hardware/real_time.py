"""A thread that is disturbed as little as the operating system and Python allow."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

_PRIORITY = 80  # of 99, as real-time programs have it that leave the highest to the kernel's own threads


@contextmanager
def real_time() -> Iterator[bool]:
    """Let the calling thread go before all others, without pauses by the garbage collector, until the block ends.

    Yields:
        whether the operating system allowed it: Linux asks for ``CAP_SYS_NICE``, or a limit ``rtprio`` of 80.
    """
    collecting, before = gc.isenabled(), (os.sched_getscheduler(0), os.sched_getparam(0))
    gc.collect()
    gc.disable()
    try:
        yield _set_scheduler(os.SCHED_FIFO, os.sched_param(_PRIORITY))
    finally:
        _set_scheduler(*before)
        if collecting:
            gc.enable()


def _set_scheduler(policy: int, parameters: os.sched_param) -> bool:
    """Set how the calling thread is scheduled, and return whether that is allowed."""
    try:
        os.sched_setscheduler(0, policy, parameters)
    except PermissionError:
        return False
    return True
