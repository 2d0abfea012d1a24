"""The choice of the rollouts of a sweep whose whole history is kept."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import NDArray

from pathcontrol._arrays import Array, check_whole

_STREAM = 0x6B656570  # a random stream apart from those of the design and of the sensors


@dataclass(frozen=True)
class Keep:
    """The rollouts whose histories are kept, each as the file of a :class:`Run`.

    Attributes:
        worst: how many of those with the largest value of ``by``, of those that have one; equals in their order.
        by: name of the metric.
        random: how many chosen at random, by the seed of the sweep.
        diverged: how many of those that diverged, the first ones.
    """

    worst: int = 0
    by: str = "contour_error_peak"
    random: int = 0
    diverged: int = 0

    def __post_init__(self) -> None:
        for name in ("worst", "random", "diverged"):
            object.__setattr__(self, name, check_whole(f"keep.{name}", getattr(self, name), 0))

    def at_random(self, samples: int, seed: int) -> NDArray[np.intp]:
        """Return the samples that are chosen at random."""
        rng = default_rng(SeedSequence(seed, spawn_key=(_STREAM,)))
        return np.sort(rng.choice(samples, min(self.random, samples), replace=False))

    def chosen(self, sample: NDArray[np.int64], by: Array, diverged: NDArray[np.bool_]) -> set[int]:
        """Return the worst of some samples by their metric, and the first that diverged."""
        order = np.lexsort([sample, -by])
        worst = sample[order][~np.isnan(by[order])][: self.worst]
        return {int(i) for i in (*worst, *np.sort(sample[diverged])[: self.diverged])}

    def describe(self) -> dict[str, Any]:
        """Return all settings, for the definition of a sweep."""
        return asdict(self)
