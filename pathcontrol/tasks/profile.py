"""Velocity profiles ϑ(s), which say how fast a path is taken, apart from its shape."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.arguments import Rate, Speed

#: time constant [s] T with which every controller brings its plan to rest on the end of an open path, ṡ ∝ (s_end − s)/T
END_TIME = 0.1


class Path(Protocol):
    """The part of a path that profiles use; every :class:`PathTask` has it."""

    s0: float
    s_end: float
    period: float | None

    @property
    def knots(self) -> Array | None:
        """The parameters where the pieces of the path meet; ``None`` for a path of one piece."""

    def q_d(self, s: Array) -> Array:
        """Return the desired path, (*batch, n)."""

    def dq_d(self, s: Array) -> Array:
        """Return the first derivative q_d'(s), (*batch, n)."""

    def ddq_d(self, s: Array) -> Array:
        """Return the second derivative q_d''(s), (*batch, n)."""


class VelocityProfile(ABC):
    """A velocity profile ϑ(s) > 0 for any path; the motion plan (6) is ṡ = ϑ(s).

    Attributes:
        kept_by_arguments: whether a saved run keeps it by the arguments of its constructor, which are attributes of the
            same names; others are kept by samples.
        kept_as: the class of the library that a saved run keeps it as, by its name; empty for its own.
    """

    kept_by_arguments: ClassVar[bool] = False
    kept_as: ClassVar[str] = ""

    @abstractmethod
    def theta(self, path: Path, s: Array) -> Array:
        """Return ϑ(s) [1/s], (*batch,)."""

    @abstractmethod
    def dtheta(self, path: Path, s: Array) -> Array:
        """Return ϑ'(s) [1/s], (*batch,)."""

    def at(self, dq_d: Array, ddq_d: Array, path: Path, s: Array) -> tuple[Array, Array]:
        """Return ϑ and ϑ' for known q_d' and q_d''. Override where that saves evaluating the path again."""
        return self.theta(path, s), self.dtheta(path, s)

    def knots(self, path: Path) -> Array | None:
        """Return the parameters where ϑ' may jump, increasing, (J,); ``None`` for a smooth profile."""
        return None

    def describe(self) -> dict[str, Any]:
        """Return the name and the parameters, for the record of a run."""
        return {"profile": type(self).__name__} | plain_attributes(self)


@dataclass(frozen=True)
class ConstantRate(VelocityProfile):
    """The constant profile ϑ(s) = ``rate`` [1/s]: the path parameter grows steadily."""

    kept_by_arguments = True
    rate: Rate

    def __post_init__(self) -> None:
        as_scalar("rate", self.rate, positive=True)

    def theta(self, path: Path, s: Array) -> Array:
        return np.full_like(s, self.rate, dtype=np.float64)

    def dtheta(self, path: Path, s: Array) -> Array:
        return np.zeros_like(s)


@dataclass(frozen=True)
class ConstantSpeed(VelocityProfile):
    """The profile ϑ(s) = v₀/‖q_d'(s)‖: the joints move at the path speed ‖q̇‖ = ``speed`` [rad/s]."""

    kept_by_arguments = True
    speed: Speed

    def __post_init__(self) -> None:
        as_scalar("speed", self.speed, positive=True)

    def theta(self, path: Path, s: Array) -> Array:
        return self.speed / np.linalg.norm(path.dq_d(s), axis=-1)

    def dtheta(self, path: Path, s: Array) -> Array:
        return self.at(path.dq_d(s), path.ddq_d(s), path, s)[1]

    def at(self, dq_d: Array, ddq_d: Array, path: Path, s: Array) -> tuple[Array, Array]:
        square = np.vecdot(dq_d, dq_d)
        length = np.sqrt(square)
        return self.speed / length, -self.speed * np.vecdot(dq_d, ddq_d) / (square * length)


def plain_attributes(instance: Any) -> dict[str, Any]:
    """Return the public attributes that are numbers, texts or regular arrays of them, fit for JSON."""
    plain = {}
    for name, value in vars(instance).items():
        with contextlib.suppress(ValueError):  # a ragged list is no array
            array = np.asarray(value)
            if not name.startswith("_") and array.dtype.kind in "biufU":
                plain[name] = array.tolist()
    return plain
