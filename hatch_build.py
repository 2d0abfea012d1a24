"""Build hook: compile the engine, ``pathcontrol/engine/src``, for the instruction sets of this kind of machine."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SOURCE = Path("pathcontrol/engine/src/api.cpp")
LIBRARIES = Path("pathcontrol/engine/lib")
#: builds, their flags and the number of lanes of a pack
X86_64 = {
    "base": ["-O2", "-DLANES=4"],  # SSE2, for old machines: -O3 takes more than twice as long to compile
    "avx2": ["-O3", "-mavx2", "-DLANES=4"],
    "avx512": ["-O3", "-mavx512f", "-mavx512dq", "-mavx512vl", "-mprefer-vector-width=512", "-DLANES=8"],
}
ELSEWHERE = {"base": ["-O3", "-DLANES=4"]}
#: without contraction to fused operations and without reordering, all builds give the same bits; vectorising by GCC
#: fuses all the same where it finds sums beside differences, and the kernels are written in vectors already
FLAGS = [
    *("-std=c++17", "-g0", "-fPIC", "-shared", "-ffp-contract=off"),
    *("-fno-math-errno", "-fno-tree-vectorize", "-fno-exceptions", "-fno-rtti", "-fvisibility=hidden", "-w"),
]
#: not for the processor it runs on, and without a C++ library, which it would compile first for a minute and the engine
#: does not need
ZIG = ("-mcpu=baseline", "-nostdlib++")


def find_compiler() -> list[str] | None:
    """Return the command of a C++ compiler with the vector types of GCC and Clang, or None where there is none."""
    for name in (os.environ.get("CXX"), "c++", "g++", "clang++"):
        if name and shutil.which(name.split()[0]):
            return name.split()
    try:
        import ziglang  # noqa: F401
    except ImportError:
        return None
    return [sys.executable, "-m", "ziglang", "c++", *ZIG]


def compile_engine(root: Path, compiler: list[str]) -> list[Path]:
    """Compile all builds and return their files."""
    builds = X86_64 if platform.machine().lower() in ("x86_64", "amd64") else ELSEWHERE
    (root / LIBRARIES).mkdir(exist_ok=True)

    def build(name: str) -> Path:
        file = root / LIBRARIES / f"engine_{name}.so"
        part = file.with_suffix(".part")
        subprocess.run([*compiler, *FLAGS, *builds[name], str(root / SOURCE), "-o", str(part), "-lm"], check=True)
        os.replace(part, file)
        return file

    with ThreadPoolExecutor() as pool:
        return list(pool.map(build, builds))


class EngineBuildHook(BuildHookInterface):
    """Puts the compiled engine into the wheel; without a compiler the wheel works on Pinocchio alone."""

    def dependencies(self) -> list[str]:
        """Ask for a compiler as a wheel only where none is found."""
        return [] if find_compiler() else ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files of the wheel are gathered."""
        compiler = find_compiler()
        if compiler is None:
            self.app.display_warning("no C++ compiler and no ziglang: the compiled engine is left out")
            return
        try:
            files = compile_engine(Path(self.root), compiler)
        except (subprocess.CalledProcessError, OSError) as error:
            self.app.display_warning(f"the engine cannot be compiled, so it is left out: {error}")
            return
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
        build_data["artifacts"] = [str(file.relative_to(self.root)) for file in files]
