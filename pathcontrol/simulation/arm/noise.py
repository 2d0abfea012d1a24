"""Sensor noise from seeded random generators."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, check_finite, check_whole
from pathcontrol.arguments import Form, Unit
from pathcontrol.errors import InputError, about

_DRAWN = 1 << 20  # count of numbers drawn in advance, for all rollouts together
_LONGEST = 256  # limit of samples drawn in advance


@dataclass(frozen=True, eq=False)
class SensorNoise:
    """White Gaussian noise on the measurements, independent from joint to joint and from sample to sample.

    On the position it is added before the encoder rounds, and so comes through a difference of positions; on the
    velocity before the filter. The numbers of a rollout depend on ``seed`` and on its own number only, and so not on
    how many others there are, nor on how a batch is cut: rollout i has ``SeedSequence(seed, spawn_key=(i,))``.

    Attributes:
        position: standard deviation [rad], a number, (n,), or for each rollout, (N, n) or (N, 1).
        velocity: standard deviation of a velocity that is measured [rad/s], likewise.
        seed: seed of the generators, a whole number from 0.
    """

    position: Annotated[ArrayLike, Form.DEVIATIONS, Unit("rad")] = 0.0
    velocity: Annotated[ArrayLike, Form.DEVIATIONS, Unit("rad/s")] = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("position", "velocity"):
            with about(argument=name):
                deviation = check_finite(f"noise of the {name}", np.asarray(getattr(self, name), dtype=np.float64))
            if (deviation < 0).any() or deviation.ndim > 2:
                raise InputError(
                    f"noise of the {name} = {deviation.tolist()}, expected standard deviations ≥ 0",
                    argument=name,
                    value=deviation,
                    limit=0.0,
                )
        check_whole("seed", self.seed, 0)

    @property
    def on_velocity(self) -> bool:
        """True if there is noise on the velocity."""
        return bool(np.any(np.asarray(self.velocity) > 0))

    def describe(self) -> dict[str, Any]:
        """Return all settings, for the configuration of a run."""
        return {name: np.asarray(value).tolist() for name, value in asdict(self).items()}


class NoiseSource:
    """The noise of N rollouts, sample by sample.

    Args:
        noise: the standard deviations and the seed.
        shape: (N, n).
        first: number of the first rollout.
    """

    def __init__(self, noise: SensorNoise, shape: tuple[int, int], first: int) -> None:
        self._deviation = np.stack([_broadcast(name, getattr(noise, name), shape) for name in ("position", "velocity")])
        self._generators = [
            default_rng(SeedSequence(int(noise.seed), spawn_key=(i,))) for i in range(first, first + shape[0])
        ]
        self._ahead = np.empty((max(1, min(_LONGEST, _DRAWN // (2 * shape[0] * shape[1]))), 2, *shape))
        self._left = 0

    def add_noise(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return positions and velocities (N, n) with the next sample of noise added."""
        sample = self.sample()
        return q + sample[0], qd + sample[1]

    def samples(self, count: int) -> Array:
        """Return the next ``count`` samples, (count, 2, N, n)."""
        ahead = np.empty((count, *self._ahead.shape[1:]))
        for row in ahead:
            row[...] = self.sample()
        return ahead

    def sample(self) -> Array:
        """Return the next sample of the noise of positions and velocities, (2, N, n), valid until the next call."""
        if self._left == 0:
            self._draw()
        self._left -= 1
        return self._ahead[len(self._ahead) - self._left - 1]

    def _draw(self) -> None:
        """Draw more samples; a generator gives the same ones singly or many at once."""
        samples, kinds, _, joints = self._ahead.shape
        for i, generator in enumerate(self._generators):
            self._ahead[:, :, i] = generator.standard_normal((samples, kinds, joints))
        self._ahead *= self._deviation
        self._left = samples


def _broadcast(name: str, deviation: ArrayLike, shape: tuple[int, int]) -> Array:
    """Broadcast a standard deviation to ``shape``, rollouts and joints."""
    array = np.asarray(deviation, dtype=np.float64)
    try:
        return np.broadcast_to(array, shape)
    except ValueError as error:
        raise InputError(
            f"noise of the {name} has shape {array.shape}, expected one that fits {shape}: rollouts and joints",
            argument=name,
            value=deviation,
        ) from error
