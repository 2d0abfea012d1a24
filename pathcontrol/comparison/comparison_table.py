"""A comparison in words and numbers: a table in degrees with the best of each row marked, and sentences."""

from __future__ import annotations

import numpy as np

from pathcontrol.analysis.progress import is_unfinished
from pathcontrol.analysis.readable import reading
from pathcontrol.analysis.run_remarks import advise_on_friction
from pathcontrol.comparison.compare import Comparison
from pathcontrol.comparison.measures import MEASURES, RECOVERED
from pathcontrol.control.motion_control import MotionController
from pathcontrol.control.wrappers.wrapper import unwrap

_DIGITS = 3
_WRITTEN = {"pd plus": "PD+", "slotine li": "Slotine–Li"}  # names that have more than letters


def tabulate(compared: Comparison) -> list[list[str]]:
    """Return the table of a comparison, heads first: a row for each measure, with ``*`` at its smallest mean.

    Where the means of all laws are alike, there is none.
    """
    rows = [["", *map(law_title, compared.measures)]]
    for name, unit in compared.units.items():
        factor, shown = reading(unit, np.array([compared.mean(law, name) for law in compared.measures]))
        label = f"{_in_words(name)} [{shown}]"
        best = compared.best(name)
        best = [] if len(best) == len(compared.measures) - len(compared.stuck) else best
        rows.append([label, *(_cell(compared, law, name, factor, law in best) for law in compared.measures)])
    return rows


def describe_comparison(compared: Comparison) -> list[str]:
    """Return what the table is of, and in which measures motion control is the best, in sentences."""
    begin, end = compared.scenario.window
    count = len(next(iter(compared.runs.values())).status)
    numbers = f"Mean ± standard deviation of {count} starts" if count > 1 else "The numbers of one start"
    lines = [
        f"{numbers}, from {begin:g} to {end:g} s; * is the smallest in size.",
    ]
    if not all(np.isnan(compared.mean(law, "recovery_s")) for law in compared.measures):
        lines.append(
            f"Recovered is an arm whose contour error stays below {RECOVERED:g} times its own undisturbed peak."
        )
    wins = [_in_words(name) for name in MEASURES if _is_won_by_motion(compared, name)]
    if wins:
        lines.append(f"Motion control is the best in: {', '.join(wins)}.")
    lines += [_describe_stuck(compared, law, f"{stuck} of {count}") for law, stuck in compared.stuck.items()]
    lines += [
        f"{law_title(law)}: {lost} of {count} diverged, so that it has no numbers here."
        for law, run in compared.runs.items()
        if (lost := int((run.status == "diverged").sum()))
    ]
    return lines


def _describe_stuck(compared: Comparison, law: str, share: str) -> str:
    """Return a sentence on a law whose arm did not get along the path even undisturbed."""
    calm = compared.undisturbed[law]
    advice = advise_on_friction(calm.rollout(int(np.argmax(is_unfinished(calm)))))
    return (
        f"{law_title(law)}: {share} did not get along the path even undisturbed, so that small errors say nothing and "
        f"none is marked{': ' * bool(advice)}{advice}."
    )


def law_title(law: str) -> str:
    """Return the name of a law as a reader has it: ``"extended motion plan"``, ``"PD+"``."""
    title = law.replace("_", " ")
    for letters, written in _WRITTEN.items():
        title = title.replace(letters, written)
    return title


def _in_words(measure: str) -> str:
    """Return the name of a measure as a reader has it, without its unit."""
    return measure.removesuffix("_s").removesuffix("_j").replace("_", " ")


def _is_won_by_motion(compared: Comparison, measure: str) -> bool:
    """Return whether only laws of motion control have the least mean of a measure, and others could have it."""
    motion = {law for law, made in compared.laws.items() if isinstance(unwrap(made), MotionController)}
    best = compared.best(measure)
    return bool(best) and motion.issuperset(best) and not motion.issuperset(compared.laws.keys() - compared.stuck)


def _cell(compared: Comparison, law: str, measure: str, factor: float, best: bool) -> str:
    """Return mean and spread of a measure as a text."""
    mean, spread = compared.mean(law, measure), compared.spread(law, measure)
    if np.isnan(mean):
        return "–"
    if np.isinf(mean):
        values = compared.measures[law][measure]
        return f"never in {int(np.isinf(values).sum())} of {len(values)}"
    mean, spread = (0.0 if abs(value) < compared.rounding(measure) else factor * value for value in (mean, spread))
    decimals = max(0, _DIGITS - 1 - int(np.floor(np.log10(abs(mean))))) if mean else 0
    spread_text = f"{spread:.{decimals}f}"
    return f"{mean:.{decimals}f}" + ("*" if best else "") + (f" ± {spread_text}" if float(spread_text) else "")
