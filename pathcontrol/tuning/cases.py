"""The simulation of candidates in every scenario, together, as samples of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.sweeps.chunk import Job
from pathcontrol.sweeps.store import Store


@dataclass(frozen=True)
class Cases:
    """The candidates in all scenarios, simulated in chunks.

    Attributes:
        job: the computation, as of a sweep, from the parameters of both.
        scenarios: values by name, (m,) or (m, d) each.
        count: number of scenarios m; without any it is 1.
        chunk: largest number of rollouts simulated together.
        store: the folder that records every rollout, or None.
        known: the rollouts recorded before, by column.
    """

    job: Job
    scenarios: Mapping[str, Array]
    count: int
    chunk: int
    store: Store | None
    known: Mapping[str, Array]

    def rows(self, candidates: Mapping[str, Array], first: int) -> dict[str, Array]:
        """Return a row for each scenario of each candidate, (N · m,), the scenarios of a candidate one after another.

        Args:
            candidates: their parameters by name, (N,) or (N, d) each.
            first: number of the first candidate; candidate i in scenario j is the sample i · m + j.
        """
        size = len(next(iter(candidates.values())))
        values = {name: np.repeat(each, self.count, axis=0) for name, each in candidates.items()}
        values |= {name: np.concatenate([each] * size) for name, each in self.scenarios.items()}
        samples = first * self.count + np.arange(size * self.count, dtype=np.int64)
        starts = range(0, len(samples), self.chunk)
        parts = [self._part(values, samples, slice(at, at + self.chunk)) for at in starts]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _part(self, values: Mapping[str, Array], samples: NDArray[np.int64], rows: slice) -> dict[str, Array]:
        """Return the rows of some samples, recorded or simulated."""
        known = self._find_recorded(samples[rows])
        if known is not None:
            return known
        parameters = {name: each[rows] for name, each in values.items()}
        found = self.job(parameters, samples[rows])
        if self.store is not None:
            self.store.write(found, self.job.keep, self.job.at_random)
        return found.columns

    def _find_recorded(self, samples: NDArray[np.int64]) -> dict[str, Array] | None:
        """Return the rows of samples if all of them were recorded before."""
        noted = self.known.get("sample", samples[:0])
        if not np.isin(samples, noted).all():
            return None
        at = np.searchsorted(noted, samples)
        return {name: values[at] for name, values in self.known.items()}
