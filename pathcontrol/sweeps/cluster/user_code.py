"""A chunk builder together with the files it reads, ready to be sent to a worker."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from pathcontrol.sweeps.chunk import Build


class PackedBuilder(NamedTuple):
    """A chunk builder and the files that it reads, as its method ``pack`` returns them.

    Attributes:
        home: the folder below which the files are.
        files: the content of the files, by their place below ``home``.
        unpack: makes the builder from a folder that has the files at the same places.
    """

    home: Path
    files: dict[str, bytes]
    unpack: Callable[[Path], Build]
