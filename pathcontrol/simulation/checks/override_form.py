"""The warning of an override that makes two rollouts of one start, where a step at a time is more likely meant."""

from __future__ import annotations

from pathcontrol.control.base import Controller
from pathcontrol.control.law_gains import count_gain_rows
from pathcontrol.control.wrappers.override_rule import OverrideRule
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.errors import warn

_OF_A_STEP = 2  # numbers: its time and its factor


def warn_of_override(controller: Controller) -> None:
    """Warn of an override [t, u] in place of the step [[t, u]], of a law that nothing else gives two rollouts."""
    rules = controller.rules if isinstance(controller, LawWrapper) else ()
    for rule in rules:
        factors = rule.factors if isinstance(rule, OverrideRule) else None
        if factors is None or len(factors) != _OF_A_STEP or count_gain_rows(controller):
            continue
        time, factor = factors.tolist()
        warn(
            f"override = [{time:g}, {factor:g}] makes two rollouts of one start, one at each of these factors; did you "
            f"mean a step to {factor:g} at {time:g} s? Then give [[{time:g}, {factor:g}]]; for two rollouts, two starts"
        )
