"""The result of a sweep, read from its folder."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.run_metrics import LABELS, UNITS
from pathcontrol.errors import InputError, warn
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.variables import OUTCOMES
from pathcontrol.sweeps.histories import Keep
from pathcontrol.sweeps.objectives import Limits, Objectives, front
from pathcontrol.sweeps.store import Store

if TYPE_CHECKING:
    import xarray as xr


class SweepResult:
    """A sweep on disk, whole or as far as it has come.

    Args:
        folder: the folder of the sweep.

    Attributes:
        samples: number of samples of the sweep.
        definition: its definition: space, seed, metrics, keep and the builder of chunks.

    Raises:
        InputError: there is no sweep, or its manifest or a chunk is damaged or missing; the message names the files,
            which resuming the sweep makes again.
    """

    def __init__(self, folder: str | Path) -> None:
        self._store = Store(folder)
        self.samples: int = self._store.samples
        self.definition: dict[str, Any] = self._store.manifest.definition

    @property
    def folder(self) -> Path:
        """The folder of the sweep."""
        return self._store.folder

    @property
    def finished(self) -> int:
        """The number of samples that have their numbers."""
        return len(self._store.columns(["sample"])["sample"])

    @property
    def kept(self) -> list[int]:
        """The samples whose history is kept."""
        return self._store.kept()

    def run(self, sample: int) -> Run:
        """Return the kept history of a sample, a run of one rollout; ``run.config["sweep"]`` has its parameters.

        Raises:
            InputError: it is not kept, or its file is damaged or missing.
        """
        if sample not in self.kept:
            raise InputError(
                f"the history of sample {sample} is not kept; kept are {self.kept}", argument="sample", value=sample
            )
        self._store.check_run(sample)
        return Run.load(self.history(sample))

    def history(self, sample: int) -> Path:
        """Return the file of the history of a sample."""
        return self._store.run_file(sample)

    def histories(self, worst: int | None = None) -> dict[str, Run]:
        """Return the kept histories by the names of their samples, ``"sample 12"``, the worst first.

        What diverged comes first, then the largest values of the metric by which histories were kept. Histories whose
        files are damaged or missing are left out, with a warning.

        Args:
            worst: how many of them; default all.

        Raises:
            InputError: none is kept, or none can be read.
        """
        columns = self._store.columns(["sample", "status", self.kept_by])
        kept = [i for i in self.kept if i in columns["sample"]]  # a killed process may leave one without its numbers
        if not kept:
            raise InputError(
                f"the sweep in {str(self.folder)!r} keeps no histories; give it `keep = {{ worst = 3 }}` in the "
                "[sweep] of its file, in Python keep=Keep(worst=3), or run one of its samples: its "
                "table has their parameters",
                file=str(self.folder),
            )
        rows = np.searchsorted(columns["sample"], kept)
        badness = columns.get(self.kept_by, np.zeros(len(columns["sample"])))[rows]
        if badness.ndim != 1 or badness.dtype.kind not in "biuf":
            raise InputError(
                f"{self.kept_by}, by which histories are kept, is {badness.dtype}, expected numbers", value=self.kept_by
            )
        order = np.argsort(np.where(columns["status"][rows] == "diverged", -np.inf, -badness), kind="stable")
        return self._load_histories([kept[i] for i in order], worst)

    def _load_histories(self, samples: Sequence[int], most: int | None) -> dict[str, Run]:
        """Return the first histories of ``samples`` that can be read, by their names."""
        found: dict[str, Run] = {}
        lost: list[str] = []
        for sample in samples:
            if len(found) == most:
                break
            try:
                found[f"sample {sample}"] = self.run(sample)
            except InputError as error:
                lost.append(str(error))
        if not found:
            raise InputError("; ".join(lost))
        if lost:
            warn(f"left out: {'; '.join(lost)}")
        return found

    @property
    def kept_by(self) -> str:
        """The metric whose largest values are the worst ones."""
        return str(self.definition.get("keep", {}).get("by", Keep.by))

    def table(self) -> xr.Dataset:
        """Return the numbers of all finished samples, over ``sample``.

        Variables are outcome and metrics, coordinates the parameters.

        For a rollout that diverged all metrics are NaN; its status, ``diverged_time`` and ``reason`` say why.
        """
        return dataset(self._store.columns(), self.definition["space"]["parameters"])

    def pareto(self, objectives: Objectives, limits: Limits | None = None) -> xr.Dataset:
        """Return the Pareto front: rows of the table that no other row dominates, in order of the first objective.

        Equal rows are all on it; what diverged, or has an objective that is not finite, never is.

        Args:
            objectives: names of metrics that are to be small, or ``"min"`` or ``"max"`` by name.
            limits: of metrics the largest value allowed, or (smallest, largest), of which one may be None; samples
                beyond them are left out.

        Raises:
            InputError: an objective or a limit is something else.
            UnknownNameError: there is no such metric.
        """
        return front(self.table(), objectives, limits)

    def __repr__(self) -> str:
        finished = self.finished
        of = f"{finished} samples" if finished == self.samples else f"{finished} of {self.samples} samples"
        return f"SweepResult({str(self.folder)!r}; {of}, {len(self.kept)} histories)"


def dataset(columns: Mapping[str, Array], parameters: Collection[str]) -> xr.Dataset:
    """Return columns of numbers and texts, (k,) or (k, d) each, over ``sample``, with parameters as coordinates."""
    import xarray as xr  # it takes a third of a second to load

    coords: dict[str, Any] = {}
    values: dict[str, Any] = {}
    for name, column in columns.items():
        dims, labels = ("sample", f"{name} component")[: column.ndim], {} if name == "sample" else _labels(name)
        into = coords if name == "sample" or name in parameters else values
        # fastpath: xarray would look whether it is an array of Dask, and load that where it is installed: up to 1 s
        into[name] = xr.Variable(dims, column, labels, fastpath=True)
    return xr.Dataset(values, coords)


def _labels(name: str) -> dict[str, str]:
    """Return the attributes of a column."""
    _, unit, meaning = OUTCOMES.get(name, ((), UNITS.get(name, ""), LABELS.get(name, "")))
    return ({"long_name": meaning} if meaning else {}) | ({"units": unit} if unit else {})
