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
    _declare(library)
    return library


def _declare(library: CDLL) -> None:
    """Set argument types, so that a wrong argument is an error in Python."""
    array = c_void_p
    library.pathcontrol_run.restype = c_longlong
    library.pathcontrol_run.argtypes = [c_void_p] * 3 + [array, c_void_p, c_longlong, c_longlong]
    library.pathcontrol_frames.restype = c_longlong
    library.pathcontrol_frames.argtypes = [c_void_p, c_int, array, array, c_longlong, array, array, array]
    for name, arguments in {
        "advance": [c_void_p, c_double, array, array, array, array, c_longlong, c_longlong],
        "inverse_dynamics": [c_void_p, c_longlong, array, array, array, array],
        "mass_matrix": [c_void_p, c_longlong, array, array],
        "momentum": [c_void_p, c_longlong, array, array, array, array],
        "stick_slip": [c_int, c_longlong, array, array, array, array, array, array],
        "evaluate": [c_void_p, c_longlong, array, array],
        "gamma": [c_void_p, c_longlong, c_longlong, array, array, array, array],
        "nearest": [c_void_p, c_longlong, array, array, array],
        "control_tick": [c_void_p],
    }.items():
        function = getattr(library, f"pathcontrol_{name}")
        function.restype, function.argtypes = None, arguments
