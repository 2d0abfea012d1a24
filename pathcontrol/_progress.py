"""A progress bar on standard error, shown once a task has taken two seconds."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec

_PATIENCE = 2.0


@contextlib.contextmanager
def progress_bar(description: str, total: float, enabled: bool = True) -> Iterator[Callable[[float], None]]:
    """Give a function that takes how much of ``total`` is done; the bar appears after two seconds."""
    began = time.monotonic()
    shown = None

    def update(done: float) -> None:
        nonlocal shown
        if shown is None and enabled and time.monotonic() - began > _PATIENCE:
            shown = _start()
            shown.add_task(description, total=total)
        if shown is not None:
            shown.update(shown.task_ids[0], completed=done)

    try:
        yield update
    finally:
        if shown is not None:
            shown.stop()


def _start():  # type: ignore[no-untyped-def]
    """Start a progress bar of rich."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    # in a notebook without ipywidgets rich warns, and cannot draw a bar
    missing = console.is_jupyter and find_spec("ipywidgets") is None
    bar = Progress(console=Console(force_jupyter=False, quiet=True) if missing else console, transient=True)
    bar.start()
    return bar
