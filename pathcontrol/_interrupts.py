"""Ctrl-C that has to wait."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def delay_interrupt() -> Iterator[None]:
    """Have Ctrl-C wait until the end of the block, as what it does must be done as a whole."""
    main = threading.current_thread() is threading.main_thread()  # Ctrl-C interrupts no other thread
    if not main or signal.getsignal(signal.SIGINT) in (signal.SIG_IGN, None):
        yield
        return
    pressed: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt
