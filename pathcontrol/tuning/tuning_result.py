"""The result of a tuning: every candidate, the best ones, the front, and the cost of the limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pathcontrol._arrays import Array
from pathcontrol.analysis.readable import readable_number, readable_parameters
from pathcontrol.analysis.run_metrics import LABELS, UNITS
from pathcontrol.errors import UnknownNameError
from pathcontrol.sweeps.objectives import costs, excess, front, has_failed, metric, within
from pathcontrol.tuning.problem import Terms


class Candidate(NamedTuple):
    """One choice of the parameters.

    Attributes:
        number: its number in the table.
        parameters: their values by name, numbers or arrays (d,).
        metrics: by name; over several scenarios as they were reduced.
    """

    number: int
    parameters: dict[str, Any]
    metrics: dict[str, float]


class Activity(NamedTuple):
    """The effect of a limit on the best candidate of an objective.

    Attributes:
        value: the metric at the best candidate.
        share: of the limit, 1 where it stops the objective from getting better.
        bought: objective of the best candidate if this limit alone is relaxed by 10 % of itself. It is at least as
            good as that: no search was made there, candidates were met on the way.
    """

    value: float
    share: float
    bought: float


class Tuning:
    """The result of :func:`tune`; ``print`` it for a summary.

    Args:
        table: see :meth:`table`.
        terms: the objectives and limits.
        scenarios: number of scenarios of each candidate.
        generations: number of complete generations, and number requested.
    """

    def __init__(self, table: xr.Dataset, terms: Terms, scenarios: int, generations: tuple[int, int]) -> None:
        self._table, self.terms, self.scenarios, self.generations = table, terms, scenarios, generations

    @property
    def objectives(self) -> dict[str, str]:
        """``"min"`` or ``"max"`` by objective."""
        return dict(self.terms.goals)

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """The smallest and the largest value by limited metric, infinite where there is none."""
        return dict(self.terms.bounds)

    @property
    def directions(self) -> dict[str, str]:
        """``"min"`` or ``"max"`` by objective and by limited metric."""
        return {name: self._direction(name) for name in self.limits} | self.objectives

    def table(self) -> xr.Dataset:
        """Return all candidates, over ``sample``: status and metrics, and as coordinates the parameters.

        Over several scenarios metrics are the reduced ones, and a candidate that diverged in one has diverged.
        """
        return self._table

    def feasible(self) -> xr.Dataset:
        """Return the candidates that keep all limits."""
        return self._table.isel(sample=np.flatnonzero(within(self._table, self.limits)))

    def front(self) -> xr.Dataset:
        """Return the Pareto front of the objectives, among the candidates that keep all limits."""
        return front(self._table, self.objectives, self.limits)

    def trade(self, limit: str) -> xr.Dataset:
        """Return the Pareto front of the objectives and a limited metric, without that limit, within the others.

        Raises:
            UnknownNameError: there is no such limit.
        """
        return front(self._table, {limit: self._direction(limit)} | self.objectives, self._others(limit))

    def best(self, objective: str | None = None) -> Candidate | None:
        """Return the candidate within limits with the best value of an objective, by default the first one.

        It is None if no candidate keeps the limits.

        Raises:
            UnknownNameError: it is no objective.
        """
        cost = np.where(within(self._table, self.limits), self._cost(objective), np.inf)
        return self.candidate(int(cost.argmin())) if np.isfinite(cost).any() else None

    def nearest(self) -> Candidate | None:
        """Return the candidate with the least sum of the shares by which it exceeds limits; None if none finished."""
        beyond = np.zeros(self._table.sizes["sample"])
        for name in self.limits:
            beyond += np.maximum(self.beyond(name), 0.0)
        beyond = np.where(np.isfinite(self._cost(None)) & ~has_failed(self._table), beyond, np.inf)
        return self.candidate(int(np.argmin(beyond))) if np.isfinite(beyond).any() else None

    def knee(self) -> Candidate | None:
        """Return the candidate where the front of two objectives bends most; None without one.

        It is the point of the front that is farthest below the line between its ends, both objectives scaled to their
        range on the front. (I. Das, On characterizing the "knee" of the Pareto curve based on normal-boundary
        intersection, Structural Optimization 18, 1999.)
        """
        rows = self.front()
        if len(self.objectives) != 2 or rows.sizes["sample"] < 3:
            return None
        values = costs(rows, self.objectives)
        spread = np.ptp(values, axis=0)
        if (spread == 0).any():
            return None
        below = 1 - ((values - values.min(0)) / spread).sum(1)
        which = int(below.argmax())
        return self.candidate(int(rows["sample"][which])) if below[which] > 0 else None

    def activity(self, objective: str | None = None) -> dict[str, Activity]:
        """Return the effect of each limit at the best candidate of an objective; empty if none keeps the limits."""
        best = self.best(objective)
        if best is None:
            return {}
        return {name: self._activity(name, best, objective) for name in self.limits}

    def beyond(self, limit: str) -> Array:
        """Return how far each candidate exceeds a limit, (sample,), as a share of it; ≤ 0 within it."""
        return excess(metric(self._table, limit), self.limits[self._known(limit)])

    def candidate(self, number: int) -> Candidate:
        """Return a row of the table."""
        row = self._table.isel(sample=number)
        parameters = {str(name): v.to_numpy()[()] for name, v in row.coords.items() if name != "sample"}
        metrics = {str(name): float(v) for name, v in row.data_vars.items() if v.dtype.kind in "fiu"}
        return Candidate(number, parameters, metrics)

    def _activity(self, limit: str, best: Candidate, objective: str | None) -> Activity:
        """Return the effect of one limit."""
        over = self.beyond(limit)
        allowed = within(self._table, self._others(limit)) & (over <= 0.1)
        cost = np.where(allowed, self._cost(objective), np.inf)
        name = self._objective(objective)
        bought = self.candidate(int(cost.argmin())).metrics[name]
        return Activity(best.metrics[limit], 1 + float(over[best.number]), bought)

    def _cost(self, objective: str | None) -> Array:
        """Return the cost of an objective, (sample,)."""
        name = self._objective(objective)
        return costs(self._table, {name: self.objectives[name]})[:, 0]

    def _objective(self, name: str | None) -> str:
        """Check the name of an objective; return it, or the first one."""
        if name is not None and name not in self.objectives:
            raise UnknownNameError(
                f"objective {name!r}: expected one of {', '.join(self.objectives)}",
                value=name,
                choices=tuple(self.objectives),
            )
        return next(iter(self.objectives)) if name is None else name

    def _known(self, limit: str) -> str:
        """Check the name of a limit; return it."""
        if limit not in self.limits:
            raise UnknownNameError(
                f"limit {limit!r}: expected one of {', '.join(self.limits) or 'none'}",
                value=limit,
                choices=tuple(self.limits),
            )
        return limit

    def _others(self, limit: str) -> Mapping[str, tuple[float, float]]:
        """Return all limits but one."""
        return {name: ends for name, ends in self.limits.items() if name != self._known(limit)}

    def _direction(self, limit: str) -> str:
        """Return ``"min"`` or ``"max"`` for a limited metric."""
        return "min" if np.isfinite(self.limits[self._known(limit)][1]) else "max"

    def __repr__(self) -> str:
        whole, asked = self.generations
        stopped = "" if whole == asked else f", stopped after {whole} of {asked} generations"
        every, kept = self._table.sizes["sample"], self.feasible().sizes["sample"]
        return f"Tuning({every} candidates, {kept} within limits{stopped})"

    def __str__(self) -> str:
        return _summarize(self)


def _summarize(tuning: Tuning) -> str:
    """Return lines on the candidates, the best ones and the limits; or on the limits that none keeps."""
    table, (whole, asked) = tuning.table(), tuning.generations
    lost, short = (int((table["status"] == status).sum()) for status in ("diverged", "unfinished"))
    lines = [
        f"{table.sizes['sample']} candidates in {whole} generations"
        + (f" of {asked}, then stopped" if whole < asked else "")
        + (f", each in {tuning.scenarios} scenarios" if tuning.scenarios > 1 else "")
        + f": {tuning.feasible().sizes['sample']} within the limits"
        + (f", {lost} diverged" if lost else "")
        + (f", {short} did not get to the end in the time" if short else "")
    ]
    return "\n".join(
        lines + (_describe_best(tuning) if tuning.feasible().sizes["sample"] else _describe_missed(tuning))
    )


def _describe_best(tuning: Tuning) -> list[str]:
    """Return lines on the best candidates, the knee and the front."""
    lines = []
    for objective, goal in tuning.objectives.items():
        best = tuning.best(objective)
        if best is None:
            lines += ["", f"{_label(objective)} is not finite for any candidate within the limits"]
            continue
        lines += [
            "",
            f"{'least' if goal == 'min' else 'largest'} {_label(objective)}",
            *_describe_candidate(tuning, best),
        ]
        lines += _describe_limits(tuning, objective, best)
    knee = tuning.knee()
    if knee is not None:
        lines += ["", "knee of the front", *_describe_candidate(tuning, knee)]
    if len(tuning.objectives) > 1:
        lines += ["", f"front of {tuning.front().sizes['sample']} candidates"]
    return lines


def _describe_candidate(tuning: Tuning, one: Candidate) -> list[str]:
    """Return lines on one candidate."""
    numbers = ", ".join(f"{_label(name)} {_format_number(name, one.metrics[name])}" for name in tuning.objectives)
    return [f"  {numbers}", f"  candidate {one.number}: {readable_parameters(one.parameters)}"]


def _describe_limits(tuning: Tuning, objective: str, best: Candidate) -> list[str]:
    """Return lines on the effect of each limit."""
    active, lines = tuning.activity(objective), []
    for name, found in active.items():
        change = found.bought / best.metrics[objective] - 1 if best.metrics[objective] else 0.0
        gain = f"changes it by {100 * change:+.1f} % at least" if change else "was not found to change it"
        value = f"{_label(name)} {_format_number(name, found.value)}, limit {_describe_limit(tuning, name)}"
        lines.append(f"  {value}: {100 * max(found.share, 0.0):.0f} % used; 10 % looser {gain}")
    return lines


def _describe_missed(tuning: Tuning) -> list[str]:
    """Return lines on how often each limit is kept, the most exceeded first, and on the nearest candidate."""
    nearest, lines = tuning.nearest(), ["no candidate keeps all limits"]
    beyond = {name: tuning.beyond(name) for name in tuning.limits}
    for name in sorted(beyond, key=lambda name: -float(beyond[name].min())):
        over = beyond[name]
        kept = int((over <= 0).sum())
        value = tuning.candidate(int(over.argmin())).metrics[name]
        said = f"kept by {kept}, at best" if kept else f"kept by none, {100 * over.min():.0f} % beyond at best,"
        lines.append(f"  {_label(name)} {_describe_limit(tuning, name)}: {said} {_format_number(name, value)}")
    if nearest is not None:
        lines += ["", "nearest to all of them", *_describe_candidate(tuning, nearest)]
        for name, over in beyond.items():
            share = over[nearest.number]
            said = "kept" if share <= 0 else f"{100 * share:.0f} % beyond"
            lines.append(f"  {_label(name)} {_format_number(name, nearest.metrics[name])}: {said}")
    return lines


def _label(name: str) -> str:
    """Return the label of a metric."""
    return LABELS.get(name, name)


def _format_number(name: str, value: float) -> str:
    """Return a metric with its unit."""
    return readable_number(value, UNITS.get(name, ""))


def _describe_limit(tuning: Tuning, name: str) -> str:
    """Return a limit in words."""
    low, high = tuning.limits[name]
    said = [(f"≥ {_format_number(name, low)}", low), (f"≤ {_format_number(name, high)}", high)]
    return " and ".join(text for text, end in said if np.isfinite(end))
