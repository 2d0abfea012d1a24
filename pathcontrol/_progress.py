"""A progress bar on standard error, shown once a task has taken two seconds, or at once where its steps are slow."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec

_PATIENCE = 2.0  # s
_BETWEEN = 0.1  # s, between two drawings


@contextlib.contextmanager
def progress_bar(
    description: str, total: float, enabled: bool = True, *, at_once: bool = False
) -> Iterator[Callable[[float], None]]:
    """Give a function that takes how much of ``total`` is done; the bar appears after two seconds, or ``at_once``.

    What ends before ``total`` is done as a whole, too: unless an exception ends it the bar ends at 100 %.
    """
    due = time.monotonic() + (0.0 if at_once else _PATIENCE)
    shown = None

    def update(done: float) -> None:
        nonlocal shown, due
        if not enabled or time.monotonic() < due:
            return
        if shown is None:
            shown = _start()
            shown.add_task(description, total=total)
        shown.update(shown.task_ids[0], completed=done, refresh=True)
        due = time.monotonic() + _BETWEEN

    try:
        yield update
        if shown is not None:
            shown.update(shown.task_ids[0], completed=total, refresh=True)
    finally:
        if shown is not None:
            shown.stop()


def _start():  # type: ignore[no-untyped-def]
    """Start a progress bar of rich, without its thread, which a process forked meanwhile would lose."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    # in a notebook without ipywidgets rich warns, and cannot draw a bar
    missing = console.is_jupyter and find_spec("ipywidgets") is None
    # into a file it draws nothing, and ends that with an empty line
    if missing or not (console.is_terminal or console.is_jupyter):
        console = Console(force_jupyter=False, quiet=True)
    bar = Progress(console=console, transient=True, auto_refresh=False)
    bar.start()
    return bar
