"""What builds a chunk on a machine that does not have the user's files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from pathcontrol.sweeps.chunk import Build


class Luggage(NamedTuple):
    """What builds a chunk and the files that it reads, as its method ``luggage`` gives them.

    Attributes:
        home: the folder below which the files are.
        files: what is in them, by their place below ``home``.
        unpack: what builds a chunk, made from a folder that has the files at the same places.
    """

    home: Path
    files: dict[str, bytes]
    unpack: Callable[[Path], Build]
