"""The errors and the warning of this package: one root, leaves that are also the builtin a caller would expect.

Every message names the value, what was expected and what to try.
"""

from __future__ import annotations

import copyreg
import pickle
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

#: modules whose frames stand between a warning and the code that it is for
_PASSED = frozenset({__name__.partition(".")[0], "abc", "contextlib", "functools"})

#: numbers in an array that an error lists
_MOST_LISTED = 100_000


class PathControlError(Exception):
    """Root of all errors raised on purpose by :mod:`pathcontrol`.

    What a program may want to know stands beside the message, ``None`` where the error is not about it. Arrays are
    lists there.

    Args:
        message: for a person to read.
        **details: values of the attributes.

    Attributes:
        argument: name of the argument that was refused or is missing, with an index for one part, as ``paths[1]``.
        value: what was given, or what came out.
        limit: what the value is held to, a number or both ends.
        choices: the names that there are.
        joint: name of the joint.
        s: path parameter [rad, m or -].
        time: time of the simulation [s].
        file: path of the file, as text.
        line: number of the line in the file, from 1.
    """

    argument: str | None = None
    value: Any = None
    limit: Any = None
    choices: tuple[str, ...] | None = None
    joint: str | None = None
    s: float | None = None
    time: float | None = None
    file: str | None = None
    line: int | None = None

    def __init__(self, message: object = "", **details: Any) -> None:
        super().__init__(message)
        vars(self).update((name, _plain(value)) for name, value in details.items())

    def details_with(self, **more: Any) -> dict[str, Any]:
        """Return what stands beside the message, and ``more``, for an error that says this one with its place."""
        return vars(self) | more

    def __reduce__(self) -> tuple[Any, ...]:  # with what can be sent to another process
        return type(self), self.args, {name: value for name, value in vars(self).items() if _is_pickled(value)}


@contextmanager
def about(**details: Any) -> Iterator[None]:
    """Put ``details`` beside the message of an error that arises inside the block, where its place is known."""
    try:
        yield
    except PathControlError as error:
        vars(error).update((name, _plain(value)) for name, value in details.items())
        raise


class PathControlWarning(UserWarning):
    """Something is allowed but is likely a slip, or was passed over; the message says what, and what to do about it."""


class InputError(PathControlError, ValueError):
    """An argument has the wrong shape, sign or value."""


class UrdfError(PathControlError, ValueError):
    """A robot description cannot be used; the message lists what is wrong in it.

    Attributes:
        findings: those of :func:`check_urdf` that are errors.
    """

    findings: tuple[Any, ...] = ()


class UnknownNameError(PathControlError, LookupError):
    """A robot, joint, frame or choice does not exist; the message lists those that do."""


class MissingExtraError(PathControlError, ImportError):
    """An optional dependency is not installed; the message says which extra brings it."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        super().__init__(
            f"{purpose} needs the package {package!r}, which is not installed; try: pip install 'pathcontrol[{extra}]'",
            value=package,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        rebuild = copyreg.__newobj__  # type: ignore[attr-defined]  # not by __init__ again
        return rebuild, (type(self), *self.args), vars(self)


class TaskError(PathControlError, ValueError):
    """A path task returns something it must not: a wrong shape, a NaN, a velocity profile that is not positive."""


class ToolpathError(PathControlError, ValueError):
    """A toolpath file cannot be used; the message says where in it and why."""


class ExperimentError(PathControlError, ValueError):
    """An experiment file is invalid; the message names the key and the choices.

    Attributes:
        findings: what is wrong, a text each that begins with the key.
    """

    findings: tuple[str, ...] = ()


class ClusterError(PathControlError, RuntimeError):
    """A cluster cannot be reached, or cannot go on; the message says which machine and why."""


class EngineError(PathControlError, RuntimeError):
    """The compiled engine cannot be used, or not for what is asked of it; the message says why and what to do."""


class ArmError(PathControlError, RuntimeError):
    """A real arm cannot be reached, or has stopped by itself; the message says why and what to do."""


class StorageError(PathControlError, OSError):
    """A file cannot be written, as on a full disk; the message says which and why.

    Attributes:
        errno: the operating system's number for the reason, as ``errno.ENOSPC``.
    """

    def __init__(self, message: str, number: int | None = None, **details: Any) -> None:
        super().__init__(message, **details)
        self.errno = number

    def __reduce__(self) -> tuple[Any, ...]:
        kind, args, details = super().__reduce__()
        return kind, (*args, self.errno), details


class SimulationError(PathControlError, RuntimeError):
    """A simulation cannot go on; the message says at which time and why.

    Attributes:
        run: the :class:`Run` up to there, where all rollouts diverged; else ``None``.
    """

    run: Any = None

    def __init__(self, message: str, run: Any = None, **details: Any) -> None:
        super().__init__(message, run=run, **details)


def _plain(value: Any) -> Any:
    """Return numbers and arrays of NumPy as those of Python, and ranges of them; very large arrays stay as they are."""
    if type(value) is tuple:
        return tuple(map(_plain, value))
    convert = getattr(value, "tolist", None)
    return convert() if callable(convert) and hasattr(value, "ndim") and value.size <= _MOST_LISTED else value


def _is_pickled(value: Any) -> bool:
    """Return whether a value can be pickled, as a task with functions of a user often cannot."""
    try:
        pickle.dumps(value)
    except Exception:  # whatever a user's object raises
        return False
    return True


def warn(message: str, category: type[PathControlWarning] = PathControlWarning) -> None:
    """Warn at the line of the caller's own code that led into this package, however deep it went from there."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _PASSED:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


def warn_of_single(name: str) -> None:
    """Warn, from ``__init_subclass__``, that the class ``name`` was made with ``single``, which has no effect."""
    warn(f"class {name} is made with the argument single, which is not needed any more and has no effect; leave it out")
