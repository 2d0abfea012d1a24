"""The momentum observer in the loop, which estimates the torque that acts on the joints beside the motors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel

#: corner frequency of both low passes of the observer in the loop [Hz]
CUTOFF = 35.0
_NEVER = -1e9  # s, the time of a tick that has not been


class Observation(NamedTuple):
    """The values of a momentum observer at one moment, (*batch, n) each.

    Attributes:
        t: the time [s], a number.
        momentum: p = M(q)q̇ [N m s].
        rate: c = C(q,q̇)ᵀq̇ − g(q) [N m], so that ṗ = τ + c + d.
        first: r₁, the disturbance torque d behind the first low pass [N m].
        torque: r, behind both [N m].
    """

    t: float
    momentum: Array
    rate: Array
    first: Array
    torque: Array


class MomentumObserver:
    """A momentum observer with two low passes of one corner frequency; its memory goes in and comes out.

        ṙ₁ = K (d − r₁),  ṙ = K (r₁ − r),  r(s) = (K/(s + K))² d(s),  K = 2π · ``cutoff_hz``

    The first low pass is the observer r₁ = K (p − p(0) − ∫(τ + c + r₁)dt) of A. De Luca and R. Mattone (ICRA 2005). It
    differentiates p, so that r₁ has K times its noise; the second one takes that away where it is above the corner.

    In a sampled loop τ is held, and the mean of d over a period h follows from the change of p, with the trapezoidal
    rule for c. To this mean, held, both low passes respond exactly. The memory, (*batch, 4n + 1), is r₁, r, p and
    τ + c/2 of the tick before, and its time, from which h follows. At the first tick, and in continuous time, where the
    memory is integrated, there is none before, and the same formulas hold with h = 0.

    Args:
        robot: the model of the arm.
        cutoff_hz: K/2π [Hz], a number or (n,), or a row for each rollout, (N, n).

    Attributes:
        gain: K [1/s].
        size: length of the memory, 4n + 1.
    """

    def __init__(self, robot: RobotModel, cutoff_hz: Array) -> None:
        self.robot, self.gain = robot, 2 * np.pi * cutoff_hz
        self.size = 4 * robot.n + 1

    def start(self, q: Array, qd: Array) -> Array:
        """Return the memory, (*batch, 4n + 1), of an arm that starts at (q, q̇), with r = 0.

        Of an observer with rows, one state (q, q̇) gives a row for each.

        Raises:
            InputError: there are neither as many states as rows nor one.
        """
        rows = self.gain.shape[:-1]
        if rows and q.shape[:-1] not in ((), (1,), rows):
            raise InputError(
                f"observer_hz has rows for {rows[0]} rollouts, expected as many as there are initial states, {len(q)}",
                argument="observer_hz",
                value=rows[0],
                limit=len(q),
            )
        p = self.robot.momentum(q, qd)
        p = np.broadcast_to(p, (*np.broadcast_shapes(rows, p.shape[:-1]), self.robot.n))
        none = np.zeros_like(p)
        return np.concatenate([none, none, p, none, none[..., :1] + _NEVER], axis=-1)

    def observe(
        self, t: float, q: Array, qd: Array, memory: Array, kept: NDArray[np.bool_] | bool = False
    ) -> Observation:
        """Return the estimates at t [s] for measured q [rad] and q̇ [rad/s], (*batch, n).

        Those of joints that are ``kept`` stay what they were.

        Raises:
            InputError: the memory is not that of this observer, as where a law drops it.
        """
        first, torque, before, known, last = self._split(memory)
        h = np.where(last < 0.5 * _NEVER, 0.0, t - last)
        p, c = self.robot.momentum(q, qd), self.robot.momentum_rate(q, qd, np.zeros(self.robot.n))
        share = -np.expm1(-self.gain * h)
        slope = np.divide(share, h, out=np.zeros(share.shape) + self.gain, where=h > 0)
        new = first + slope * (p - before) - share * (known + 0.5 * c + first)
        passed = 1 - (1 - share) * self.gain / slope
        both = torque + share * (first - torque) + passed * (new - first)
        if kept is not False:
            new, both = np.where(kept, first, new), np.where(kept, torque, both)
        return Observation(t, p, c, new, both)

    def recall(self, memory: Array) -> Array:
        """Return r at the tick before [N m], (*batch, n), from the memory that it left."""
        return self._split(memory)[1]

    def correct(self, memory: Array, change: Array) -> None:
        """Add a ``change`` [N m], (*batch, n), to the torque that acts up to the next tick, in the memory itself."""
        n = self.robot.n
        memory[..., 3 * n : 4 * n] += change

    def wait(self, memory: Array, time: float) -> None:
        """Let ``time`` [s] more than a period pass, in which the last torque goes on, in the memory itself."""
        memory[..., 4 * self.robot.n] -= time

    def has_seen(self, memory: Array) -> bool:
        """Return whether the memory (4n + 1,) is that of a tick, and not of the start."""
        return bool(memory[-1] > 0.5 * _NEVER)

    def elapsed(self, t: float, memory: Array) -> Array:
        """Return the time from the tick before to t [s], (*batch,), 0 at the first tick."""
        last = memory[..., -1]
        return np.where(last < 0.5 * _NEVER, 0.0, t - last)

    def mean_torque(self, seen: Observation, memory: Array) -> Array:
        """Return the mean of d since the tick before [N m], (*batch, n), behind no low pass; 0 at the first tick."""
        _, _, before, known, _ = self._split(memory)
        h = self.elapsed(seen.t, memory)[..., None]
        mean = np.divide(seen.momentum - before, h, out=np.zeros_like(before), where=h > 0) - known - 0.5 * seen.rate
        return np.where(h > 0, mean, 0.0)

    def rate(self, seen: Observation, tau: Array) -> Array:
        """Return the rate of the memory in continuous time, (*batch, 4n + 1), where τ acts [N m]."""
        first, n = -self.gain * (tau + seen.rate + seen.first), self.robot.n
        rate = np.zeros((*first.shape[:-1], self.size))
        rate[..., :n], rate[..., n : 2 * n] = first, self.gain * (seen.first - seen.torque)
        return rate

    def advance(self, seen: Observation, tau: Array) -> Array:
        """Return the memory at the next tick, (*batch, 4n + 1), up to which τ acts in the mean [N m]."""
        t = np.full((*seen.torque.shape[:-1], 1), seen.t)
        return np.concatenate([seen.first, seen.torque, seen.momentum, tau + 0.5 * seen.rate, t], axis=-1)

    def _split(self, memory: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return r₁, r, p and τ + c/2 of the tick before, (*batch, n) each, and its time, (*batch, 1)."""
        n = self.robot.n
        if memory.shape[-1] != self.size:
            raise InputError(
                f"the momentum observer in the loop got {memory.shape[-1]} numbers of memory, expected "
                f"{self.size}: start and advance of a law have to begin with what those of Controller return",
                value=memory.shape[-1],
                limit=self.size,
            )
        parts = memory[..., : 4 * n].reshape(*memory.shape[:-1], 4, n)
        return parts[..., 0, :], parts[..., 1, :], parts[..., 2, :], parts[..., 3, :], memory[..., 4 * n :]
