"""The compiled library: it is found, loaded once and checked against the structs that Python fills."""

from __future__ import annotations

import ctypes
import platform
from ctypes import CDLL, c_double, c_int, c_longlong, c_void_p
from functools import cache
from pathlib import Path

from pathcontrol.engine.structs import LAYOUT, MOST_JOINTS, MOST_STRIBECK
from pathcontrol.errors import EngineError

#: builds for x86-64, from the plainest instruction set on; other machines have the first only
BUILDS = ("base", "avx2", "avx512")
_FOLDER = Path(__file__).parent / "lib"
_ARRAY = c_void_p
#: the functions of the library with the types of their arguments
FUNCTIONS = {
    "run": [c_void_p] * 3 + [_ARRAY, c_void_p, c_longlong, c_longlong],
    "advance": [c_void_p, c_double, _ARRAY, _ARRAY, _ARRAY, _ARRAY, c_longlong, c_longlong],
    "frames": [c_void_p, c_int, _ARRAY, _ARRAY, c_longlong, _ARRAY, _ARRAY, _ARRAY],
    "inverse_dynamics": [c_void_p, c_longlong, _ARRAY, _ARRAY, _ARRAY, _ARRAY],
    "mass_matrix": [c_void_p, c_longlong, _ARRAY, _ARRAY],
    "momentum": [c_void_p, c_longlong, _ARRAY, _ARRAY, _ARRAY, _ARRAY],
    "stick_slip": [c_int, c_longlong, _ARRAY, _ARRAY, _ARRAY, _ARRAY, _ARRAY, _ARRAY],
    "evaluate": [c_void_p, c_longlong, _ARRAY, _ARRAY],
    "gamma": [c_void_p, c_longlong, c_longlong, _ARRAY, _ARRAY, _ARRAY, _ARRAY],
    "nearest": [c_void_p, c_longlong, _ARRAY, _ARRAY, _ARRAY],
    "control_tick": [c_void_p],
}
_RESULTS = {"run": c_longlong, "frames": c_longlong}


@cache
def load_library(build: str | None = None) -> CDLL:
    """Load the compiled library, by default the fastest build that this processor can run.

    Raises:
        EngineError: there is none, it cannot be loaded, or it was built from other sources than these.
    """
    plain = _open(BUILDS[0])
    best = BUILDS[plain.pathcontrol_instructions()]
    wanted = best if build is None else build
    if build is None and not _file(wanted).exists():
        wanted = BUILDS[0]
    return plain if wanted == BUILDS[0] else _open(wanted)


def lanes(library: CDLL) -> int:
    """Return how many rollouts a build runs side by side."""
    return int(library.pathcontrol_layout(len(LAYOUT) + 2))


def _file(build: str) -> Path:
    """Return the path of a build of the library."""
    return _FOLDER / f"engine_{build}.so"


def _open(build: str) -> CDLL:
    """Load a build and check the sizes of its structs."""
    path = _file(build)
    if not path.exists():
        raise EngineError(
            f"the compiled engine is not installed ({path.name} is missing); simulations run on Pinocchio. To build "
            "it, install pathcontrol again with a C++ compiler or the package ziglang at hand",
            file=str(path),
        )
    try:
        library = CDLL(str(path))
        library.pathcontrol_layout.restype = c_longlong
        found = [library.pathcontrol_layout(k) for k in range(len(LAYOUT) + 2)]
    except (OSError, AttributeError) as error:
        raise EngineError(
            f"{path.name} cannot be used on this {platform.machine()} machine: {error}; install pathcontrol again",
            file=str(path),
        ) from error
    expected = [ctypes.sizeof(struct) for struct in LAYOUT] + [MOST_JOINTS, MOST_STRIBECK]
    if found != expected:
        raise EngineError(
            f"{path.name} was built from other sources: its structs have the sizes {found}, expected {expected}; "
            "install pathcontrol again",
            value=found,
            limit=expected,
            file=str(path),
        )
    try:
        _declare(library)
    except AttributeError as error:  # structs of the same sizes, and a function less
        raise EngineError(
            f"{path.name} was built from other sources: {error}; install pathcontrol again", file=str(path)
        ) from error
    return library


def _declare(library: CDLL) -> None:
    """Set types of arguments and results, so that a wrong argument is an error in Python."""
    for name, arguments in FUNCTIONS.items():
        function = getattr(library, f"pathcontrol_{name}")
        function.restype, function.argtypes = _RESULTS.get(name), arguments
