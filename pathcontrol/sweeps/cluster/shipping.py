"""What computes chunks, packed for a machine that has neither the user's modules nor the user's files."""

from __future__ import annotations

import json
import shutil
import sys
import sysconfig
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import cloudpickle

from pathcontrol.errors import InputError, PathControlError
from pathcontrol.simulation.context import RunContext
from pathcontrol.simulation.run import Run
from pathcontrol.sweeps.chunk import Chunk, Job, Piece
from pathcontrol.sweeps.cluster.user_code import Luggage
from pathcontrol.sweeps.memory import keep_freed_memory

_OURS = __name__.partition(".")[0]


class _Opened(NamedTuple):
    job: Job
    here: str  # the folder of the files
    home: str  # where it is on the machine of the user


class Parcel:
    """A :class:`Job` as bytes, opened once on each worker. The folder of its files goes when the parcel does.

    Args:
        content: the bytes.
        versions: what a machine has to have installed that opens it.
    """

    def __init__(self, content: bytes, versions: Mapping[str, str]) -> None:
        self._content, self.versions = content, versions
        self._opened: _Opened | None = None

    @classmethod
    def of(cls, job: Job, versions: Mapping[str, str]) -> Parcel:
        """The parcel of a job, with its files and with those modules that are no installed packages.

        Raises:
            InputError: it cannot be pickled.
        """
        build = job.build.luggage() if hasattr(job.build, "luggage") else job.build
        try:
            with _own_modules_by_value():
                return cls(cloudpickle.dumps((build, *job[1:])), versions)
        except Exception as error:  # whatever a user's object raises
            raise InputError(
                f"build cannot be sent to workers ({error}); make what it needs inside it, as open files and locks "
                "belong to this machine"
            ) from error

    def __reduce__(self) -> tuple[type[Parcel], tuple[bytes, Mapping[str, str]]]:
        return Parcel, (self._content, self.versions)

    def compute(self, piece: Piece, scratch: str) -> Chunk:
        """The chunk of a piece, as if computed where the parcel comes from.

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
        return chunk._replace(runs={sample: _moved(run, here, home) for sample, run in chunk.runs.items()})

    def _open(self, scratch: str) -> _Opened:
        build, *rest = cloudpickle.loads(self._content)
        if not isinstance(build, Luggage):
            return _Opened(Job(build, *rest), "", "")
        folder = Path(tempfile.mkdtemp(prefix="pathcontrol-", dir=scratch)).resolve()
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        for place, content in build.files.items():
            (folder / place).parent.mkdir(parents=True, exist_ok=True)
            (folder / place).write_bytes(content)
        return _Opened(Job(build.unpack(folder), *rest), str(folder), str(build.home).rstrip("/"))


def _moved(run: Run, here: str, home: str) -> Run:
    """The same run, that looks for the meshes of its robot at ``home``."""
    _, (data, config, stored) = run.__reduce__()
    here, home = (json.dumps(folder)[1:-1] for folder in (here, home))
    return Run(data, config, RunContext.load(stored._replace(text=stored.text.replace(here, home))))


@contextmanager
def _own_modules_by_value() -> Iterator[None]:
    """Has what is in the user's own modules pickled itself, and not its name."""
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
    """Whether a module is a Python file that is neither of this package, nor of the standard library, nor installed."""
    if type(module) is not ModuleType or sys.modules.get(module.__name__) is not module:  # as lazy ones, and __main__
        return False
    file = Path(vars(module).get("__file__") or "")
    stdlib, others = sysconfig.get_path("stdlib"), {"site-packages", "dist-packages"}
    installed = file.is_relative_to(stdlib) or others.intersection(file.parts)
    return file.suffix == ".py" and not installed and module.__name__.partition(".")[0] not in (_OURS, "__main__")
