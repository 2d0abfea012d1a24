"""Files that appear whole or not at all, bounded reading of files, and locks on folders."""

from __future__ import annotations

import atexit
import contextlib
import errno
import fcntl
import glob
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pathcontrol.errors import InputError, PathControlError, StorageError

_HEX = "[0-9a-f]" * 8
#: what keeps a disk from taking a file: no room, too large for it or for the user, or not writable at all
_NOT_TAKEN = frozenset(
    getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO", "EROFS", "EACCES", "EPERM", "ENAMETOOLONG")
)
_parts: set[Path] = set()  # temporary files that this process has, or is about to have


def as_path(name: str, value: Any) -> Path:
    """Convert the name of a file or a folder to a path; errors name it.

    Raises:
        InputError: it is neither a text nor a path.
    """
    try:
        return Path(value)
    except TypeError as error:
        raise InputError(f"{name} = {value!r:.80}, expected a path, as a text", argument=name, value=value) from error


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``; it is moved there if the block ends without an exception, else removed.

    The content is on the disk before the name is, so that a loss of power leaves the old file or the new one. The
    suffix is kept, since some writers choose the format by it. What a killed process left of the same file is removed.

    Raises:
        InputError: ``path`` is a folder, or below a file.
        StorageError: the disk is full, or does not take the file; what was there before stays.
    """
    target = as_path("path", path).resolve()  # through a link, to the file that is meant
    with writing(target):
        if target.is_dir():
            raise InputError(
                f"{str(path)!r} is a folder, expected the name of a file to write",
                argument="path",
                value=str(path),
                file=str(path),
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_left_parts(target)
        with _part_of(target) as temporary:
            yield temporary
            _flush(temporary)
            temporary.replace(target)
            with contextlib.suppress(OSError):  # not every file system can
                _flush(target.parent)


@contextlib.contextmanager
def writing(target: Path) -> Iterator[None]:
    """Name the file or folder in errors of the operating system that arise while the block writes.

    Raises:
        InputError: ``target`` is below a file.
        StorageError: the disk is full, or does not take it.
    """
    try:
        yield
    except (FileExistsError, NotADirectoryError) as error:
        where = f"{str(target)!r} cannot be written"
        raise InputError(
            f"{where}: {error.filename!r} is a file, expected a folder", value=error.filename, file=str(target)
        ) from error
    except OSError as error:
        if error.errno not in _NOT_TAKEN or isinstance(error, PathControlError):
            raise
        raise StorageError(
            f"{str(target)!r} cannot be written: {error.strerror}; no half-written file is left behind", error.errno
        ) from error


def append_line(path: Path, line: str) -> None:
    """Add a line to a file, all of it or nothing, and have it written to the disk.

    Raises:
        StorageError: the disk is full, or does not take it.
    """
    with writing(path):
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        try:
            _append(descriptor, f"{line}\n".encode())
        finally:
            os.close(descriptor)


def _append(descriptor: int, content: bytes) -> None:
    """Write bytes to the end of a file; where the disk takes some of them only, take those back."""
    before = os.fstat(descriptor).st_size
    try:
        while content:
            content = content[os.write(descriptor, content) :]
        os.fsync(descriptor)
    except OSError:
        os.ftruncate(descriptor, before)
        raise


def write_whole(path: str | Path, content: bytes | memoryview) -> Path:
    """Write a file, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)
    return Path(path)


@contextlib.contextmanager
def hold_lock(path: Path) -> Iterator[bool]:
    """Hold the operating system's lock on a file or folder; give False where another process holds it.

    The lock goes when the process does, however it ends, and leaves no file behind. On a file system without locks
    nobody is kept out.
    """
    descriptor = os.open(path, os.O_RDONLY)
    try:
        yield _lock(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def scratch_folder(prefix: str) -> Iterator[Path]:
    """Give a temporary folder that is removed at the end; first remove those that killed processes left."""
    for left in Path(tempfile.gettempdir()).glob(f"{glob.escape(prefix)}*"):
        with contextlib.suppress(OSError), hold_lock(left) as ours:
            if ours and left.stat().st_uid == os.getuid():
                shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=prefix) as folder, hold_lock(Path(folder)):
        yield Path(folder)


def _lock(descriptor: int) -> bool:
    """Try to lock an open file; return False if another process holds the lock."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # the file system has no locks
        return True
    return True


@contextlib.contextmanager
def _part_of(target: Path) -> Iterator[Path]:
    """Make a temporary file beside ``target``, locked to show that its writer lives, and remove it at the end."""
    temporary = target.with_name(f".{target.stem}-{secrets.token_hex(4)}{target.suffix}")
    descriptor = None
    try:
        _parts.add(temporary)
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        _lock(descriptor)
        yield temporary
    finally:
        if descriptor is not None:
            os.close(descriptor)
        temporary.unlink(missing_ok=True)
        _parts.discard(temporary)


def remove_own_parts() -> None:
    """Remove the temporary files that Ctrl-C has kept this process from removing at once."""
    for temporary in list(_parts):
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        _parts.discard(temporary)


atexit.register(remove_own_parts)


def _remove_left_parts(target: Path) -> None:
    """Remove the temporary files of ``target`` whose writer does not live any more."""
    for left in target.parent.glob(f".{glob.escape(target.stem)}-{_HEX}{glob.escape(target.suffix)}"):
        with contextlib.suppress(OSError), hold_lock(left) as ours:  # somebody else may be removing it too
            if ours:
                left.unlink()


def _flush(path: Path) -> None:
    """Have the operating system write a file or folder to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


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
