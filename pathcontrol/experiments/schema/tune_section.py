"""``[tune]``: which keys of an experiment file are searched, and for what."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import PlainValidator

from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.sweep_sections import Varied
from pathcontrol.experiments.schema.validators import Text, Whole, expected


def _objectives(value: Any) -> Any:
    """Names of metrics, or what is to become of each; which ones there are, :func:`pathcontrol.tune` knows."""
    texts = [*value, *value.values()] if isinstance(value, dict) else value if isinstance(value, list) else [value]
    if not texts or not all(isinstance(text, str) for text in texts):
        raise expected('the name of a metric, a list of them, or { name = "min" } or "max"')
    return value


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
    objectives: Annotated[str | list[str] | dict[str, str], PlainValidator(_objectives)]
    limits: dict[str, Any] | None = None
    scenarios: dict[str, list[Any]] | None = None
    reduce: Literal["worst", "mean"] | None = None
    population: Whole | None = None
    generations: Whole | None = None
    seed: Whole | None = None
    metrics: list[Text] | None = None
