"""The units of length of G-code."""

from __future__ import annotations

from typing import NamedTuple


class Unit(NamedTuple):
    """A unit of length.

    Attributes:
        name: as it is called.
        scale: its length [m].
        tolerance: how much the radii at the ends of an arc may differ [m], LinuxCNC's 0.005 mm or 0.0005 in.
    """

    name: str
    scale: float
    tolerance: float

    def text(self, length: float) -> str:
        """Write a length [m] in this unit, for messages."""
        return f"{length / self.scale:g} {self.name}"


UNITS = {"mm": Unit("mm", 1e-3, 5e-6), "in": Unit("in", 25.4e-3, 0.0005 * 25.4e-3)}
