"""The sensitivity of the reproduction: the paper's two experiments under what the paper leaves unsaid."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.comparison.paper import DURATION, K_P, K_V, PERIOD, START_DEG, K, paper_task
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.projection import Projection
from pathcontrol.experiments.reproduce import PAPER
from pathcontrol.robot.friction import Coulomb, Viscous, levels_of, viscous_of
from pathcontrol.robot.loading import load_robot
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.simulation.run import Run
from pathcontrol.sweeps.manifest import versions
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.sweeps.space import Space
from pathcontrol.sweeps.sweep import sweep

SAMPLES = 300
_CHUNK = 50  # rollouts after which the progress bar moves, and that a killed process loses

#: from when to when [s] the steady state is, by name; a lap takes 3.4 s
WINDOWS = {
    "second half": (0.5 * DURATION, DURATION),
    "from 2 s": (2.0, DURATION),
    "last lap": (DURATION - 3.4, DURATION),
}

#: the settings of ``pathcontrol reproduce``; a filter of 0 Hz is none
NOMINAL: dict[str, Any] = {
    "coulomb": [1.0, 1.0],
    "viscous": [1.0, 1.0],
    "filter_hz": 0.0,
    "encoders": True,
    "delay": 0.0,
    "start": "s0",
    "plan": "exponential",
    "window": "second half",
}

#: one setting changed at a time: what it is, its value in words, and the value
SINGLE: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("Coulomb friction of the arm", "−10 %", {"coulomb": [0.9, 0.9]}),
    ("Coulomb friction of the arm", "+10 %", {"coulomb": [1.1, 1.1]}),
    ("viscous friction of the arm", "−10 %", {"viscous": [0.9, 0.9]}),
    ("viscous friction of the arm", "+10 %", {"viscous": [1.1, 1.1]}),
    ("filter of the velocity", "100 Hz", {"filter_hz": 100.0}),
    ("filter of the velocity", "50 Hz", {"filter_hz": 50.0}),
    ("filter of the velocity", "20 Hz", {"filter_hz": 20.0}),
    ("encoders", "exact", {"encoders": False}),
    ("delay", "one period", {"delay": PERIOD}),
    ("start of the plan", "nearest point", {"start": "nearest"}),
    ("step of the plan", "Euler's", {"plan": "euler"}),
    ("steady state", "from 2 s", {"window": "from 2 s"}),
    ("steady state", "last lap", {"window": "last lap"}),
)

_ALIKE = ("experiment", "filter_hz", "encoders", "delay", "start", "plan")  # in all rollouts of one batch


class EulerPlan(ExtendedMotionPlan):
    """The extended motion plan (22), advanced from tick to tick by Euler's method, σ⁺ = σ + hσ̇."""

    def advance(self, z: Array, out: ControlOutput, period: float) -> Array:
        return (out.s + period * out.sdot)[..., None]


def make_space(samples: int) -> Space:
    """Return the space of what the paper leaves unsaid, each value as likely as any other of its setting."""
    from scipy import stats

    around_one = stats.uniform([0.9, 0.9], [0.2, 0.2])  # of each joint
    settings = {
        "coulomb": around_one,
        "viscous": around_one,
        "filter_hz": [0.0, 100.0, 50.0, 20.0],
        "encoders": [True, False],
        "delay": [0.0, PERIOD],
        "start": ["s0", "nearest"],
        "plan": ["exponential", "euler"],
        "window": list(WINDOWS),
    }
    return Space.latin_hypercube(settings, samples)


def make_combinations(samples: int, seed: int = 0) -> dict[str, Array]:
    """Return the settings of the nominal experiment, of :data:`SINGLE`, and of ``samples`` of :func:`make_space`."""
    cloud = make_space(samples).design(seed)
    first = [NOMINAL | change for _, _, change in (("", "", {}), *SINGLE)]
    return {name: np.concatenate([np.array([row[name] for row in first]), values]) for name, values in cloud.items()}


def combine_experiments(settings: Mapping[str, Array]) -> Space:
    """Return every combination with each of the two experiments; those that run in one batch are neighbours."""
    count = len(settings["window"])
    columns = {name: np.concatenate([values] * len(PAPER)) for name, values in settings.items()}
    columns |= {"experiment": np.repeat(list(PAPER), count), "combination": np.tile(np.arange(count), len(PAPER))}
    order = np.lexsort([columns[name] for name in reversed(_ALIKE)])
    return Space.given({name: values[order] for name, values in columns.items()})


class Combinations:
    """The builder of the rollouts of the sweep: the arm of the paper, and what differs of it and of the loop."""

    @cached_property
    def robot(self) -> RobotModel:
        """The bundled arm, which the controllers believe in."""
        return load_robot("cicese_2dof")

    def __call__(
        self, p: Mapping[str, Array], samples: NDArray[np.int64]
    ) -> list[tuple[NDArray[np.intp], dict[str, Any]]]:
        keys = list(zip(*(p[name].tolist() for name in _ALIKE), strict=True))
        batches = {key: np.array([i for i, other in enumerate(keys) if other == key]) for key in dict.fromkeys(keys)}
        return [(rows, self._arguments(dict(zip(_ALIKE, key, strict=True)), p, rows)) for key, rows in batches.items()]

    def _arguments(self, common: dict[str, Any], p: Mapping[str, Array], rows: NDArray[np.intp]) -> dict[str, Any]:
        """Return the arguments of :func:`simulate` for some rows, which have the ``common`` settings."""
        loop = SampledLoop(
            period=PERIOD,
            encoders=common["encoders"],
            velocity="difference",
            filter_hz=common["filter_hz"] or None,
            torque_limits=True,
            delay=common["delay"],
        )
        return {
            "controller": self._controller(common),
            "q": np.tile(np.deg2rad(START_DEG), (len(rows), 1)),
            "duration": DURATION,
            "plant": self._arm(p["viscous"][rows], p["coulomb"][rows]),
            "loop": loop,
        }

    def _controller(self, common: dict[str, Any]) -> Controller:
        task = paper_task()
        if common["experiment"] == "projection":
            return Projection(self.robot, task, K_P, K_V)
        law = EulerPlan if common["plan"] == "euler" else ExtendedMotionPlan
        return law(self.robot, task, K_P, K_V, K, start=common["start"])

    def _arm(self, viscous: Array, coulomb: Array) -> RobotModel:
        """Return the arm with its friction times factors (k, n)."""
        friction = self.robot.friction
        plus, minus = levels_of(friction, np.zeros(self.robot.n))
        return self.robot.with_friction(
            Viscous(viscous_of(friction) * viscous) + Coulomb(plus * coulomb, minus * coulomb)
        )

    def describe(self) -> dict[str, Any]:
        """Return what the numbers depend on, so that a folder of other versions is refused."""
        return {"experiments": "Moreno and Kelly, section 5", "versions": versions()}


def window_peaks(run: Run) -> dict[str, Array]:
    """Return the peaks of ‖e_p‖ [rad] and ‖e_v‖ [rad/s] that the controller sees in :data:`WINDOWS`, (rollout,)."""
    inside = {name: (run.time >= a - 1e-9) & (run.time <= b + 1e-9) for name, (a, b) in WINDOWS.items()}
    errors = {name: run.norm(name) for name in ("e_p", "e_v")}
    return {f"{error} {window}": e[:, rows].max(-1) for error, e in errors.items() for window, rows in inside.items()}


def run_combinations(out: Path, samples: int = SAMPLES, progress: bool = True) -> SweepResult:
    """Simulate both experiments in every combination; what a folder ``out`` has of that already is kept."""
    space = combine_experiments(make_combinations(samples))
    return sweep(Combinations(), space, out, metrics=window_peaks, chunk=_CHUNK, resume=True, progress=progress)
