"""``[tune]``: which keys of an experiment file are searched, and for what."""

from __future__ import annotations

from typing import Any, Literal

from pathcontrol.experiments.section import Section
from pathcontrol.experiments.sweep_section import Varied
from pathcontrol.experiments.values import Text, Whole


class TuneSection(Section):
    """``[tune]``: see :func:`pathcontrol.tune`; values of other keys of the file are in the units of the file.

    Attributes:
        parameters: by dotted key, as ``controller.k``, what is searched: ``uniform = [a, b]``, ``log_uniform = [a, b]``
            or ``grid = [...]``.
        objectives: a metric that is to be small, several, or ``{ name = "min" }`` or ``"max"``.
        limits: of metrics the largest value allowed, or ``[smallest, largest]`` with ``inf`` where there is none, in SI
            units.
        scenarios: by dotted key a list with a value for each scenario.
        reduce: how several scenarios become one number.
        population: candidates in a generation.
        generations: how many.
        seed: where the random numbers begin.
        metrics: more of them for the table.
    """

    parameters: Varied
    objectives: Text | list[Text] | dict[str, Text]
    limits: dict[str, Any] | None = None
    scenarios: dict[str, list[Any]] | None = None
    reduce: Literal["worst", "mean"] | None = None
    population: Whole | None = None
    generations: Whole | None = None
    seed: Whole | None = None
    metrics: list[Text] | None = None
