"""Ours, the plain loop, and Pinocchio's batched calls alone, on a case."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
import pinocchio as pin

from benchmarks.cases import Case
from benchmarks.contest import Contender
from benchmarks.plain_loop import PlainLaw, plain_run
from pathcontrol import Circle, ControlTick, Paced, PathTask, Space, SpeedOverride, simulate, sweep
from pathcontrol.simulation.engines import Engine

REPEATS = 20  # of a single rollout in a round
#: what is measured of each rollout of a sweep
METRICS = ("e_p_peak", "e_v_peak", "contour_error_peak", "gamma_distance_rms")


def ours(case: Case, rollouts: int, ticks: int, threads: int = 1) -> Contender:
    """:func:`pathcontrol.simulate` of many rollouts, from its checks to the finished run."""
    return _simulated(case, *case.states(rollouts), ticks, threads)


def ours_alone(case: Case, ticks: int) -> Contender:
    """:func:`pathcontrol.simulate` of the experiment itself, one rollout that begins at rest.

    It runs again and again, so that a round takes about as long as one of the plain loop and finds caches as full.
    """
    one = _simulated(case, case.start[None], np.zeros((1, case.robot.n)), ticks, 1)

    def run() -> None:
        for _ in range(REPEATS):
            one.run()

    return Contender(run, REPEATS, ticks)


def plain(case: Case, rollouts: int, ticks: int) -> Contender:
    """The plain loop over the first of the rollouts that :func:`ours` does."""
    return _plainly(case, *case.states(1000), rollouts, ticks)


def plain_alone(case: Case, ticks: int) -> Contender:
    """The plain loop over the experiment itself."""
    return _plainly(case, case.start[None], np.zeros((1, case.robot.n)), 1, ticks)


class OwnCircle(PathTask):
    """The paper's task as a user writes a path: q_d(s) and ϑ(s) only."""

    period = 2 * np.pi

    def __init__(self, task: Circle) -> None:
        self.radius, self.center, self.rate = task.radius, task.center, task.speed / task.radius

    def q_d(self, s: np.ndarray) -> np.ndarray:
        return self.center + self.radius * np.stack([np.cos(s), np.sin(s)], axis=-1)

    def theta(self, s: np.ndarray) -> np.ndarray:
        return np.full_like(s, self.rate)


def own_task(case: Case, rollouts: int, ticks: int) -> Contender:
    """:func:`ours` with the same circle as a subclass of :class:`PathTask`."""
    return ours(case._replace(task=OwnCircle(case.task)), rollouts, ticks)  # which has its table after the first round


def wrapped(case: Case, ticks: int, engine: Engine = "compiled") -> Contender:
    """:func:`ours_alone`, once, of a law that an operator holds and resumes, and that is paced."""
    law = Paced(SpeedOverride(case.law(), [[1.0, 0.0], [2.0, 1.0]]))
    options = {"duration": ticks * case.loop.period, "loop": case.loop, "progress": False}
    return Contender(lambda: simulate(law, case.start, engine=engine, **options), 1, ticks)


def swept(case: Case, rollouts: int, ticks: int) -> Contender:
    """:func:`pathcontrol.sweep` over the states of :func:`ours`, with four metrics, from its checks to its files."""
    law, duration = case.law(), ticks * case.loop.period
    q, qd = case.states(rollouts)
    space = Space.given({"q": q, "qd": qd})

    def build(p: dict[str, np.ndarray], samples: np.ndarray) -> dict[str, object]:
        return {"controller": law, "q": p["q"], "qd": p["qd"], "duration": duration, "loop": case.loop}

    def run() -> None:
        with TemporaryDirectory() as folder:
            sweep(build, space, Path(folder) / "sweep", metrics=METRICS, chunk=rollouts, progress=False)

    return Contender(run, rollouts, ticks)


def _simulated(case: Case, q: np.ndarray, qd: np.ndarray, ticks: int, threads: int) -> Contender:
    law, duration = case.law(threads), ticks * case.loop.period
    return Contender(lambda: simulate(law, q, qd, duration=duration, loop=case.loop, progress=False), len(q), ticks)


def _plainly(case: Case, q: np.ndarray, qd: np.ndarray, rollouts: int, ticks: int) -> Contender:
    s = case.law().start(q, qd)[:, 0]

    def run() -> None:
        for i in range(rollouts):
            plain_run(case, q[i], qd[i], float(s[i]), ticks)

    return Contender(run, rollouts, ticks)


def pinocchio_alone(case: Case, rollouts: int, ticks: int, threads: int = 1) -> Contender:
    """What one tick needs of Pinocchio and nothing else: one RNEA for the law and two ABA for the plant's step."""
    pool = pin.ModelPool(case.robot.pinocchio_model, threads)
    q, qd = (state.T for state in case.states(rollouts))
    torque, out = np.ones_like(q), np.empty_like(q)

    def run() -> None:
        for _ in range(ticks):
            pin.rneaInParallel(threads, pool, q, qd, torque, out)
            pin.abaInParallel(threads, pool, q, qd, torque, out)
            pin.abaInParallel(threads, pool, q, qd, torque, out)

    return Contender(run, rollouts, ticks)


def control_tick(case: Case, repeats: int = 5000) -> tuple[float, float, float]:
    """Median time [µs] of a :class:`ControlTick`, as on hardware, of the plain law, and of one raw RNEA."""
    q, qd = case.start, np.zeros(case.robot.n)
    tick_of = ControlTick(case.law(), case.loop.period)
    tick_of.start(q, qd)
    model, data, plain_law = case.robot.pinocchio_model, case.robot.pinocchio_model.createData(), PlainLaw(case)

    def tick() -> None:
        tick_of(q, qd)

    def plain_tick() -> None:
        plain_law(tick_of.s, q, qd)

    def rnea() -> None:
        pin.rnea(model, data, q, qd, qd)

    times = np.array([[_time(function) for function in (tick, plain_tick, rnea)] for _ in range(repeats)])
    ours_time, plain_time, rnea_time = 1e6 * np.median(times, axis=0)
    return float(ours_time), float(plain_time), float(rnea_time)


def _time(function: Callable[[], object]) -> float:
    began = perf_counter()
    function()
    return perf_counter() - began
