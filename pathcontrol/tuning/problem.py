"""What is asked for: objectives, limits, and how several scenarios become one number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr

from pathcontrol._arrays import Array
from pathcontrol.sweeps.objectives import costs, excess, failed, metric
from pathcontrol.tuning.optimizer import Told

#: how a metric over the scenarios becomes one number
Reduce = Literal["worst", "mean"]
_FAR, _FARTHEST = 1e6, 1e9  # of limits that are exceeded by far; of candidates without the numbers asked for


class Terms(NamedTuple):
    """What is asked for.

    Attributes:
        goals: ``"min"`` or ``"max"`` by objective.
        bounds: the smallest and the largest value by limited metric.
        reduce: how several scenarios become one number.
    """

    goals: Mapping[str, str]
    bounds: Mapping[str, tuple[float, float]]
    reduce: Reduce

    @property
    def metrics(self) -> list[str]:
        """Those that are asked for."""
        return list(dict.fromkeys((*self.goals, *self.bounds)))

    def describe(self) -> dict[str, Any]:
        """All of it, for the record."""
        limits = {name: list(map(str, ends)) for name, ends in self.bounds.items()}  # JSON knows no infinity
        return {"objectives": dict(self.goals), "limits": limits, "reduce": self.reduce}

    def reduced(self, name: str, values: Array) -> Array:
        """A metric (N, m) of N candidates in m scenarios as one number for each, (N,).

        The worst is what is farthest beyond a limit; without a limit the largest, of what is to be large the smallest.
        NaN in one scenario is NaN.
        """
        if self.reduce == "mean":
            return np.ascontiguousarray(values).mean(1)
        if name not in self.bounds:
            return values.min(1) if self.goals.get(name) == "max" else values.max(1)
        return values[np.arange(len(values)), excess(values, self.bounds[name]).argmax(1)]

    def told(self, table: xr.Dataset) -> Told:
        """Costs and violations of candidates, as the search is told them: all finite."""
        cost = costs(table, self.goals)
        lost = ~np.isfinite(cost).all(1) | failed(table)
        beyond = [excess(metric(table, name), ends) for name, ends in self.bounds.items()]
        violations = np.stack([np.where(lost, _FARTHEST, -1.0), *(np.minimum(one, _FAR) for one in beyond)], axis=1)
        return Told(np.where(lost[:, None], 0.0, cost), violations)
