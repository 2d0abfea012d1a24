"""Accuracy and repeatability along a path, in planes normal to it, by the criteria for paths of ISO 9283.

An arm goes along its path in n cycles, and is compared with the commanded path at m sections. In the plane normal to
the path at section i, cycle j passes through x_ij at the speed v_ij; the path passes through c_i, at v_ci. With the
mean x̄_i over the cycles and the distances l_ij = ‖x_ij − x̄_i‖ from it,

    path accuracy        AT = max_i ‖x̄_i − c_i‖
    path repeatability   RT = max_i (l̄_i + 3 S_i),   S_i the standard deviation of l_ij over j,

and the same for the orientation, axis by axis. With the deviations d_ij = v_ij − v_ci of the speed, and the mean speed
v̄_j of a cycle,

    velocity accuracy       AV = mean(d) / mean(v_c)
    velocity repeatability  RV = 3 S_v / mean(v_c),   S_v the standard deviation of v̄_j
    velocity fluctuation    FV = max_j (max_i d_ij − min_i d_ij),


which are the standard's where the commanded speed is the same everywhere. Standard deviations are divided by n − 1.
Where the path stands for a polyline, round-off and overshoot at its corners are measured (:mod:`.cornering`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, check_whole
from pathcontrol._json import to_json
from pathcontrol.analysis.compared_space import ComparedSpace
from pathcontrol.analysis.crossings import Crossings, Motion, find_crossings
from pathcontrol.analysis.lap_accuracy.cornering import Corner, find_corners, measure_corner, place_corners
from pathcontrol.analysis.metric_helpers import is_along, resolve_task
from pathcontrol.analysis.window import own_samples
from pathcontrol.errors import InputError
from pathcontrol.robot.rotations import rotation_vectors_of
from pathcontrol.simulation.log_arrays import follow_path
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

_FEWEST = 10  # sections, as the standard asks for
_SAMPLES = 4  # of a cycle at least, for cubics between them
_BACKWARDS = 0.5  # laps, beyond which an arm goes round the other way
_SCALARS = (
    "path_accuracy",
    "path_repeatability",
    "velocity_accuracy",
    "velocity_repeatability",
    "velocity_fluctuation",
)
_AT_CORNERS = ("cornering_round_off", "cornering_overshoot")
_VECTORS = ("orientation_accuracy", "orientation_repeatability")


@dataclass(frozen=True, eq=False)
class PathAccuracy:
    """The accuracy and repeatability of an arm along a path: n cycles at m sections, in d coordinates.

    Attributes:
        s: the sections, (m,).
        commanded: the path there [m], or [rad] in the space of joints, (m, d).
        attained: where the cycles cross the normal planes, (n, m, d).
        commanded_speed: speed of the path there [m/s or rad/s], (m,).
        speed: speeds of the cycles there, (n, m).
        rotation: rotation vectors [rad] from the commanded orientation to that of each cycle, in the axes of the
            commanded one, (n, m, 3); None in the space of joints.
        unit: ``"m"`` or ``"rad"``.
        corners: the corners of the polyline that the path stands for.
        round_off: the least distance of the mean of all cycles from each corner, (k,); NaN where none passes it.
        overshoot: the largest distance of it from the leg after each corner, beyond the corner, (k,).
    """

    s: Array
    commanded: Array
    attained: Array
    commanded_speed: Array
    speed: Array
    rotation: Array | None
    unit: str
    corners: tuple[Corner, ...] = ()
    round_off: Array = field(default_factory=lambda: np.zeros(0))
    overshoot: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def cycles(self) -> int:
        """The number of cycles."""
        return len(self.attained)

    @property
    def path_accuracy(self) -> float:
        """AT: the largest distance of the mean of all cycles from the path."""
        return float(np.linalg.norm(self.attained.mean(0) - self.commanded, axis=-1).max())

    @property
    def path_repeatability(self) -> float:
        """RT: the largest mean distance of the cycles from their mean, and three deviations; NaN of one cycle."""
        distance = np.linalg.norm(self.attained - self.attained.mean(0), axis=-1)
        return float((distance.mean(0) + 3 * _deviation(distance)).max())

    @property
    def orientation_accuracy(self) -> Array:
        """The largest mean rotation [rad] about each axis of the tool, (3,); NaN in the space of joints."""
        return np.full(3, np.nan) if self.rotation is None else np.abs(self.rotation.mean(0)).max(0)

    @property
    def orientation_repeatability(self) -> Array:
        """The largest three standard deviations of the rotation [rad] about each axis, (3,); NaN of one cycle."""
        return np.full(3, np.nan) if self.rotation is None else 3 * _deviation(self.rotation).max(0)

    @property
    def velocity_accuracy(self) -> float:
        """AV: the mean deviation of the speed, as a share of the commanded one."""
        return float((self.speed - self.commanded_speed).mean() / self.commanded_speed.mean())

    @property
    def velocity_repeatability(self) -> float:
        """RV: three standard deviations of the cycles' mean speeds, as a share of the commanded; NaN of one cycle."""
        return float(3 * _deviation(self.speed.mean(1)) / self.commanded_speed.mean())

    @property
    def velocity_fluctuation(self) -> float:
        """FV [m/s or rad/s]: the largest difference between deviations of the speed in one cycle."""
        return float(np.ptp(self.speed - self.commanded_speed, axis=1).max())

    @property
    def cornering_round_off(self) -> float:
        """The largest round-off of all corners; NaN without any."""
        return _largest(self.round_off)

    @property
    def cornering_overshoot(self) -> float:
        """The largest overshoot at all corners; NaN without any."""
        return _largest(self.overshoot)

    @property
    def notes(self) -> list[str]:
        """The reasons why criteria are missing, in sentences."""
        return ["one cycle says nothing of repeatability; go round more often"] if self.cycles == 1 else []

    def to_dict(self) -> dict[str, Any]:
        """Return all criteria by their names, in SI units, as JSON takes them: what is unknown is ``None``."""
        scalars = {name: to_json(getattr(self, name)) for name in _SCALARS}
        vectors = {name: to_json(getattr(self, name)) for name in _VECTORS if self.rotation is not None}
        counts = {"cycles": self.cycles, "sections": len(self.s), "unit": self.unit}
        bends = {name: to_json(getattr(self, name)) for name in _AT_CORNERS} | {"corners": self._list_corners()}
        return counts | scalars | vectors | bends | {"notes": self.notes}

    def _list_corners(self) -> list[dict[str, Any]]:
        """Return point, turn [rad], round-off and overshoot of each corner, as JSON takes them."""
        numbers = zip(self.corners, self.round_off, self.overshoot, strict=True)
        return [
            {"point": one.point.tolist(), "turn": one.turn, "round_off": to_json(near), "overshoot": to_json(far)}
            for one, near, far in numbers
        ]


def accuracy(
    run: Run,
    task: PathTask | None = None,
    *,
    frame: str | None = None,
    sections: int = 200,
    skip: int = 1,
    rollout: int = 0,
    polyline: ArrayLike | None = None,
) -> PathAccuracy:
    """Return accuracy and repeatability of a run, or of the log of an arm, in planes normal to its path.

    The cycles are the whole laps of a closed path, and the rollouts of an open one. They are compared with the path
    where they cross the planes and not at equal times: being late on the path is no error of the path.

    Args:
        run: the run.
        task: the path; by default the run's own.
        frame: the frame of the arm that is compared with itself on the path; by default the tool that the path was made
            for, and without one the positions of the joints.
        sections: number of planes, evenly spread over s, 10 at least.
        skip: laps at the beginning of a closed path that do not count.
        rollout: the rollout that goes round a closed path.
        polyline: points of the polyline that the path stands for, (k, d) [m or rad], whose corners are measured; on a
            closed path the first is not repeated. By default :attr:`PathTask.polyline`, that of a
            :class:`WaypointPath` or of :meth:`ToolCurve.polyline`, and the straight parts of the contours of a
            :class:`ToolpathTask`. Corners turn by 45° or more.

    Raises:
        InputError: no cycle crosses the planes, the path moves nothing there, each rollout has a path of its own, or
            the run does not know its arm.
    """
    sections, skip = check_whole("sections", sections, _FEWEST), check_whole("skip", skip, 0)
    path = choose_path(resolve_task(run, task), rollout)
    space, places = ComparedSpace.of(run, path, frame), (np.arange(sections) + 0.5) / sections
    if path.period is None:
        s = path.s0 + places * (path.s_end - path.s0)
        parts = [(one, count_along(one, path), s) for one in map(run.rollout, range(run.rollouts))]
    else:
        one = run.rollout(rollout)
        along = count_along(one, path)
        s = along[0] + places * path.period
        laps = int((along.max() - along[0]) / path.period + 1e-9)
        parts = [(one, along, s + lap * path.period) for lap in range(skip, laps)]
    planes = _Planes.of(path, space, s)
    found = [_measure(one, along, path, space, planes, at) for one, along, at in parts]
    cycles, crossed = _select(found, path.period is None)
    if crossed.sum() < _FEWEST:
        what = "rollout" if path.period is None else f"lap after the first {skip}"
        raise InputError(
            f"no {what} crosses the {sections} sections of the path; give a longer run, or a smaller skip",
            argument="skip",
            value=skip,
        )
    x, speed = (np.stack(part)[:, crossed] for part in ([one.x for one in cycles], [one.speed for one in cycles]))
    rotation = None if space.tool is None else np.stack([one.rotation for one in cycles])[:, crossed]
    corners = find_corners(path, space, polyline)
    bends = _measure_corners(cycles, corners, path, space)
    return PathAccuracy(
        s[crossed],
        planes.centre[crossed],
        x,
        planes.speed[crossed],
        speed,
        rotation,
        space.unit,
        tuple(corners),
        *bends,
    )


class _Planes(NamedTuple):
    """The planes normal to a path: their points and unit tangents (m, d), speeds (m,) and rotations (m, 3, 3)."""

    centre: Array
    tangent: Array
    speed: Array
    rotation: Array | None

    @classmethod
    def of(cls, path: PathTask, space: ComparedSpace, s: Array) -> _Planes:
        """Return the planes at s."""
        point = path.at(s)
        centre, slope, rotation = space.move(point.q_d, point.dq_d)
        length = np.linalg.norm(slope, axis=-1)
        if not (length > 1e-9 * np.ptp(centre, axis=0).max()).all():
            raise InputError(
                f"the path does not move there at s = {s[length.argmin()]:.4g}, so it has no normal plane",
                s=float(s[length.argmin()]),
            )
        return cls(centre, slope / length[:, None], length * point.theta, rotation)


class _Cycle(NamedTuple):
    """A cycle at the sections: positions (m, d), speeds (m,) and rotation vectors (m, 3); NaN where not crossed.

    ``first`` is its first section, counting laps, and ``motion`` all of it, or None of one too short.
    """

    x: Array
    speed: Array
    rotation: Array
    first: float
    motion: Motion | None = None

    @property
    def crossed(self) -> NDArray[np.bool_]:
        """The mask of the sections that it crosses, (m,)."""
        return np.isfinite(self.speed)


def choose_path(task: PathTask, rollout: int) -> PathTask:
    """Return the one path of all cycles.

    Raises:
        InputError: rollouts have open paths of their own, or the path goes on for ever without repeating.
    """
    path = task.tasks[rollout] if isinstance(task, TaskBatch) else task
    if isinstance(task, TaskBatch) and path.period is None:
        raise InputError(
            "each rollout has an open path of its own; accuracy needs rollouts along one path",
            argument="task",
            value=task,
        )
    if path.period is None and not np.isfinite(path.s_end):
        raise InputError(
            f"{type(path).__name__} neither ends nor repeats, so it has no cycles", argument="task", value=path
        )
    return path


def count_along(one: Run, path: PathTask) -> Array:
    """Return s of a rollout, its own samples only until it diverged, counting laps.

    The run's own s, or along another path than that of the run σ̄ of its positions.

    Raises:
        InputError: no position is known, or it goes round a closed path backwards.
    """
    own = own_samples(one)[0]
    s, q = one.array("s")[0, :own], one.array("q")[0, :own]
    known: NDArray[np.bool_] = np.isfinite(s)
    if not known.any() or not is_along(one.task, path, s[known]):
        known = np.all(np.isfinite(q), axis=-1)
        s = follow_path(path, q[: own if known.all() else known.argmin()])
    else:
        s = s if known.all() else s[: known.argmin()]
    if not len(s):
        raise InputError("the rollout has no sample with a position, so it has no cycles")
    if path.period is None:
        return s
    s = np.unwrap(s, period=path.period)
    if (back := float(s[0] - s[-1]) / path.period) > _BACKWARDS:
        raise InputError(
            f"the run goes {back:.2f} laps against the direction of the path; give the path the other way round",
            value=back,
            limit=_BACKWARDS,
        )
    return s


def _measure(one: Run, along: Array, path: PathTask, space: ComparedSpace, planes: _Planes, s: Array) -> _Cycle:
    """Return where a rollout, at ``along`` of the path at its samples, crosses the planes at s, both counting laps."""
    known = slice(0, len(along))
    time, q, qd = one.time[known], one.array("q")[0, known], one.array("qd")[0, known]
    span = path.s_end - path.s0 if path.period is None else path.period
    near = np.flatnonzero((along > s[0] - span / 2) & (along < s[-1] + span / 2))
    m = len(s)
    found = _Cycle(np.full(planes.centre.shape, np.nan), np.full(m, np.nan), np.full((m, 3), np.nan), float(s[0]))
    if len(near) < _SAMPLES:
        return found
    part = slice(near[0], near[-1] + 1)
    x, v, _ = space.move(q[part], qd[part])
    motion = Motion(time[part], along[part], x, v)
    crossings = find_crossings(motion, s, planes.centre, planes.tangent, span)
    there = np.isfinite(crossings.share)
    crossings = Crossings(crossings.before[there], crossings.share[there])
    x, v, rotation = space.move(crossings.of(time[part], q[part], qd[part]), crossings.between(time[part], qd[part]))
    found.x[there], found.speed[there] = x, np.linalg.norm(v, axis=-1)
    if rotation is not None and planes.rotation is not None:
        found.rotation[there] = rotation_vectors_of(planes.rotation[there].swapaxes(-1, -2) @ rotation)
    return found._replace(motion=motion)


def _measure_corners(
    cycles: list[_Cycle], corners: list[Corner], path: PathTask, space: ComparedSpace
) -> tuple[Array, Array]:
    """Return round-off and overshoot at each corner, (k,) each."""
    motions, first = zip(*((one.motion, one.first) for one in cycles if one.motion is not None), strict=True)
    found = np.full((2, len(corners)), np.nan)
    for i, at in enumerate(place_corners(corners, path, space) if corners else []):
        if path.period is None:
            s, span = np.full(len(first), at), path.s_end - path.s0
        else:
            span = path.period
            s = at + span * np.ceil((np.array(first) - at) / span)
        found[:, i] = measure_corner(motions, corners[i], s, span)
    return found[0], found[1]


def _select(found: list[_Cycle], opens: bool) -> tuple[list[_Cycle], NDArray[np.bool_]]:
    """Return the cycles that count, and the sections at which they are compared, (m,).

    A lap counts where it crosses all sections. A rollout of an open path, which may start and end beside it, counts
    where it crosses most of them, and all are compared where all of these cross.
    """
    cycles = [one for one in found if (one.crossed.mean() > 0.5 if opens else one.crossed.all())]
    if not cycles:
        return [], np.zeros(1, dtype=bool)
    return cycles, np.all([one.crossed for one in cycles], axis=0)


def _deviation(values: Array) -> Array:
    """Return the standard deviation over the cycles, which come first; NaN of one."""
    return np.full(values.shape[1:], np.nan) if len(values) == 1 else np.std(values, axis=0, ddof=1)


def _largest(values: Array) -> float:
    """Return the largest of some values; NaN without any that is known."""
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else np.nan
