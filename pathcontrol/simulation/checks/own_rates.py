"""Warnings of a rate that a law sets along its path, or for its energy, and that is too fast for the period."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pathcontrol.control.base import Controller
from pathcontrol.control.mpc.path_mpc import PathMPC
from pathcontrol.control.passive_velocity_field import PassiveVelocityField
from pathcontrol.control.transverse_linearization import TransverseLinearization
from pathcontrol.control.wrappers.pace_rule import APPROACH, PaceRule
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.simulation.checks.too_fast import TooFast

#: the rates [1/s] of laws that feedback of position and velocity has no part in, and what each decays
_RATES: dict[type[Controller], tuple[str, str]] = {
    TransverseLinearization: ("k_s", "the speed along the path"),
    PassiveVelocityField: ("recharge", "the energy of arm and flywheel"),
}
_LONGEST = 2.0  # times the rate; an error that decays at the rate λ is multiplied by 1 − λh where λ's input is held


def check_own_rates(law: Controller, period: float) -> Iterator[TooFast]:
    """Yield warnings of a rate of a law that is too fast for a ``period`` [s], and of intervals too short for it."""
    for kind, (name, what) in _RATES.items():
        rate = float(np.max(getattr(law, name))) if isinstance(law, kind) else 0.0
        if rate * period > _LONGEST:
            yield TooFast(
                f"{name} of {type(law).__name__}",
                rate * period,
                f"{name} = {rate:g} 1/s of {type(law).__name__} is too fast for a period of {period:g} s, in which "
                f"{what} is held, and it is likely to be unstable; take {name} below {_LONGEST / period:.3g}, or "
                "shorten the period",
            )
    if isinstance(law, PathMPC) and period > law.step * (1 + 1e-9):
        yield TooFast(
            "intervals of PathMPC",
            period / law.step,
            f"the loop has a period of {period:g} s, longer than an interval of PathMPC, {law.step:.3g} s, of which it "
            "then applies the first for too long; shorten the period, or take fewer intervals or a longer horizon",
        )


def check_pace(law: Controller, period: float) -> Iterator[TooFast]:
    """Yield the warning of a ``period`` [s] in which a paced plan goes beyond the speed that is asked for.

    Its factor comes to that speed with the time constant T, and ẇ is held over a period h: the difference is multiplied
    by 1 − h/T, which changes its sign where h > T, and grows where h > 2T.
    """
    if period > APPROACH and isinstance(law, LawWrapper) and any(isinstance(rule, PaceRule) for rule in law.rules):
        likely = " and is likely to be unstable" if period > _LONGEST * APPROACH else ""
        yield TooFast(
            "the pace",
            period / APPROACH,
            f"the pace of {type(law).__name__} comes to its speed with a time constant of {APPROACH:g} s, and a period "
            f"of {period:g} s holds its rate for longer, so that it goes beyond the speed that is asked for{likely}; "
            "shorten the period",
        )
