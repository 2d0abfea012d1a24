"""How long a test waits for another process or a page: what hangs is ended, what a busy machine delays is not."""

from __future__ import annotations

import time
from collections.abc import Callable

PATIENCE = 600
"""Seconds after which something that a test waits for is taken to hang."""


def wait_until(condition: Callable[[], object], pause: float = 0.01) -> None:
    """Wait until a condition holds, which is asked every ``pause`` seconds.

    Raises:
        AssertionError: it does not hold after :data:`PATIENCE`.
    """
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"waited {PATIENCE} s for what never came to be"
        time.sleep(pause)
