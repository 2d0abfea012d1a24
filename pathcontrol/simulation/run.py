"""The result of a simulation: labelled arrays with their units and the full configuration."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, check_index, norms
from pathcontrol.errors import InputError, UnknownNameError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.config import config_of_path, table
from pathcontrol.simulation.context import RunContext, StoredContext, check_sequence
from pathcontrol.simulation.samples import Samples, complete_outcome, label_outcome
from pathcontrol.simulation.storage.run_file import read_file, write_file
from pathcontrol.simulation.trajectory import Trajectory, interpolate_motion
from pathcontrol.simulation.variables import OUTCOMES, VARIABLES
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    import xarray as xr


class Run:
    """The record of a simulation with one or many rollouts.

    Attributes:
        config: the whole configuration: robot, task, controller, plant, loop, versions.
    """

    def __init__(self, data: xr.Dataset | Samples, config: Mapping[str, Any], origin: RunContext | None = None) -> None:
        self._samples = data if isinstance(data, Samples) else None
        if not isinstance(data, Samples):
            if missing := [name for name in ("rollout", "time", "joint") if not data.sizes.get(name)]:
                lacks = " and no ".join(missing)
                raise InputError(f"the data of the run have no {lacks}; expected at least one of each")
            self._data = data
        self.config = dict(config)
        self._origin = RunContext.of(None, None) if origin is None else origin

    @classmethod
    def from_arrays(
        cls,
        time: Array,
        joints: Mapping[str, str],
        arrays: Mapping[str, Array],
        config: Mapping[str, Any],
        outcome: Mapping[str, Array] | None = None,
        *,
        robot: RobotModel | RobotBatch | None = None,
        task: PathTask | None = None,
        model: RobotModel | None = None,
        first_rollout: int = 0,
    ) -> Run:
        """Make a run from arrays laid out as in :data:`VARIABLES`, and the position unit of each joint by its name.

        ``outcome`` is laid out as :data:`OUTCOMES`; a rollout with a time in ``diverged_time`` has diverged, one with
        a time in ``finish_time`` is finished, and any other is running. ``robot`` and ``task`` are those of
        the run, where they are known, and ``model`` is the arm that the law computes with, where it is another one.
        Rollouts are numbered from ``first_rollout``.
        """
        rollout = first_rollout + np.arange(len(arrays["q"]))
        samples = Samples(time, joints, arrays, complete_outcome(len(rollout), outcome or {}), rollout)
        return cls(samples, config, RunContext.of(robot, task, first_rollout, model))

    @property
    def data(self) -> xr.Dataset:
        """An ``xarray.Dataset`` with the dimensions rollout, time and joint, labelled at the first request.

        Its variables are :data:`VARIABLES`, its coordinates :data:`OUTCOMES`.
        """
        if self._samples is not None:
            self._data, self._samples = self._samples.dataset(), None
        return self._data

    def __getitem__(self, name: str) -> xr.DataArray:
        """Return one variable by its name.

        Raises:
            UnknownNameError: the run has no such variable.
            InputError: it has one over other dimensions.
        """
        try:
            found = self.data[name]
        except KeyError as error:
            known = ", ".join(map(str, self.data.variables))
            raise UnknownNameError(f"the run has no variable {name!r}; there are {known}", value=name) from error
        dims, *_ = (VARIABLES | OUTCOMES).get(name, (found.dims,))
        if found.dims != dims:
            raise InputError(f"{name} of the run is over {found.dims}, expected {dims}", value=name)
        return found

    def __contains__(self, name: str) -> bool:
        """Return whether the run has a variable or a coordinate of this name."""
        return name in self.data.variables if self._samples is None else self._samples.plain(name) is not None

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name}: {size}" for name, size in self.data.sizes.items())
        return f"Run({table(self.config, 'controller').get('controller', '?')}; {sizes}{self._describe_ends()})"

    def _describe_ends(self) -> str:
        """Return how many rollouts ended, and how, in words."""
        finished, diverged = self.status == "finished", self.status == "diverged"
        if finished.all():
            return f"; finished after {self.finish_time.max():.4g} s"
        counts = {"finished": finished.sum(), "diverged": diverged.sum()}
        said = [f"{count} of {self.rollouts} {word}" for word, count in counts.items() if count]
        return f"; {', '.join(said)}" if said else ""

    @property
    def robot(self) -> RobotModel:
        """The simulated arm: the given one, or the same one rebuilt from the file.

        If each rollout has an arm of its own, this is the first one; ``run.rollout(i).robot`` is that of rollout i,
        which a file keeps only for rollouts that are saved as runs of their own.

        Raises:
            InputError: the run does not know its robot.
        """
        if self._origin.robot is None:
            raise InputError("the run does not know its robot, as it holds data only; give robot=load_robot(...)")
        return self._origin.robot

    @property
    def model(self) -> RobotModel:
        """The arm that the control law computed with: :attr:`robot`, unless the ``plant`` was another one.

        Files of earlier versions do not know it, and give :attr:`robot`.

        Raises:
            InputError: the run does not know its robot.
        """
        return self.robot if self._origin.model is None else self._origin.model

    @property
    def robots(self) -> list[RobotModel]:
        """The simulated arm of each rollout; in a loaded run, which keeps one arm, the same for all.

        Raises:
            InputError: the run does not know its robot.
        """
        numbers = self.array("rollout").tolist()
        return [self._origin.rollout(number).robot or self.robot for number in numbers]

    @property
    def task(self) -> PathTask | None:
        """The path and its velocity profile, or ``None`` where the run does not know them.

        It is a :class:`TaskBatch` if each rollout has a task of its own, in ``run.rollout(i)`` the one of rollout i.

        Raises:
            InputError: what the file says of them is no path, or not that of the data.
        """
        task = self._origin.task_of(self.array("rollout"))
        check_sequence(self, task)
        return task

    @property
    def time(self) -> Array:
        """Time [s], (time,)."""
        return self.array("time")

    @property
    def joints(self) -> list[str]:
        """The names of the joints."""
        return [str(name) for name in self.array("joint")]

    @property
    def rollouts(self) -> int:
        """The number of rollouts."""
        return len(self.array("rollout"))

    @property
    def status(self) -> NDArray[np.str_]:
        """``"finished"``, ``"diverged"``, or ``"running"`` at the end of the run, (rollout,)."""
        return self.array("status")

    @property
    def finish_time(self) -> Array:
        """The times [s] at which rollouts finished, NaN where they did not, (rollout,)."""
        return self.array("finish_time")

    @property
    def diverged_time(self) -> Array:
        """The times [s] at which rollouts diverged, NaN where they did not, (rollout,).

        All variables are NaN from then on.
        """
        known = "diverged_time" in self  # absent in a file from elsewhere
        return self.array("diverged_time") if known else np.full(self.rollouts, np.nan)

    @property
    def reason(self) -> NDArray[np.str_]:
        """The reasons why rollouts diverged and what to try, empty where they did not, (rollout,)."""
        return self.array("reason") if "reason" in self else np.full(self.rollouts, "")

    @property
    def laps(self) -> NDArray[np.int64]:
        """The whole laps of a closed path from the first sample to the last, (rollout,); backwards they are negative.

        For a rollout that diverged they end at the last sample before.

        Raises:
            InputError: the path is not closed.
        """
        if "laps" not in self:
            raise InputError("the run counts no laps: its path is not closed, or it is a sequence of paths")
        return self.array("laps")

    def array(self, name: str, span: slice = slice(None)) -> Array:
        """Return one variable as a plain array, (rollout, time, …), or its samples in a ``span`` of time.

        Raises:
            UnknownNameError: the run has no such variable.
        """
        if self._samples is not None and (plain := self._samples.plain(name, span)) is not None:
            return plain
        found = self.data.variables.get(name)  # without labels, which take longer than the numbers
        usual = found is not None and found.dims == (VARIABLES | OUTCOMES).get(name, (found.dims,))[0]
        whole = found.to_numpy() if found is not None and usual else self[name].to_numpy()
        return whole if span == slice(None) else whole[:, span]

    def unit(self, name: str) -> str:
        """Return the unit of a variable, ``"1"`` where it has none.

        It is ``"rad or m"`` for turning and sliding joints together.

        Raises:
            UnknownNameError: the run has no such variable.
        """
        if self._samples is None or self._samples.plain(name) is None:
            return str(self[name].attrs.get("units", "1"))
        return self._samples.unit(name)

    def norm(self, name: str) -> Array:
        """Return the Euclidean norm over the joints, (rollout, time), as ‖e_p‖ for ``run.norm("e_p")``.

        It is inf beyond 1e154.

        Raises:
            UnknownNameError: the run has no such variable.
        """
        return norms(self.array(name))

    def rollout(self, index: int) -> Run:
        """Return one of the rollouts as a run of its own.

        Raises:
            InputError: there is none of that number.
        """
        check_index("rollout", index)
        if not -(n := self.rollouts) <= index < n:
            raise InputError(f"rollout {index} does not exist: the run has {n}, counted from 0", value=index)
        part = self.data.isel(rollout=[index]) if self._samples is None else self._samples.alone(index)
        return Run(part, self.config, self._origin.rollout(int(self.array("rollout")[index])))

    def path(self, index: int) -> Run:
        """Return one path of a sequence as a run of its own, which begins at 0 s, where the path before finished.

        The disturbance of its configuration has the times of this run; that of a class of one's own has them where it
        calls them ``start`` and ``duration``.

        Raises:
            InputError: the run is no sequence, or that path was not followed.
        """
        check_index("path", index)
        if "path_status" not in self:
            raise InputError("the run is no sequence of paths; make one with simulate_sequence")
        status, among, ends = (self.array(f"path_{name}") for name in ("status", "index", "finish_time"))
        if not 0 <= index < len(status) or status[index] == "waiting" or not (among == index).any():
            n = int((status != "waiting").sum())
            raise InputError(f"path {index} was not followed: the run has {n} paths, counted from 0", value=index)
        data, s = self.data.isel(time=among == index), self["s"][:, among == index]
        begin = data["time"].to_numpy()[0]
        data = data.assign(s=s - self.array("path_offset")[index])
        data["s"].attrs = s.attrs
        data = data.drop_vars(name for name in OUTCOMES if name in data.coords)
        data = data.assign_coords(time=("time", data["time"].to_numpy() - begin, data["time"].attrs))
        outcome = {"finish_time": ends[[index]] - begin}
        if status[index] == "diverged":
            outcome |= {"diverged_time": self.diverged_time - begin, "reason": self.reason}
        data = data.assign_coords(label_outcome(complete_outcome(1, outcome)))
        return Run(data, config_of_path(self.config, index, float(begin)), self._origin.path(index))

    def excerpt(self, rows: NDArray[np.intp], stop: int, start: int = 0) -> Run:
        """Return the samples from ``start`` to ``stop`` of the rollouts in some ``rows`` (k,) as a run of their own.

        Their arrays are laid out as if these rollouts had been alone, so that sums over time have the same bits.
        """
        if self._samples is not None:
            return Run(self._samples.excerpt(rows, stop, start), self.config, self._origin)
        data = self.data.isel(rollout=rows, time=slice(start, stop))
        flat = {name: (v.dims, np.ascontiguousarray(v.to_numpy()), v.attrs) for name, v in data.data_vars.items()}
        return self.with_data(data.assign(flat))

    def with_data(self, data: xr.Dataset) -> Run:
        """Return a run with other ``data`` of the same robot, task and configuration, such as a part of the time."""
        return Run(data, self.config, self._origin)

    def with_robot(self, robot: RobotModel) -> Run:
        """Return the same run with the given ``robot``, for runs that do not know their own."""
        return Run(self._held, self.config, self._origin.with_robot(robot))

    def to_trajectory(self, rate: float, rollout: int = 0) -> Trajectory:
        """Return the motion of the arm as positions, velocities and accelerations at equal times, from 0 s on.

        Between samples positions are cubics through q and q̇; accelerations are the slopes of such cubics through q̇ and
        its central differences. A rollout that was finished ends there. :func:`pathcontrol.export_trajectory` writes it
        for the controllers of arms.

        Args:
            rate: samples per second [Hz].
            rollout: which of the rollouts, counted from 0.

        Raises:
            InputError: the rollout diverged or there is no such one, or the rate gives less than two samples.
        """
        if not 0 <= rollout < (n := self.rollouts):
            wanted = f"expected one of the {n} of the run, counted from 0"
            raise InputError(f"rollout = {rollout}, {wanted}", argument="rollout", value=rollout, limit=(0, n - 1))
        if self.status[rollout] == "diverged":
            t = float(self.diverged_time[rollout])
            raise InputError(f"rollout {rollout} diverged at {t:g} s and is no motion to follow", value=rollout, time=t)
        end = self.finish_time[rollout]
        stop = None if np.isnan(end) else int(np.searchsorted(self.time, end, side="right"))
        q, qd = (self.array(name)[rollout, :stop] for name in ("q", "qd"))
        units = [self.unit("q")] * q.shape[-1] if self._origin.robot is None else self.robot.position_units
        return Trajectory(*interpolate_motion(self.time[:stop], q, qd, rate), self.joints, units)

    def save(self, path: str | Path) -> Path:
        """Write netCDF or MCAP, whole or not at all; :meth:`load` reads it back.

        The robot is kept as its URDF and what was done to it, without the files of its meshes; the path as what it is
        made of where it is one of the library's, else as samples, see :class:`RecordedPath`. The file has checksums,
        which :meth:`load` checks. MCAP, a message of JSON for each sample, is what PlotJuggler and Foxglove show.

        Raises:
            InputError: the name ends with neither ``.nc`` nor ``.mcap``; the message names what writes other formats.
            StorageError: the file cannot be written, as on a full disk; what was there before stays.
            MissingExtraError: the name ends with ``.mcap``, and the extra ``mcap`` is not installed.
        """
        return write_file(path, self._held, self.config, self._stored())

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read what :meth:`save` wrote; of a file without a checksum, from an earlier version, a warning says so.

        A log in MCAP whose writer was killed is read as far as it goes, and a warning says how far.

        Raises:
            InputError: there is no such file, it is damaged, or it is not a saved run.
            MissingExtraError: it is MCAP, and the extra ``mcap`` is not installed.
        """
        data, config, stored = read_file(path)
        return cls(data, config, None if stored is None else RunContext.load(stored))

    @classmethod
    def from_log(
        cls,
        times: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        tau: ArrayLike | None = None,
        robot: RobotModel | None = None,
        task: PathTask | None = None,
    ) -> Run:
        """Make a run of the log of any arm: times [s], (k,), and q [rad], q̇ [rad/s] and τ [N m], (k, n) each.

        Times may be irregular. What a log lacks is derived or NaN, and what looks like a slip of units brings a
        warning: see :func:`~pathcontrol.simulation.log_arrays.make_log_run`, which raises InputError and TaskError.
        """
        from pathcontrol.simulation.log_arrays import make_log_run

        return cls(*make_log_run(times, q, qd, tau, robot, task))

    @property
    def _held(self) -> xr.Dataset | Samples:
        """The data, or the samples if nobody has asked for their labels."""
        return self._data if self._samples is None else self._samples

    def _stored(self) -> StoredContext:
        """Return robot and task for a file."""
        return self._origin.stored(float(np.fmax.reduce(self.array("s"), axis=None)) if "s" in self else 0.0)

    def __reduce__(self) -> tuple[Any, ...]:
        # a task may hold functions that cannot be pickled; its recipe for a file always can
        held = self._held
        if isinstance(held, Samples):  # arrays of an excerpt are parts of larger ones until they are asked for
            held = held._replace(arrays=dict(held.arrays))
        return _unpickle, (held, self.config, self._stored())


def _unpickle(data: xr.Dataset | Samples, config: Mapping[str, Any], stored: StoredContext) -> Run:
    """Return a run from its pickled parts."""
    return Run(data, config, RunContext.load(stored))
