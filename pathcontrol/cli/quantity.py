"""Options that are quantities: a number in SI units, or one with its unit, as ``--feed "50 mm/s"``."""

from __future__ import annotations

from typing import Any

import click

from pathcontrol._units import parse_quantity
from pathcontrol.errors import InputError, warn

_FASTEST = 5.0  # m/s; no arm feeds faster


class QuantityType(click.ParamType):
    """A number in an SI ``unit``, or a text with a unit of the same dimension."""

    def __init__(self, unit: str) -> None:
        self.unit, self.name = unit, "quantity"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            return float(value)
        except ValueError:
            pass
        try:
            return float(parse_quantity(str(value), self.unit))
        except InputError as error:
            self.fail(f"{value!r}: {error}", param, ctx)

    def write(self, number: str) -> str:
        """Return a number in the SI unit as one types it: lengths in millimetres, in quotes."""
        try:
            return f"'{1e3 * float(number):.10g} m{self.unit}'" if self.unit.startswith("m") else number
        except ValueError:
            return number


def check_feed(feed: float | None) -> float | None:
    """Return the feed of an option [m/s]; warn of one that no arm can keep."""
    if feed is not None and feed > _FASTEST:
        warn(f"--feed {feed:g} is {feed:g} m/s, faster than arms are; did you mean --feed '{feed:g} mm/s'?")
    return feed
