"""The arm's equations of motion along a path: joint torques for every ṡ and s̈."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.robot.friction import FrictionLaw, levels_of, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.profile import Path

_SAMPLES = 4  # of a cell, at least
_ALL = 4000  # samples of the path, at least


class Samples(NamedTuple):
    """Samples of a path at the knots of N cells and evenly between: s (kN + 1,); q_d and derivatives (kN + 1, n)."""

    s: Array
    q: Array
    dq: Array
    ddq: Array
    k: int

    @property
    def knots(self) -> Samples:
        """The samples at the knots alone, (N + 1,) and (N + 1, n)."""
        return Samples(self.s[:: self.k], self.q[:: self.k], self.dq[:: self.k], self.ddq[:: self.k], 1)

    @property
    def widths(self) -> Array:
        """The widths Δs of the cells, (N,)."""
        return np.diff(self.s[:: self.k])

    def by_cell(self, values: Array) -> Array:
        """Group values at the samples (kN + 1, …) or between (kN, …) by cell, without right ends, (N, k, …)."""
        return values[: len(self.widths) * self.k].reshape(-1, self.k, *values.shape[1:])

    @property
    def bulge(self) -> Array:
        """The excess of q_d'' within each cell over its chord, (N, n); it is large at a kink of q_d''.

        A kink between two samples is k/(k − 1) times as high as they may show it.
        """
        share = np.arange(self.k)[:, None] / self.k
        first, last = self.ddq[: -1 : self.k, None], self.ddq[self.k :: self.k, None]
        over = self.by_cell(self.ddq) - (first + (last - first) * share)
        farthest = np.abs(over).max(-1).argmax(-1)
        return over[np.arange(len(over)), farthest] * self.k / (self.k - 1)


def sample(path: Path, knots: Array, n: int, finer: int = 1) -> Samples:
    """Sample ``path``, for ``n`` joints, at the ``knots`` (N + 1,) and between, ``finer`` times as densely."""
    k = finer * max(_SAMPLES, -(-_ALL // (len(knots) - 1)))
    s = np.interp(np.arange(k * (len(knots) - 1) + 1) / k, np.arange(len(knots)), knots)
    q, dq, ddq = (np.asarray(f(s), dtype=np.float64) for f in (path.q_d, path.dq_d, path.ddq_d))
    for name, value in {"q_d": q, "dq_d": dq, "ddq_d": ddq}.items():
        if value.shape != (len(s), n):
            raise TaskError(
                f"{type(path).__name__}.{name} of s with shape {s.shape} has shape {value.shape}, expected "
                f"{(len(s), n)}: the arm has {n} joints",
                value=value.shape,
            )
        if not np.isfinite(value).all():
            i = int(np.argmin(np.isfinite(value).all(-1)))
            raise TaskError(
                f"{type(path).__name__}.{name}(s={s[i]:g}) = {value[i].tolist()}, expected finite numbers",
                value=value[i].tolist(),
                s=float(s[i]),
            )
    return Samples(s, q, dq, ddq, k)


class Torques(NamedTuple):
    """Torques τ = a s̈ + b ṡ² + d ṡ + c + F [N m] at the knots, each (N + 1, n), with bounds on the dry friction F.

    With q̇ = q_d'ṡ and q̈ = q_d's̈ + q_d''ṡ²: a = M q_d', b = M q_d'' + C(q_d, q_d')q_d', c = g(q_d), and viscous friction
    gives d (Bobrow, Dubowsky and Gibson, Int. J. Robotics Research 4, 1985). Of each cell, (N, n), are F and the bulge
    of b between the knots.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    least: Array
    most: Array
    bulge: Array


def torques(robot: RobotModel, samples: Samples) -> Torques:
    """Return the torques of ``robot`` along a path."""
    _, q, dq, ddq, _ = samples.knots
    c, rest = robot.gravity(q), np.zeros(robot.n)
    rate = 1 / np.abs(dq).max()  # ṡ for which inertia is not lost beside weight, whatever the scale of s
    a = (robot.inverse_dynamics(q, rest, rate * dq) - c) / rate
    b = (robot.inverse_dynamics(q, rate * dq, rate**2 * ddq) - c) / rate**2
    bulge = (robot.inverse_dynamics(q[:-1], rest, rate**2 * samples.bulge) - c[:-1]) / rate**2
    return Torques(a, b, c, viscous_of(robot.friction) * dq, *dry_friction(robot.friction, samples), bulge)


def dry_friction(law: FrictionLaw, samples: Samples) -> tuple[Array, Array]:
    """Return the least and the most dry friction [N m] in each cell, each (N, n), of motion with ṡ > 0.

    Where a joint turns back it is all between −F⁻ and F⁺; where one stands still, none. Levels that vary with velocity
    are taken to lie between those at rest and at infinite velocity.
    """
    levels = [levels_of(law, np.full(law.n, speed)) for speed in (0.0, np.inf)]
    plus, minus = (np.stack(sides) for sides in zip(*levels, strict=True))
    sign = np.sign(samples.dq)
    least = np.where(sign > 0, plus.min(0), np.where(sign < 0, -minus.max(0), 0.0))
    most = np.where(sign > 0, plus.max(0), np.where(sign < 0, -minus.min(0), 0.0))
    turns = _may_turn(samples)
    least = np.where(turns, -minus.max(0), _over_cells(samples, least, np.minimum))
    return least, np.where(turns, plus.max(0), _over_cells(samples, most, np.maximum))


def _may_turn(samples: Samples) -> Array:
    """Return the mask, (N, n), of cells in which a joint may turn back twice between two samples, unseen by them."""
    speed, slope = np.abs(samples.dq), samples.ddq
    step = np.diff(samples.s)[:, None]
    reach = 0.5 * step * np.maximum(np.abs(slope[:-1]), np.abs(slope[1:]))
    hidden = (slope[:-1] * slope[1:] < 0) & (np.minimum(speed[:-1], speed[1:]) < reach)
    return np.asarray(samples.by_cell(hidden).any(1))


def _over_cells(samples: Samples, values: Array, extreme: np.ufunc) -> Array:
    """Return the extreme over each cell with both its ends, (N, n), of values at the samples, (kN + 1, n)."""
    return extreme(extreme.reduce(samples.by_cell(values), axis=1), values[samples.k :: samples.k])
