"""The tuning problem: objectives, limits, and the reduction of several scenarios to one number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr

from pathcontrol._arrays import Array
from pathcontrol.sweeps.objectives import costs, excess, has_failed, metric
from pathcontrol.tuning.optimizer import Evaluation

#: the reduction of a metric over the scenarios to one number
Reduce = Literal["worst", "mean"]
_FAR, _FARTHEST = 1e6, 1e9  # violation of a limit at most; violation of candidates without the metrics


class Terms(NamedTuple):
    """The objectives and limits of a tuning.

    Attributes:
        goals: ``"min"`` or ``"max"`` by objective.
        bounds: the smallest and the largest value by limited metric.
        reduce: the reduction of several scenarios to one number.
    """

    goals: Mapping[str, str]
    bounds: Mapping[str, tuple[float, float]]
    reduce: Reduce

    @property
    def metrics(self) -> list[str]:
        """The metrics of all objectives and limits."""
        return list(dict.fromkeys((*self.goals, *self.bounds)))

    def describe(self) -> dict[str, Any]:
        """Return all terms, for the definition of a tuning."""
        limits = {name: list(map(str, ends)) for name, ends in self.bounds.items()}  # JSON knows no infinity
        return {"objectives": dict(self.goals), "limits": limits, "reduce": self.reduce}

    def reduce_scenarios(self, name: str, values: Array) -> Array:
        """Reduce a metric (N, m) of N candidates in m scenarios to one number for each, (N,).

        The worst value is the one farthest beyond a limit; without a limit it is the largest, or the smallest
        of a metric that is to be large.
        NaN in one scenario is NaN.
        """
        if self.reduce == "mean":
            return np.ascontiguousarray(values).mean(1)
        if name not in self.bounds:
            return values.min(1) if self.goals.get(name) == "max" else values.max(1)
        return values[np.arange(len(values)), excess(values, self.bounds[name]).argmax(1)]

    def evaluate(self, table: xr.Dataset) -> Evaluation:
        """Return costs and violations of candidates for the search, all finite."""
        cost = costs(table, self.goals)
        lost = ~np.isfinite(cost).all(1) | has_failed(table)
        beyond = [excess(metric(table, name), ends) for name, ends in self.bounds.items()]
        violations = np.stack([np.where(lost, _FARTHEST, -1.0), *(np.minimum(one, _FAR) for one in beyond)], axis=1)
        return Evaluation(np.where(lost[:, None], 0.0, cost), violations)
