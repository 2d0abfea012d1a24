"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import secrets
from collections.abc import Iterator
from pathlib import Path

from pathcontrol.errors import InputError


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
