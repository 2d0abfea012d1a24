"""The law, arm and path of a control loop, by which its samples become a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import InputError
from pathcontrol.hardware.sample_ring import Moments
from pathcontrol.simulation.context import RunContext
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.run_arguments import map_position_units, name_versions
from pathcontrol.simulation.samples import Labelled, Samples, complete_outcome
from pathcontrol.simulation.summaries import summarize

DIMS = ("rollout", "time", "joint")
_MODE = {"units": "1", "long_name": "what the loop did: 0 follow the path, 1 hold, 2 damp, 3 carry the weight"}


class LoopContext:
    """The law of a control loop and its period, which make runs of the loop's samples.

    The variables are those of a run, and ``mode``: e_p = q_d(s) − q and e_v = wq_d'(s)ϑ(s) − q̇ with the factor w of the
    speed.

    Args:
        law: the law of the loop.
        period: its period [s].
        outcome: what the law has to say at the end, (1,) each, see :meth:`Controller.outcome`.
    """

    def __init__(self, law: Controller, period: float, outcome: Mapping[str, Array] | None = None) -> None:
        self._law, self._period, self.outcome = law, period, dict(outcome or {})

    @property
    def origin(self) -> RunContext:
        """The arm and the task."""
        return RunContext.of(self._law.robot, self._law.task, model=self._law.robot)

    @property
    def joints(self) -> dict[str, str]:
        """The units of the joints by their names."""
        return map_position_units(self._law.robot)

    def describe(self, begin: float | None, lost: int) -> dict[str, Any]:
        """Return the configuration of a run whose first sample has the time ``begin`` [s], with ``lost`` samples."""
        law = {name: value if name == "task" else summarize(value) for name, value in self._law.describe().items()}
        return {
            "controller": law,
            "plant": {"robot": self._law.robot.name},
            "loop": {"loop": "hardware", "period": self._period, "begin": begin, "lost": lost},
            "versions": name_versions(),
        }

    def complete(self, found: Moments, sdot: Array, begin: float) -> dict[str, Array]:
        """Return all variables of samples with the rates ``sdot`` (k,), at times from ``begin`` [s] on."""
        point = unwrap(self._law).at_speed(found["factor"]).point(found["s"])
        q, qd = found["q"], found["qd"]
        return {
            "time": found["time"] - begin,
            "q": q,
            "qd": qd,
            "q_measured": q,
            "qd_measured": qd,
            "tau_demand": found["tau_demand"],
            "tau": found["tau"],
            "s": found["s"],
            "sdot": sdot,
            "e_p": point.q_d - q,
            "e_v": point.velocity - qd,
            "regular": np.ones(len(q), dtype=bool),
            "mode": found["mode"].astype(np.int8),
        }

    def label(self, arrays: dict[str, Array], outcome: dict[str, Array]) -> tuple[dict[str, Labelled], dict[str, Any]]:
        """Return variables (k,) and (k, n) as those of one rollout with their units, and the axes."""
        several = {name: array[None] for name, array in arrays.items() if name not in ("time", "mode")}
        labels, axes = Samples(arrays["time"], self.joints, several, outcome, np.arange(1)).label_all()
        return labels | {"mode": (DIMS[:2], arrays["mode"][None], _MODE)}, axes

    def make_run(self, parts: Sequence[dict[str, Array]], begin: float, lost: int) -> Run:
        """Return the run of completed samples, which may come in several parts."""
        import xarray as xr  # it takes a third of a second to load

        arrays = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return Run(
            xr.Dataset(*self.label(arrays, complete_outcome(1, self.outcome))), self.describe(begin, lost), self.origin
        )

    def make_run_of_moments(self, found: Moments) -> Run:
        """Return the run of all samples of a loop.

        Raises:
            InputError: there are none.
        """
        found = only_later(found)
        if not len(found["time"]):
            raise InputError("no steps of the loop are kept; is loop.recording False?")
        rate = find_rates(found)
        sdot, begin = np.append(rate, rate[-1:] if len(rate) else 0.0), float(found["time"][0])
        return self.make_run([self.complete(found, sdot, begin)], begin, lost=0)


def only_later(found: Moments) -> Moments:
    """Return the samples that are later than all before them: a clock may have been set back."""
    before = np.maximum.accumulate(np.concatenate([[-np.inf], found["time"][:-1]]))
    later = found["time"] > before
    return found if later.all() else Moments({name: array[later] for name, array in found.items()})


def find_rates(found: Moments) -> Array:
    """Return ṡ between samples (k,), (k − 1,): the change of s over that of time."""
    return np.asarray(np.diff(found["s"]) / np.diff(found["time"]))
