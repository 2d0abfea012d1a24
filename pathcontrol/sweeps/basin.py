"""The basin of attraction of a path under a control law: from which states the arm returns to it."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_joint_array, as_scalar, check_finite, check_whole
from pathcontrol._json import to_json
from pathcontrol._progress import progress_bar
from pathcontrol.analysis.path_reach import Reach, reach
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.law_gains import refuse_several_gains
from pathcontrol.control.motion_control import ComputedTorque, PDPlus, SlotineLi
from pathcontrol.control.projection import Projection
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import InputError, PathControlWarning, SimulationError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.run_arguments import Loop, check_loop, sample_period
from pathcontrol.simulation.simulate import simulate
from pathcontrol.simulation.variables import bytes_of_sample
from pathcontrol.sweeps.basin_starts import make_starts
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.task import PathTask

_AT_ONCE = 150e6  # bytes of the record of a chunk
_LATE = 0.1  # share of the time in which an arm that has returned is on the path
_SLOW = 0.5  # of the planned speed, by which the velocity may be off
_GLOBAL = ExtendedMotionPlan, ComputedTorque, PDPlus, SlotineLi


@dataclass(frozen=True, eq=False)
class Basin:
    """The states from which an arm was let go, N of them, and those from which it returned to the path.

    Attributes:
        law: name of the law.
        task: the path.
        q: joint positions at the start [rad], (N, n).
        qd: joint velocities at the start [rad/s], (N, n).
        returned: whether the arm was on the path over the last tenth of the time, (N,).
        diverged: whether it left all bounds, (N,).
        return_time: time [s] from which on it stayed on the path, NaN where it did not return, (N,).
        distance: distance of the start from the path [rad], (N,).
        guaranteed: whether the theorem of the law says that it returns, for a law in continuous time on its own model
            with all friction compensated and no limits of torque, (N,).
        reach: the reach of the path.
        ball: distance [rad] from the path within which the theorem guarantees the return from the given velocity, the
            least along the path; inf for laws whose theorem is global, NaN where there is none.
        tolerance: distance [rad] from its desired position within which an arm counts as on the path.
    """

    law: str
    task: PathTask
    q: Array
    qd: Array
    returned: NDArray[np.bool_]
    diverged: NDArray[np.bool_]
    return_time: Array
    distance: Array
    guaranteed: NDArray[np.bool_]
    reach: Reach
    ball: float
    tolerance: float

    @property
    def share(self) -> float:
        """The share of the starts from which the arm returned."""
        return float(self.returned.mean())

    def share_by_distance(self, bins: int = 20) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return the edges [rad] of bins of the distance, (bins + 1,), the share that returned, and starts in each."""
        edges = np.linspace(0.0, float(self.distance.max()) * (1 + 1e-12) + 1e-300, check_whole("bins", bins) + 1)
        count = np.histogram(self.distance, edges)[0]
        back = np.histogram(self.distance[self.returned], edges)[0]
        return edges, np.divide(back, count, out=np.full(len(count), np.nan), where=count > 0), count

    def to_dict(self) -> dict[str, Any]:
        """Return the counts, whole and between edges of the distance, and the reach, as JSON takes them."""
        among = {"returned": self.returned, "diverged": self.diverged, "guaranteed": self.guaranteed}
        among["guaranteed_not_returned"] = self.guaranteed & ~self.returned
        counts: dict[str, Any] = {"starts": len(self.q)} | {name: int(rows.sum()) for name, rows in among.items()}
        edges, _, started = self.share_by_distance()
        back = np.histogram(self.distance[self.returned], edges)[0]
        counts |= {"edges": edges.tolist(), "starts_between": started.tolist(), "returned_between": back.tolist()}
        counts |= {"ball": to_json(self.ball), "reach": self.reach.to_dict(), "tolerance": self.tolerance}
        return {"law": self.law} | counts


def basin(
    controller: Controller,
    starts: ArrayLike | int = 10_000,
    qd: ArrayLike | None = None,
    *,
    margin: float = 1.0,
    seed: int = 0,
    duration: float = 3.0,
    tolerance: float = 0.05,
    plant: RobotModel | None = None,
    loop: SampledLoop | ContinuousTime | None = None,
    progress: bool = True,
) -> Basin:
    """Return the basin of attraction of a path: the law starts from many states, of which some return.

    An arm has returned where it is within ``tolerance`` of its desired position, and within half the planned speed of
    its desired velocity, over the last tenth of the ``duration``. The starts are simulated in chunks, so that 10⁵ of
    them take little memory and, in the compiled engine, minutes.

    The theorem of :class:`Projection` guarantees the return from V < ½k_p R², with the :func:`reach` R of a closed
    path; those of the extended motion plan and of motion control guarantee it from everywhere, on a closed path. They
    are of continuous time, of an arm that is the law's model without friction that is left, and of motors without
    limits. What is measured is the ``loop`` and the ``plant`` given, with theirs.

    Args:
        controller: the law, on one path.
        starts: joint positions [rad], (N, n); or how many, at least: for two joints a square grid over the path and a
            ``margin`` around it, for more joints Sobol points around the path up to this distance in any direction.
        qd: joint velocities at the start [rad/s], (n,) or (N, n); by default at rest.
        margin: distance from the path [rad] up to which there are starts.
        seed: of the Sobol points; the same one gives the same starts.
        duration: time [s] for the return.
        tolerance: distance [rad] within which an arm is on the path; above the error that friction leaves.
        plant: the simulated arm; by default the law's model.
        loop: how the loop is closed; by default ``SampledLoop()``.
        progress: show a bar on standard error when it takes longer than two seconds.

    Raises:
        InputError: starts have another shape or are no numbers, gains or paths differ from rollout to rollout, or an
            option is out of its range.
    """
    check_controller("controller", controller)
    refuse_batch("the path of the law", controller.task, "controller")
    refuse_several_gains(controller)
    duration, tolerance = (
        as_scalar(name, value, positive=True) for name, value in (("duration", duration), ("tolerance", tolerance))
    )
    loop = check_loop(loop)
    q = make_starts(controller.task, starts, as_scalar("margin", margin, positive=True), check_whole("seed", seed, 0))
    velocity = np.zeros(q.shape) if qd is None else as_joint_array("qd", qd, controller.robot.n)
    velocity = np.broadcast_to(check_finite("qd", velocity), q.shape)
    parts = list(_let_go(controller, q, velocity, duration, tolerance, loop, plant, progress))
    returned, diverged, since = (np.concatenate(column) for column in zip(*parts, strict=True))
    found = reach(controller.task)
    distance, guaranteed, ball = _guarantee(controller, q, velocity, found)
    name = str(controller.describe()["controller"])
    return Basin(
        name, controller.task, q, velocity, returned, diverged, since, distance, guaranteed, found, ball, tolerance
    )


def _let_go(
    controller: Controller,
    q: Array,
    qd: Array,
    duration: float,
    tolerance: float,
    loop: Loop,
    plant: RobotModel | None,
    progress: bool,
) -> Iterator[tuple[Array, Array, Array]]:
    """Yield which of the starts return, which diverge, and from when on they are on the path, chunk by chunk."""
    samples = duration / sample_period(loop, duration) + 1
    rows = max(1, int(_AT_ONCE / (samples * bytes_of_sample(controller.robot.n))))
    with progress_bar("letting go", len(q), progress) as update, warnings.catch_warnings():
        for first in range(0, len(q), rows):
            part = slice(first, first + rows)
            options = {"duration": duration, "until": "duration", "plant": plant, "loop": loop, "first_rollout": first}
            try:
                run = simulate(controller, q[part], qd[part], progress=False, **options)  # type: ignore[arg-type]
            except SimulationError as error:
                if error.run is None:
                    raise
                run = error.run
            if run.rollouts != len(q[part]):
                raise InputError("the gains of the law differ from rollout to rollout; give one law at a time")
            yield _measure(run, tolerance)
            update(min(first + rows, len(q)))
            warnings.simplefilter("ignore", PathControlWarning)  # said of the first chunk


def _measure(run: Run, tolerance: float) -> tuple[Array, Array, Array]:
    """Return which rollouts return, which diverge, and from when on they are on the path [s], NaN where never."""
    time, desired = run.time, run.array("e_v") + run.array("qd_measured")
    with np.errstate(invalid="ignore", over="ignore"):
        away = np.linalg.norm(run.array("e_p"), axis=-1)
        off = np.linalg.norm(desired - run.array("qd"), axis=-1)
        on_path = (away <= tolerance) & (off <= _SLOW * np.linalg.norm(desired, axis=-1) + tolerance)
    last_off = len(time) - np.argmax(~on_path[:, ::-1], axis=1)  # index after the last sample off the path
    last_off = np.where(on_path.all(1), 0, last_off)
    since = np.where(last_off < len(time), time[np.minimum(last_off, len(time) - 1)], np.inf)
    returned = since <= time[0] + (1 - _LATE) * (time[-1] - time[0])
    return returned, run.status == "diverged", np.where(returned, since, np.nan)


def _guarantee(controller: Controller, q: Array, qd: Array, found: Reach) -> tuple[Array, NDArray[np.bool_], float]:
    """Return the distances of starts from the path, whether the theorem says that they return, and its ball."""
    task, law = controller.task, unwrap(controller)
    s = task.sigma_bar(q)
    point = task.at(s)
    away = np.linalg.norm(point.q_d - q, axis=-1)
    if not task.closed or not isinstance(law, (*_GLOBAL, Projection)):
        return away, np.zeros(len(q), dtype=bool), np.nan
    if not isinstance(law, Projection):
        return away, np.ones(len(q), dtype=bool), np.inf
    k_p, e_v = float(np.squeeze(law.k_p)), np.linalg.norm(point.velocity - qd, axis=-1)
    room = found.value**2 - e_v**2 / k_p  # V < ½k_p R², solved for ‖e_p‖²
    return away, away**2 < room, float(np.sqrt(max(room.min(), 0.0)))
