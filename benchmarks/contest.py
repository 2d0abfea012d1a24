"""Times taken side by side: contenders in turn, again and again, so that what disturbs one disturbs all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter
from typing import NamedTuple

import numpy as np


class Contender(NamedTuple):
    """What is timed, and how many rollouts and ticks it does."""

    run: Callable[[], object]
    rollouts: int
    ticks: int


class Times(NamedTuple):
    """Time per rollout and tick [µs] by contender, one for each round."""

    rounds: dict[str, np.ndarray]

    def median(self, name: str) -> float:
        """Median time per rollout and tick [µs]."""
        return float(np.median(self.rounds[name]))

    def ratio(self, name: str, other: str) -> float:
        """Time of one over that of another, the median of the rounds' ratios."""
        return float(np.median(self.rounds[name] / self.rounds[other]))


def contest(contenders: Mapping[str, Contender], rounds: int) -> Times:
    """Each of them once in every round, after one that does not count."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for turn in range(rounds + 1):
        for name, contender in contenders.items():
            began = perf_counter()
            contender.run()
            if turn:
                times[name].append(1e6 * (perf_counter() - began) / (contender.rollouts * contender.ticks))
    return Times({name: np.array(values) for name, values in times.items()})
