"""Files that appear whole or not at all, and files that are read within bounds."""

from __future__ import annotations

import contextlib
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path

from pathcontrol.errors import InputError, PathControlError


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path``, moved there if the block ends without an exception, else removed.

    The suffix is kept, since some writers choose the format by it.
    """
    target = Path(path).resolve()  # through a link, to the file that is meant
    if target.is_dir():
        raise InputError(f"{str(path)!r} is a folder, expected the name of a file to write")
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.stem}-{secrets.token_hex(4)}{target.suffix}")
    try:
        temporary.touch(exist_ok=False)
        yield temporary
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def read_bounded(path: Path, most: int, what: str, error: type[PathControlError]) -> bytes:
    """Return the bytes of a regular file; a pipe or a device, which could be read for ever, is never opened.

    Args:
        path: the file.
        most: how many bytes it may have.
        what: what is expected in it, for the errors: ``"a URDF"``.
        error: the class of the errors raised.

    Raises:
        error: it is no regular file, has more bytes than ``most``, or cannot be read.
    """
    try:
        regular, data = stat.S_ISREG(path.stat().st_mode), b""
        if regular:
            with path.open("rb") as stream:
                data = stream.read(most + 1)
    except (OSError, ValueError) as reason:  # ValueError: a path with a NUL in it
        said = (reason.strerror if isinstance(reason, OSError) else None) or str(reason)
        raise error(f"{str(path)!r} cannot be read, expected {what}: {said}") from reason
    if not regular:
        raise error(f"{str(path)!r} is no regular file, expected {what}")
    if len(data) > most:
        raise error(f"{str(path)!r} is larger than the {most / 2**20:.4g} MiB that are read at most, expected {what}")
    return data
