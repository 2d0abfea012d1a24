"""What all commands share: errors as one message, Ctrl-C at any time, and options that mean the same everywhere."""

from __future__ import annotations

import contextlib
import errno
import signal
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from pathcontrol.errors import PathControlError, PathControlWarning


class Group(click.Group):
    """Turn the library's errors into one message and exit code 2, warnings into one line, Ctrl-C into exit code 130."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with warnings_in_one_line():
                return super().invoke(ctx)
        except PathControlError as error:
            click.echo(f"error: {printable(str(error))}", err=True)
            sys.exit(2)
        except OSError as error:  # a full disk, a folder that nobody may write to
            if error.errno == errno.EPIPE:  # whom we tell has gone; click ends quietly
                raise
            click.echo(f"error: {printable(str(error))}; no half-written file is left behind", err=True)
            sys.exit(2)
        except KeyboardInterrupt:
            click.echo("interrupted; no half-written file is left behind", err=True)
            sys.exit(130)


def printable(message: str) -> str:
    """``message`` without the control characters that a file may have put into it, which a terminal would obey."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in message)


@contextlib.contextmanager
def warnings_in_one_line() -> Iterator[None]:
    """Print each of the library's warnings once, as one line on stderr without the line of code that raised it."""
    before, told = warnings.showwarning, set()

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, PathControlWarning) and str(message) in told:
            return  # from another place
        if issubclass(category, PathControlWarning):
            told.add(str(message))
            click.echo(f"warning: {printable(str(message))}", err=True)
        else:
            before(message, category, *where, **more)

    with warnings.catch_warnings():
        warnings.simplefilter("default", PathControlWarning)
        warnings.showwarning = show
        yield


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Holds Ctrl-C back until the block is over: compiled modules do not survive it while they are imported."""
    pressed: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt


def import_all() -> None:
    """Everything that a command which simulates or draws will need."""
    with uninterrupted():
        import pathcontrol.experiments.reproduce
        import pathcontrol.experiments.runner
        import pathcontrol.view.figures.run
        import pathcontrol.view.film.recorder  # noqa: F401


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object on stdout, nothing else.")
open_option = click.option("--open", "opened", is_flag=True, help="Show the page in the default browser at the end.")

package_option = click.option(
    "--package-dir",
    multiple=True,
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="A folder that holds the packages of meshes, or is one; repeat for more.",
)


def open_page(path: Path) -> None:
    """Show a page in the default browser; where there is none, say which file to open."""
    import webbrowser

    if not webbrowser.open(path.resolve().as_uri()):
        click.echo(f"no browser could be started; open {path} in one", err=True)
