"""``[sweep]`` and ``[tune]``: which keys of an experiment file vary, and how."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import PlainValidator

from pathcontrol.experiments.schema.derived import table_for
from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.validators import Whole, expected

KINDS = ("grid", "uniform", "log_uniform", "normal")
_EXAMPLE = '"controller.k" = { uniform = [1.0, 50.0] }'


def _parameters(value: Any) -> dict[str, dict[str, list[Any]]]:
    """Check dotted keys, in quotes or as tables in tables, each with one kind and its list."""
    if not isinstance(value, dict) or not value:
        raise expected(f"a table of keys of this file that vary, such as {_EXAMPLE}")
    return dict(_leaves(value, ""))


def _leaves(table: dict[str, Any], above: str) -> Iterator[tuple[str, dict[str, list[Any]]]]:
    for name, value in table.items():
        key = above + name
        if not isinstance(value, dict) or not value:
            raise expected(f"of {key!r} a table of {' or '.join(map(repr, KINDS))}, as {_EXAMPLE}")
        if not set(value) <= set(KINDS):
            if set(value) & set(KINDS):
                raise expected(f"of {key!r} one of {', '.join(map(repr, KINDS))}, not also {sorted(set(value))}")
            yield from _leaves(value, f"{key}.")
        else:
            yield key, _checked(key, value)


def _checked(key: str, value: dict[str, Any]) -> dict[str, list[Any]]:
    [(kind, numbers)] = value.items() if len(value) == 1 else [("", None)]
    if not kind:
        raise expected(f"of {key!r} one of {', '.join(map(repr, KINDS))}, not {sorted(value)}")
    if not isinstance(numbers, list) or not numbers:
        raise expected(f"of {key!r} {kind} = [...], a list")
    if kind != "grid" and len(numbers) != 2:
        two = "mean and standard deviation" if kind == "normal" else "the ends of an interval"
        raise expected(f"of {key!r} {kind} = [a, b], {two}")
    return value


#: by dotted key
Varied = Annotated[dict[str, dict[str, list[Any]]], PlainValidator(_parameters)]


_OF_THE_CALL = ("build", "space", "out", "chunk", "resume", "progress", "cluster", "security", "engine")


class SweepSection(Section):
    """``[sweep]``: the space, by other keys of the file, in the units of the file.

    Attributes:
        parameters: by dotted key, as ``controller.k`` or ``start.q[0]``, its values ``grid = [...]``, or a
            distribution: ``uniform = [a, b]``, ``log_uniform = [a, b]``, ``normal = [mean, deviation]``.
        method: every combination of the grids, or so many samples, random or by a Latin hypercube or a Sobol sequence.
        samples: how many, of all methods but the grid.
        seed: where the random numbers begin.
    """

    not_arguments: ClassVar[tuple[str, ...]] = ("parameters", "method", "samples")
    parameters: Varied
    method: Literal["grid", "random", "lhs", "sobol"] = "grid"
    samples: Whole | None = None
    seed: Whole = 0


#: ``[sweep]`` with the arguments of :func:`pathcontrol.sweep`
Sweep = Annotated[SweepSection, table_for("sweeps.sweep:sweep", _OF_THE_CALL, SweepSection)]


def _objectives(value: Any) -> Any:
    """Check names of metrics, or what is to become of each; which ones there are, :func:`pathcontrol.tune` knows."""
    texts = [*value, *value.values()] if isinstance(value, dict) else value if isinstance(value, list) else [value]
    if not texts or not all(isinstance(text, str) for text in texts):
        raise expected('the name of a metric, a list of them, or { name = "min" } or "max"')
    return value


class TuneSection(Section):
    """``[tune]``: parameters, objectives and limits; values of other keys of the file are in the units of the file.

    Attributes:
        parameters: by dotted key, as ``controller.k``, what is searched: ``uniform = [a, b]``, ``log_uniform = [a, b]``
            or ``grid = [...]``.
        objectives: a metric that is to be small, several, or ``{ name = "min" }`` or ``"max"``.
        limits: of metrics the largest value allowed, or ``[smallest, largest]`` with ``inf`` where there is none, in SI
            units.
        scenarios: by dotted key a list with a value for each scenario.
    """

    not_arguments: ClassVar[tuple[str, ...]] = ("parameters", "scenarios")
    parameters: Varied
    objectives: Annotated[str | list[str] | dict[str, str], PlainValidator(_objectives)]
    limits: dict[str, Any] | None = None
    scenarios: dict[str, list[Any]] | None = None


#: ``[tune]`` with the arguments of :func:`pathcontrol.tune`
Tune = Annotated[TuneSection, table_for("tuning.tune:tune", _OF_THE_CALL, TuneSection)]
