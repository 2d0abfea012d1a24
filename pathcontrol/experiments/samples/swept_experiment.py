"""The experiments of a sweep: a file with other values for some of its keys, built for many samples at once."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from pathcontrol._arrays import Array
from pathcontrol.arguments import gains_of
from pathcontrol.control.base import Controller
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.arms import build_models, build_plant
from pathcontrol.experiments.builders.disturbances import build_disturbance, varies_together
from pathcontrol.experiments.builders.file_errors import report_by_key
from pathcontrol.experiments.builders.making import Place, arguments_of, target_of
from pathcontrol.experiments.builders.setup import Setup, build, law_of
from pathcontrol.experiments.load import describe_finding
from pathcontrol.experiments.samples.dotted_keys import check_keys, put, section_of_key
from pathcontrol.experiments.samples.named_files import find_files, make_relative
from pathcontrol.experiments.samples.swept_tasks import SweptTask, build_tasks, group_rows, join_tasks, refuse_sequence
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.validators import show_value
from pathcontrol.registry import LAWS
from pathcontrol.robot.model import RobotModel
from pathcontrol.sweeps.cluster.user_code import PackedBuilder
from pathcontrol.tasks.task import PathTask

_GAIN = re.compile(r"controller\.(?:parameters\.)?(\w+)(\[\d+\])*")
_TOGETHER = ("start", "plant", "task")  # what may differ from rollout to rollout of a batch, as gains may
_REMEMBERED = 16  # groups whose task and arm are kept from chunk to chunk


class SweptExperiment:
    """Builds the arguments of ``simulate`` for samples of an experiment file.

    Initial states, gains and what is in ``[task]`` and ``[plant]`` vary within a batch; samples in which another key
    differs are built and simulated apart, one batch for each value, and so are closed and open paths, paths without
    an end, and samples of different durations.

    Args:
        data: what the file says, without ``[sweep]``, ``[tune]`` and ``[output]``.
        base_dir: the folder that the paths in it are relative to.
        varied: what the samples may have instead, in which files may be named too.
        section: the one that says what varies, for messages.
        moved: where files are, relative to ``base_dir``, that samples name by whole paths which are not here.
    """

    def __init__(
        self,
        data: dict[str, Any],
        base_dir: Path,
        varied: Mapping[str, Any] = MappingProxyType({}),
        section: str = "sweep",
        moved: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._data, self._base_dir, self._varied, self._moved = data, base_dir, dict(varied), dict(moved)
        self._where = f"{section}.parameters"
        self._built: dict[str, tuple[Setup, RobotModel, RobotModel]] = {}

    def describe(self) -> dict[str, Any]:
        """Return the content of the file, and digests of the files that it names."""
        files = {name: _digest(path) for name, path in self._files()}
        return {"experiment": self._data, "files_sha256": files}

    def pack(self) -> PackedBuilder:
        """Return this object packed together with the files, for a machine that has neither."""
        base, *paths = (Path(os.path.abspath(path)) for path in (self._base_dir, *dict(self._files()).values()))
        home = Path(os.path.commonpath([base, *paths]))
        files = {str(path.relative_to(home)): path.read_bytes() for path in paths}
        moved = {name: make_relative(name, base) for name, _ in self._files() if os.path.isabs(name)}
        return PackedBuilder(
            home, files, partial(_unpack, make_relative(self._data, base), moved, base.relative_to(home))
        )

    def _files(self) -> Iterator[tuple[str, Path]]:
        return find_files([self._data, self._varied], self._base_dir)

    def check(self, design: Mapping[str, Array]) -> None:
        """Check that no key is a part of another, all samples are valid, gains above 0, and the first can be built.

        Raises:
            ExperimentError: one is not.
        """
        check_keys(list(design), self._where)
        count = len(next(iter(design.values())))
        for i in range(count):
            self._check_gains(self._experiment(design, i, i), i)
        self({name: values[:1] for name, values in design.items()}, np.zeros(1, dtype=np.int64))

    def __call__(
        self, parameters: Mapping[str, Array], samples: NDArray[np.int64]
    ) -> list[tuple[NDArray[np.intp], dict[str, Any]]]:
        """Return the rows that fit in one batch, and the arguments of simulate() for them."""
        experiments = [self._experiment(parameters, row, int(i)) for row, i in enumerate(samples)]
        gains = set.intersection(*(set(self._gains(experiment)) for experiment in experiments))
        apart = [name for name in parameters if not self._may_share_batch(name, gains, experiments)]
        varied = {section_of_key(name) for name in parameters.keys() - apart}
        groups: dict[str, list[int]] = {}
        for row in range(len(samples)):
            groups.setdefault(json.dumps([parameters[name][row].tolist() for name in apart]), []).append(row)
        parts: list[tuple[NDArray[np.intp], dict[str, Any]]] = []
        for key, rows in groups.items():
            try:
                parts += self._parts(key, np.array(rows), [experiments[row] for row in rows], varied)
            except ExperimentError as error:
                raise ExperimentError(
                    f"in samples {samples[rows[0]]} to {samples[rows[-1]]}: {error}", **error.details_with()
                ) from error
        return parts

    def _parts(
        self, key: str, rows: NDArray[np.intp], experiments: list[Experiment], varied: set[str]
    ) -> Iterator[tuple[NDArray[np.intp], dict[str, Any]]]:
        """Yield the batches of samples that differ in nothing but what may differ between rollouts."""
        setup, bare, model = self._of_group(key, experiments[0])
        found = [SweptTask(setup.task, float(setup.duration), setup.laps)] * len(rows)
        if "task" in varied:
            found = build_tasks(experiments, model, self._base_dir)
        for some in group_rows(found):
            chosen, own = [experiments[i] for i in some], [found[i] for i in some]
            plant: Any = setup.plant
            if "plant" in varied:
                plant = [build_plant(experiment, bare, model, self._base_dir) for experiment in chosen]
            law, arguments = self._law(model, chosen, join_tasks(own)), _arguments(setup, chosen, own)
            if "disturbance" in varied:
                place, state = Place(self._base_dir, chosen[0].to_radians), (arguments["q"], arguments["qd"])
                arguments["disturbance"] = build_disturbance(chosen, setup.plant, *state, place)
            yield rows[some], {"controller": law, "plant": plant} | arguments

    def _may_share_batch(self, name: str, gains: set[str], experiments: list[Experiment]) -> bool:
        """Return whether samples that differ in a key may be rollouts of one batch."""
        if section_of_key(name) == "disturbance":
            return all(varies_together(name, experiment) for experiment in experiments)
        return section_of_key(name) in _TOGETHER or _find_argument(name) in gains

    def _law(self, model: RobotModel, experiments: list[Experiment], task: PathTask) -> Controller:
        """Return the law of some samples, with a row for each of them of the gains that differ."""
        first, arguments = experiments[0], [self._law_arguments(experiment) for experiment in experiments]
        names = self._gains(first).keys() & arguments[0].keys()
        gains = {name: _rows([each[name] for each in arguments]) for name in names}
        return law_of(first, model, task, Place(self._base_dir, first.to_radians), gains)

    def _law_arguments(self, experiment: Experiment) -> dict[str, Any]:
        """Return the arguments of the law without those that are objects, such as a law that it wraps."""
        place, section = Place(self._base_dir, experiment.to_radians), experiment.controller
        objects = {name: None for name, value in section if isinstance(value, Section)}
        return arguments_of("controller", section.model_copy(update=objects), LAWS, place)

    def _gains(self, experiment: Experiment) -> dict[str, bool]:
        """Return the gains of the law, of which a batch may have a row for each rollout, and whether each may be 0."""
        place = Place(self._base_dir, experiment.to_radians)
        return gains_of(target_of("controller", experiment.controller, LAWS, place))

    def _check_gains(self, experiment: Experiment, sample: int) -> None:
        zero, arguments = self._gains(experiment), self._law_arguments(experiment)
        for name in zero.keys() & arguments.keys():
            numbers = np.asarray(arguments[name])
            numbers = numbers.diagonal() if numbers.ndim > 1 else numbers
            if (numbers < 0).any() or (not zero[name] and (numbers == 0).any()):
                raise ExperimentError(
                    f"{self._where}: controller.{name} = {show_value(arguments[name])} in sample {sample}, expected "
                    "gains greater than 0; choose another distribution, such as log_uniform",
                    argument=f"controller.{name}",
                    value=numbers,
                )

    def _experiment(self, parameters: Mapping[str, Array], row: int, sample: int) -> Experiment:
        values = {name: column[row].tolist() for name, column in parameters.items()}
        data = deepcopy(self._data)
        for name, value in values.items():
            put(data, name, self._moved.get(value, value) if isinstance(value, str) else value, self._where)
        try:
            return Experiment.model_validate(data)
        except ValidationError as error:
            findings = "; ".join(map(describe_finding, error.errors(include_url=False)))
            raise ExperimentError(f"{self._where}: in sample {sample}: {findings}") from None

    def _of_group(self, key: str, experiment: Experiment) -> tuple[Setup, RobotModel, RobotModel]:
        if key not in self._built:
            setup = build(experiment, self._base_dir)
            refuse_sequence(setup.task)
            if len(self._built) >= _REMEMBERED:
                self._built.pop(next(iter(self._built)))
            self._built[key] = (setup, *build_models(experiment, self._base_dir))
        return self._built[key]


def _unpack(data: dict[str, Any], moved: Mapping[str, str], inside: Path, folder: Path) -> SweptExperiment:
    return SweptExperiment(data, folder / inside, moved=moved)


def _find_argument(key: str) -> str:
    """Return the argument of the law that a dotted key sets, or an empty text."""
    match = _GAIN.fullmatch(key)
    return match[1] if match else ""


def _rows(values: list[Any]) -> Array:
    """Return a gain of one number for all, (), or of all rollouts, (N, 1), (N, 1, n)."""
    if all(value == values[0] for value in values):
        return np.asarray(values[0], dtype=np.float64)
    return np.asarray(values, dtype=np.float64)[:, None]


def _arguments(setup: Setup, experiments: list[Experiment], tasks: list[SweptTask]) -> dict[str, Any]:
    """Return the arguments of simulate() beside the law and the plant."""
    q, qd = _states(setup, experiments, tasks)
    return {
        "q": q,
        "qd": qd,
        "duration": tasks[0].duration,
        "laps": tasks[0].laps,
        "until": setup.until,
        "loop": setup.loop,
        "disturbance": setup.disturbance,
        "engine": setup.engine,
    }


def _states(setup: Setup, experiments: list[Experiment], tasks: list[SweptTask]) -> tuple[Array, Array]:
    """Return q and q̇ at the start, (N, n) each; at rest where the path begins unless the file says otherwise."""
    begins = [one.task.q_d(np.array(one.task.s0)) for one in tasks]
    found = {"q": begins, "qd": [setup.qd] * len(experiments)}
    for i, experiment in enumerate(experiments):
        for name, value in experiment.start.arguments(experiment.to_radians).items():
            found[name][i] = np.asarray(value, dtype=np.float64)
    for name, states in found.items():
        with report_by_key(f"start.{name}"):
            wrong = [state.tolist() for state in states if state.shape != setup.q.shape]
            if wrong:
                raise ExperimentError(
                    f"start.{name} = {wrong[0]}, expected {len(setup.q)} values, one for each joint",
                    argument=f"start.{name}",
                    value=wrong[0],
                )
    return np.array(found["q"]), np.array(found["qd"])


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
