"""The shared parts of all commands: errors as one message, Ctrl-C at any time, and common options."""

from __future__ import annotations

import ast
import contextlib
import errno
import re
import shlex
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import click

from pathcontrol._advice import reword_advice, reword_setting
from pathcontrol._interrupts import delay_interrupt
from pathcontrol._suffixes import FIGURE, PAGE, TABLE, VIDEO
from pathcontrol.cli.quantity import QuantityType
from pathcontrol.errors import PathControlError, PathControlWarning

_SOON = 1e-3  # s
#: the commands that write what a call in Python writes
_WRITERS = {
    PAGE: "`pathcontrol view RUN --out FILE.html` writes an animation, `pathcontrol report` in its place a report",
    FIGURE: "`pathcontrol report RUN` writes a page with figures, `pathcontrol run` those of an experiment file",
    TABLE: "`pathcontrol report RUN` writes a page with the signals as CSV",
    VIDEO: "`pathcontrol view RUN --mp4 FILE.mp4` writes a video",
}


class Group(click.Group):
    """Turn errors into one message and exit code 2, warnings into one line, Ctrl-C into exit code 130."""

    def main(self, *args: Any, **options: Any) -> Any:
        try:
            return super().main(*args, **options)
        except OSError as error:  # standard output on a full disk, a folder that nobody may read
            if error.errno == errno.EPIPE:  # whom we tell has gone; click ends quietly
                raise
            click.echo(f"error: {printable(str(error))}; no half-written file is left behind", err=True)
            sys.exit(2)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with warnings_in_one_line(lambda: _find_command(ctx)), interrupts_kept():
                return super().invoke(ctx)
        except PathControlError as error:
            click.echo(f"error: {printable(in_options(str(error), _find_command(ctx)))}", err=True)
            sys.exit(2)
        except KeyboardInterrupt:
            click.echo("interrupted; no half-written file is left behind", err=True)
            sys.exit(130)


def _find_command(ctx: click.Context) -> click.Command | None:
    """Return the command that is run."""
    group = ctx.command
    return group.get_command(ctx, ctx.invoked_subcommand or "") if isinstance(group, click.Group) else None


def in_options(message: str, command: click.Command | None) -> str:
    """Translate a message of the library into the options of a ``command``; drop advice without an option."""
    for call, writer in _WRITERS.items():
        message = message.replace(f"; {call}", f"; {writer}")
    if command is None:
        return message
    options = {param.name: param for param in command.params if isinstance(param, click.Option)}

    def speak(name: str, value: str) -> str | None:
        option = options.get(name)
        if option is None:
            return None
        return option.opts[0] if option.is_flag or not value or value == "…" else _format_option(option, value)

    return reword_setting(reword_advice(message, speak), speak)


def _format_option(option: click.Option, value: str) -> str:
    """Return an option with a value as one types it: ``(x, y, z)`` as three, a call of Python as a file name."""
    flag, items = option.opts[0], _split_items(value)
    if re.fullmatch(r"\w+\(.*\)", value):
        return f"{flag} FILE"
    if isinstance(option.type, QuantityType) and option.nargs == 1:
        return f"{flag} {option.type.write(value)}"
    if option.multiple:
        return " ".join(f"{flag} {item}" for item in items)
    return f"{flag} {(' ' if option.nargs > 1 else ',').join(items)}"


def _split_items(value: str) -> list[str]:
    """Return the words of a value written as in Python, without the quotes around a single text."""
    try:
        literal = ast.literal_eval(value) if value[:1] in ("(", "[") else value
    except (ValueError, SyntaxError):  # not Python: (x, y, z)
        return [word.strip() for word in value.strip("()[]").split(",")]
    return [shlex.quote(str(item)) for item in literal] if isinstance(literal, list | tuple) else [value]


def printable(message: str) -> str:
    """Return ``message`` without control characters from a file, which a terminal would obey."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in message)


@contextlib.contextmanager
def warnings_in_one_line(command: Callable[[], click.Command | None] = lambda: None) -> Iterator[None]:
    """Print each of the library's warnings once, as one line on stderr without the line of code that raised it."""
    before, shown = warnings.showwarning, set()

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, PathControlWarning) and str(message) in shown:
            return  # of another origin
        if issubclass(category, PathControlWarning):
            shown.add(str(message))
            click.echo(f"warning: {printable(in_options(str(message), command()))}", err=True)
        else:
            before(message, category, *where, **more)

    with warnings.catch_warnings():
        warnings.simplefilter("default", PathControlWarning)
        warnings.showwarning = show
        yield


@contextlib.contextmanager
def interrupts_kept() -> Iterator[None]:
    """Repeat a Ctrl-C that comes while an object is cleared away, where Python loses and prints the exception."""

    def again(number: int, frame: FrameType | None) -> None:
        if frame is not None and frame.f_code is keep.__code__:
            signal.setitimer(signal.ITIMER_REAL, _SOON)
        else:
            raise KeyboardInterrupt

    def keep(lost: sys.UnraisableHookArgs) -> None:
        if lost.exc_type is KeyboardInterrupt:
            signal.setitimer(signal.ITIMER_REAL, _SOON)
        else:
            before(lost)

    before, handler = sys.unraisablehook, signal.signal(signal.SIGALRM, again)
    sys.unraisablehook = keep
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = before
        signal.signal(signal.SIGALRM, handler)


def import_all() -> None:
    """Import everything that a command which simulates or draws will need."""
    with delay_interrupt():
        import pathcontrol.experiments.reproduce
        import pathcontrol.experiments.runner
        import pathcontrol.view.animation.record  # noqa: F401


engine_option = click.option(
    "--engine",
    type=click.Choice(["auto", "compiled", "pinocchio"]),
    help="Which engine runs the simulations; default what the file says, else auto.",
)
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
    """Show a page in the default browser; without one, print the file to open."""
    import webbrowser

    if not webbrowser.open(path.resolve().as_uri()):
        click.echo(f"no browser could be started; open {path} in one", err=True)
