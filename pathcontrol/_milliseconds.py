"""Times of control loops that are probably in milliseconds."""

from __future__ import annotations

from typing import Any

from pathcontrol._arrays import as_scalar
from pathcontrol.errors import warn

LONGEST_PERIOD = 0.1  # s, beyond which a control period is probably in ms: arms have 0.5 to 20 ms
LONGEST_DELAY = 0.5  # s, the same of a delay
LONGEST_LAG = 2.0  # s, the same of the lag of a servo


def as_period(name: str, value: Any) -> float:
    """Return a control period [s], with a warning where it is probably in milliseconds.

    Raises:
        InputError: it is no number greater than 0.
    """
    period = as_scalar(name, value, positive=True)
    question_time(name, period, LONGEST_PERIOD)
    return period


def question_time(name: str, value: float, longest: float) -> None:
    """Warn of a time [s] beyond the ``longest`` that is likely."""
    if value > longest:
        warn(
            f"{name} = {value:g} s is long for the loop of an arm; did you mean {value:g} ms? Then give "
            f"{1e-3 * value:g}, or '{value:g} ms' in a file"
        )
