"""The loop that a good user of NumPy and Pinocchio writes for exactly these experiments, one rollout at a time.

The same law, sensors, limits, friction and steps of the plant as :mod:`pathcontrol`, and the same record; nothing is
checked and nothing else can be had: one law, one kind of loop, a closed path. ``python -m benchmarks.plain_loop``
prints how far the two are apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.cases import Case, paper, seven_joints
from pathcontrol import Circle, simulate

JOINTS = ("q", "qd", "q_measured", "qd_measured", "tau_demand", "tau", "e_p", "e_v")
#: q_d, q_d', q_d'', ϑ and ϑ' at one s
Point = tuple[NDArray, NDArray, NDArray, float, float]


class PlainLaw:
    """(22) and (25) for one state, with the friction's viscous part."""

    def __init__(self, case: Case) -> None:
        self.model = case.robot.pinocchio_model
        self.data = self.model.createData()
        self.K_p, self.K_v, self.k = case.gains
        self.viscous, self.period = case.robot.friction.viscous, case.loop.period
        self.path = circle(case.task) if isinstance(case.task, Circle) else lissajous(case.task)

    def __call__(self, s: float, q: NDArray, qd: NDArray) -> tuple[NDArray, float, float, NDArray, NDArray]:
        """τ, ṡ, s one period later, e_p and e_v."""
        q_d, dq_d, ddq_d, theta, dtheta = self.path(s)
        e_p, e_v = q_d - q, theta * dq_d - qd
        sdot = theta - self.k * e_p.dot(dq_d)
        qdd = (theta * sdot) * ddq_d + (dtheta * sdot) * dq_d + self.K_v * e_v + self.K_p * e_p
        tau = pin.rnea(self.model, self.data, q, qd, qdd) + self.viscous * qd
        # the exponential Rosenbrock–Euler step of the plan
        x = min(self.period * (dtheta - self.k * (dq_d.dot(dq_d) + e_p.dot(ddq_d))), 1.0)
        phi_1 = math.expm1(x) / x if abs(x) > 1e-3 else 1 + x / 2 * (1 + x / 3 * (1 + x / 4))
        phi_2 = (phi_1 - 1) / x if abs(x) > 1e-3 else 0.5 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5)))
        drift = self.k * qd.dot(dq_d)
        return tau, sdot, s + self.period * (phi_1 * sdot + self.period * phi_2 * drift), e_p, e_v


class PlainPlant:
    """The midpoint scheme with friction that sticks, for one state."""

    def __init__(self, case: Case) -> None:
        self.step, friction = case.loop.period, case.robot.friction
        self.viscous, (self.plus, self.minus) = friction.viscous, friction.levels(np.zeros(case.robot.n))
        self.model = pin.Model(case.robot.pinocchio_model)
        self.model.armature = self.model.armature + 0.5 * self.step * self.viscous
        self.data = self.model.createData()

    def advance(self, q: NDArray, qd: NDArray, tau: NDArray) -> tuple[NDArray, NDArray]:
        """q and q̇ one period later."""
        h, drive = self.step, tau - self.viscous * qd
        middle = self._push(q, qd, qd, drive, 0.5 * h)
        after = self._push(q + 0.25 * h * (qd + middle), middle, qd, drive, h)
        return q + 0.5 * h * (qd + after), after

    def _push(self, q: NDArray, qd: NDArray, start: NDArray, drive: NDArray, duration: float) -> NDArray:
        friction = np.where(qd > 0, self.plus, -self.minus)
        v = start + duration * pin.aba(self.model, self.data, q, qd, drive - friction)
        onward = v * qd > 0
        if onward.all():
            return v
        M, state = pin.crba(self.model, self.data, q), np.where(onward, np.sign(qd), 0.0)
        return stuck(M, M.dot(v) + duration * friction, -duration * self.minus, duration * self.plus, state)


def stuck(M: NDArray, p: NDArray, low: NDArray, high: NDArray, state: NDArray) -> NDArray:
    """v with Mv + λ = p, λ the impulse of dry friction: ``state``, the signs of v, is corrected until it fits."""
    scale = 1e-12 * np.abs(p).max()
    for _ in range(100):
        moving = state != 0
        v = np.zeros_like(p)
        if moving.any():
            impulse = np.where(state > 0, high, low)
            v[moving] = np.linalg.solve(M[np.ix_(moving, moving)], (p - impulse)[moving])
        needed = p - M.dot(v)
        released = (needed > high + scale).astype(float) - (needed < low - scale)
        wanted = np.where(moving, np.where(v * state < 0, 0.0, state), released)
        if (wanted == state).all():
            return v
        state = wanted
    raise RuntimeError("friction does not settle")


def circle(task: Circle) -> Callable[[float], Point]:
    """The task of (9) and (10)."""
    r, theta, center = task.radius, task.speed / task.radius, task.center

    def at(s: float) -> Point:
        x, y = r * math.cos(s), r * math.sin(s)
        outward = np.array((x, y))
        return center + outward, np.array((-y, x)), -outward, theta, 0.0

    return at


def lissajous(task: object) -> Callable[[float], Point]:
    """Each joint at its own frequency, at a constant speed along the path."""
    a, f, phases, center, speed = task.amplitudes, task.frequencies, task.phases, task.center, task.speed
    af, aff = a * f, -a * f**2

    def at(s: float) -> Point:
        angle = f * s + phases
        sine, dq_d = np.sin(angle), af * np.cos(angle)
        ddq_d = aff * sine
        square = dq_d.dot(dq_d)
        theta = speed / math.sqrt(square)
        return center + a * sine, dq_d, ddq_d, theta, -theta * dq_d.dot(ddq_d) / square

    return at


def plain_run(case: Case, q: NDArray, qd: NDArray, s: float, ticks: int) -> dict[str, NDArray]:
    """Everything that :func:`pathcontrol.simulate` records of one rollout, (ticks + 1, …), from (q, q̇) and s."""
    law, plant, effort = PlainLaw(case), PlainPlant(case), case.robot.limits.effort
    resolution, period, n = 2 * np.pi / _counts(case), case.loop.period, case.robot.n
    record = {name: np.empty((ticks + 1, n)) for name in JOINTS} | {name: np.empty(ticks + 1) for name in ("s", "sdot")}
    Q, QD, MQ, MQD, DEMAND, TAU, EP, EV, S, SDOT = record.values()
    last = np.rint((q - period * qd) / resolution) * resolution
    for tick in range(ticks + 1):
        measured = np.rint(q / resolution) * resolution
        velocity = (measured - last) / period
        last = measured
        tau, sdot, after, e_p, e_v = law(s, measured, velocity)
        acting = np.minimum(np.maximum(tau, -effort), effort)
        Q[tick], QD[tick], MQ[tick], MQD[tick] = q, qd, measured, velocity
        DEMAND[tick], TAU[tick], EP[tick], EV[tick], S[tick], SDOT[tick] = tau, acting, e_p, e_v, s, sdot
        s = after
        q, qd = plant.advance(q, qd, acting)
    return record


def _counts(case: Case) -> NDArray:
    given = case.loop.encoders
    return np.asarray(case.robot.actuation.encoder_counts if given is True else given)


class Difference(NamedTuple):
    """How far the plain loop is from :func:`pathcontrol.simulate` at most: positions [rad] and torques [N m]."""

    q: float
    tau: float


def difference(case: Case, ticks: int) -> Difference:
    """The two side by side, from the same start at rest."""
    law, rest = case.law(), np.zeros_like(case.start)
    plain = plain_run(case, case.start, rest, float(law.start(case.start, rest)[0]), ticks)
    ours = simulate(law, case.start, duration=ticks * case.loop.period, loop=case.loop, progress=False)
    return Difference(*(float(np.abs(plain[name] - ours.array(name)[0]).max()) for name in Difference._fields))


if __name__ == "__main__":
    print("paper:", difference(paper(), 4000))
    print("seven joints:", difference(seven_joints(), 4000))
