"""The unlabelled result of a simulation: arrays and outcomes, labelled when somebody asks for the labels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, copy_vectors
from pathcontrol.simulation.variables import OUTCOMES, VARIABLES

if TYPE_CHECKING:
    import xarray as xr

Labelled = tuple[tuple[str, ...], Array, dict[str, str]]


class Samples(NamedTuple):
    """Arrays of a run before they are labelled, which takes longer than a compiled simulation does.

    Attributes:
        time: [s], (time,).
        joints: the unit of each joint's position by its name.
        arrays: the variables, laid out as in :data:`VARIABLES`.
        outcome: the outcomes, laid out as in :data:`OUTCOMES`, from :func:`complete_outcome`.
        rollout: the numbers of the rollouts, (rollout,).
    """

    time: Array
    joints: Mapping[str, str]
    arrays: Mapping[str, Array]
    outcome: Mapping[str, Array]
    rollout: NDArray[np.intp]

    def plain(self, name: str, span: slice = slice(None)) -> Array | None:
        """Return one of the arrays by its name, a variable in a ``span`` of time, or ``None`` if there is none."""
        if name == "joint":
            return np.array(list(self.joints))
        if name in ("time", "rollout"):
            return self.time if name == "time" else self.rollout
        if name not in self.arrays:
            return self.outcome.get(name)
        return self.arrays.between(name, span) if isinstance(self.arrays, _Cut) else self.arrays[name][:, span]

    def excerpt(self, rows: NDArray[np.intp], stop: int, start: int = 0) -> Samples:
        """Return the samples from ``start`` to ``stop`` of some ``rows``, laid out as if these had been alone."""
        some, moments = _as_slice(rows), slice(start, stop)
        cut = {"rollout": some, "time": moments, "joint": slice(None), "path": slice(None)}
        outcome = {name: value[tuple(cut[dim] for dim in OUTCOMES[name][0])] for name, value in self.outcome.items()}
        return Samples(self.time[moments], self.joints, _Cut(self.arrays, some, moments), outcome, self.rollout[some])

    def alone(self, row: int) -> Samples:
        """Return the samples of one rollout, in memory of their own."""
        arrays = {name: array[[row]] for name, array in self.arrays.items()}
        outcome = {name: v[[row]] if "rollout" in OUTCOMES[name][0] else v.copy() for name, v in self.outcome.items()}
        return Samples(self.time.copy(), self.joints, arrays, outcome, self.rollout[[row]])

    def unit(self, name: str) -> str:
        """Return the unit of a variable; for an arm with turning and sliding joints all that occur: ``rad or m``."""
        if name not in VARIABLES:
            return "s" if name == "time" else OUTCOMES.get(name, ("", "", ""))[1] or "1"
        _, unit, _ = VARIABLES[name]
        kinds = sorted(set(self.joints.values()), reverse=True)
        units = [unit if kind == "rad" else unit.replace("rad", "m").replace("N m", "N") for kind in kinds]
        return " or ".join(dict.fromkeys(units))

    def label_all(self) -> tuple[dict[str, Labelled], dict[str, Labelled]]:
        """Return variables and coordinates by their names, with their dimensions and attributes."""
        variables = {}
        for name, array in self.arrays.items():
            dims, _, meaning = VARIABLES[name]
            variables[name] = (dims, array, {"units": self.unit(name), "long_name": meaning})
        axes: dict[str, Labelled] = {
            "rollout": (("rollout",), self.rollout, {}),
            "time": (("time",), self.time, {"units": "s"}),
            "joint": (("joint",), np.array(list(self.joints)), {}),
        }
        return variables, axes | label_outcome(self.outcome)

    def dataset(self) -> xr.Dataset:
        """Return all arrays with names and units, as the ``data`` of a run."""
        import xarray as xr  # it takes a third of a second to load

        # fastpath: xarray would look whether these are arrays of Dask, and load that where it is installed: up to 1 s
        variables, coordinates = (
            {name: xr.Variable(*labelled, fastpath=True) for name, labelled in part.items()}
            for part in self.label_all()
        )
        return xr.Dataset(variables, coordinates)


class _Cut(Mapping[str, Array]):
    """Parts of arrays, each copied at the first request: metrics need few of them."""

    def __init__(self, whole: Mapping[str, Array], rows: slice | NDArray[np.intp], moments: slice) -> None:
        self._whole, self._rows, self._moments = whole, rows, moments
        self._copied: dict[tuple[str, int, int], Array] = {}

    def __getitem__(self, name: str) -> Array:
        return self.between(name, slice(None))

    def between(self, name: str, span: slice) -> Array:
        """Return the samples of a variable in a ``span`` of time: only these are copied."""
        start, stop, _ = span.indices(len(range(*self._moments.indices(self._whole[name].shape[1]))))
        if (key := (name, start, stop)) not in self._copied:
            begin = self._moments.start or 0
            self._copied[key] = copy_vectors(self._whole[name][self._rows, begin + start : begin + stop])
        return self._copied[key]

    def __contains__(self, name: object) -> bool:
        return name in self._whole

    def __iter__(self) -> Iterator[str]:
        return iter(self._whole)

    def __len__(self) -> int:
        return len(self._whole)


def _as_slice(rows: NDArray[np.intp]) -> slice | NDArray[np.intp]:
    """Return consecutive ``rows`` as a slice, which copies nothing; others as they are."""
    first, last = int(rows[0]), int(rows[-1])
    return slice(first, last + 1) if last - first + 1 == len(rows) and (np.diff(rows) == 1).all() else rows


def complete_outcome(rollouts: int, outcome: Mapping[str, Array]) -> dict[str, Array]:
    """Return the outcome of each rollout with its status, which follows from its times."""
    never = np.full(rollouts, np.nan)
    values = {"finish_time": never, "diverged_time": never, "reason": np.full(rollouts, "")} | dict(outcome)
    status = np.where(np.isnan(values["finish_time"]), "running", "finished")
    return {"status": np.where(np.isnan(values["diverged_time"]), status, "diverged")} | values


def label_outcome(outcome: Mapping[str, Array]) -> dict[str, Labelled]:
    """Return the outcomes as labelled coordinates."""
    labels = {}
    for name, value in outcome.items():
        dims, unit, meaning = OUTCOMES[name]
        labels[name] = (dims, value, {"long_name": meaning} | ({"units": unit} if unit else {}))
    return labels
