"""Jobs packed for machines that have neither the user's modules nor the user's files."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import sys
import sysconfig
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import cloudpickle

from pathcontrol.errors import InputError, PathControlError
from pathcontrol.simulation.context import RunContext
from pathcontrol.simulation.run import Run
from pathcontrol.sweeps.chunk import Chunk, Job, Piece
from pathcontrol.sweeps.cluster.user_code import PackedBuilder

_OURS = __name__.partition(".")[0]
_STDLIB = sysconfig.get_path("stdlib")
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # glibc's names for what mallopt sets
_KEPT, _LARGE = 256 << 20, 32 << 20  # bytes


class _UnpackedJob(NamedTuple):
    """An unpacked job, with the folder of its files."""

    job: Job
    here: str  # the folder of the files on this machine
    home: str  # the folder of the files on the machine of the user


class ShippedJob:
    """A :class:`Job` as bytes, unpacked once on each worker; the folder of its files is removed with it.

    Args:
        content: the bytes.
        versions: the versions that a machine must have installed to unpack it.
    """

    def __init__(self, content: bytes, versions: Mapping[str, str]) -> None:
        self._content, self.versions = content, versions
        self._opened: _UnpackedJob | None = None

    @classmethod
    def of(cls, job: Job, versions: Mapping[str, str]) -> ShippedJob:
        """Pack a job with its files and with those modules that are no installed packages.

        Raises:
            InputError: it cannot be pickled.
        """
        build = job.build.pack() if hasattr(job.build, "pack") else job.build
        try:
            with _pickle_own_modules():
                return cls(cloudpickle.dumps((build, *job[1:])), versions)
        except Exception as error:  # whatever a user's object raises
            raise InputError(
                f"build cannot be sent to workers ({error}); make what it needs inside it, as open files and locks "
                "belong to this machine",
                argument="build",
                value=build,
            ) from error

    def __reduce__(self) -> tuple[type[ShippedJob], tuple[bytes, Mapping[str, str]]]:
        return ShippedJob, (self._content, self.versions)

    def compute(self, piece: Piece, scratch: str) -> Chunk:
        """Return the chunk of a piece, as if computed on the machine that packed the job.

        Args:
            piece: parameters and samples.
            scratch: a folder in which there may be one for the files.
        """
        if self._opened is None:
            keep_freed_memory()
            self._opened = self._open(scratch)
        job, here, home = self._opened
        try:
            chunk = job(*piece)
        except PathControlError as error:
            error.args = tuple(text.replace(here, home) for text in error.args)
            raise
        return chunk._replace(runs={sample: _relocate(run, here, home) for sample, run in chunk.runs.items()})

    def _open(self, scratch: str) -> _UnpackedJob:
        """Unpack the job, with its files in a new folder."""
        build, *rest = cloudpickle.loads(self._content)
        if not isinstance(build, PackedBuilder):
            return _UnpackedJob(Job(build, *rest), "", "")
        folder = Path(tempfile.mkdtemp(prefix="pathcontrol-", dir=scratch)).resolve()
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        for place, content in build.files.items():
            (folder / place).parent.mkdir(parents=True, exist_ok=True)
            (folder / place).write_bytes(content)
        return _UnpackedJob(Job(build.unpack(folder), *rest), str(folder), str(build.home).rstrip("/"))


def _relocate(run: Run, here: str, home: str) -> Run:
    """Return the same run with the mesh files of its robot at ``home``."""
    _, (data, config, stored) = run.__reduce__()
    here, home = (json.dumps(folder)[1:-1] for folder in (here, home))
    return Run(data, config, RunContext.load(stored._replace(text=stored.text.replace(here, home))))


@contextmanager
def _pickle_own_modules() -> Iterator[None]:
    """Have the content of the user's own modules pickled, not just their names."""
    before = cloudpickle.list_registry_pickle_by_value()
    own = [module for module in list(sys.modules.values()) if _is_own(module) and module.__name__ not in before]
    for module in own:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in own:
            cloudpickle.unregister_pickle_by_value(module)


def _is_own(module: ModuleType) -> bool:
    """Return whether a module is a Python file outside of this package, the standard library and installed packages."""
    if type(module) is not ModuleType or sys.modules.get(module.__name__) is not module:  # as lazy ones, and __main__
        return False
    file = str(vars(module).get("__file__") or "")  # of thousands of modules: paths of them take 40 ms
    if not file.endswith(".py") or module.__name__.partition(".")[0] in (_OURS, "__main__"):
        return False
    installed = {"site-packages", "dist-packages"}.intersection(file.split(os.sep))
    return not (installed or file.startswith(f"{_STDLIB}{os.sep}"))


def keep_freed_memory() -> None:
    """Keep up to 256 MiB of freed memory for the next arrays; arrays above 32 MiB are returned at once.

    Dask starts its workers with a ``malloc`` that gives everything back, and fetches the memory of every array anew,
    page by page. Without glibc nothing is changed.
    """
    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_TRIM_THRESHOLD, _KEPT)
        mallopt(_MMAP_THRESHOLD, _LARGE)
