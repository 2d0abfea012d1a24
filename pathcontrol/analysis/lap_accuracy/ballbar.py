"""The radial error of an arm that goes round a circle, as a telescoping ballbar measures it on a machine tool."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, check_whole
from pathcontrol.analysis.compared_space import ComparedSpace
from pathcontrol.analysis.lap_accuracy.path_accuracy import choose_path, count_along
from pathcontrol.analysis.metric_helpers import resolve_task
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

_POINTS = 720  # of the path, through which the circle is laid
_ROUND = 1e-3  # of the radius: how far a path may be from its circle


class _Fit(NamedTuple):
    """A circle in d coordinates: its centre (d,), two unit vectors of its plane (2, d), and its radius."""

    centre: Array
    plane: Array
    radius: float


class Ballbar(NamedTuple):
    """The radial error round a circle, at K samples.

    Attributes:
        angle: place on the circle [rad], from its beginning in the direction of the path, counting laps, (K,).
        error: distance from the centre less the radius [m or rad], (K,).
        radius: the radius [m or rad].
        reversal: the angles [rad] at which a joint turns back, (r,).
        reversing: the joint that does, (r,).
        unit: ``"m"`` or ``"rad"``.
    """

    angle: Array
    error: Array
    radius: float
    reversal: Array
    reversing: NDArray[np.intp]
    unit: str


def ballbar(
    run: Run, task: PathTask | None = None, *, frame: str | None = None, skip: int = 1, rollout: int = 0
) -> Ballbar:
    """Return the radial error of a run round a circle.

    Args:
        run: the run.
        task: the path; by default the run's own.
        frame: the frame of the arm that goes round; by default the tool that the path was made for, and without one the
            positions of the joints, as in the paper.
        skip: laps at the beginning that do not count.
        rollout: which rollout.

    Raises:
        InputError: the path is no circle there, the run has no lap after those, or it does not know its arm.
    """
    path, skip = choose_path(resolve_task(run, task), rollout), check_whole("skip", skip, 0)
    space, one = ComparedSpace.of(run, path, frame), run.rollout(rollout)
    circle = _find_circle(path, space)
    along = count_along(one, path)
    assert path.period is not None
    laps = (along - along[0]) / path.period
    if laps.max() < skip + 1:
        raise InputError(
            f"the run has {laps.max():.2f} laps, expected one whole lap after the first {skip}",
            argument="skip",
            value=skip,
            limit=float(laps.max()),
        )
    counted = np.flatnonzero((laps >= skip) & (laps <= int(laps.max())))
    q, qd = one.array("q")[0, counted], one.array("qd")[0, counted]
    x = (space.move(q, qd)[0] - circle.centre) @ circle.plane.T
    angle = np.unwrap(np.arctan2(x[:, 1], x[:, 0]))
    before, joint = _find_reversals(qd)
    return Ballbar(angle, np.hypot(*x.T) - circle.radius, circle.radius, angle[before], joint, space.unit)


def _find_circle(path: PathTask, space: ComparedSpace) -> _Fit:
    """Return the circle on which a closed path moves.

    Its centre c solves 2x·c + (r² − ‖c‖²) = ‖x‖² for all points x of the path, in the plane of the two directions in
    which they spread most (Kåsa, IEEE Transactions on Instrumentation and Measurement 25, 1976).
    """
    kind = type(path).__name__
    if path.period is None:
        raise InputError(f"{kind} is no closed path, expected a circle", value=kind)
    s = path.s0 + path.period * np.arange(_POINTS) / _POINTS
    x, v, _ = space.move(path.q_d(s), path.dq_d(s))
    middle = x.mean(0)
    plane = np.linalg.svd(x - middle, full_matrices=False)[2][:2]
    flat = (x - middle) @ plane.T
    a, b, constant = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(s))]), (flat**2).sum(1), rcond=None)[0]
    radius, centre = float(np.sqrt(constant + a**2 + b**2)), middle + np.array([a, b]) @ plane
    if np.abs(np.linalg.norm(x - centre, axis=-1) - radius).max() > _ROUND * radius:
        raise InputError(
            f"{kind} is no circle in {'the joints' if space.tool is None else space.tool.frame!r}", value=kind
        )
    first = (x[0] - centre) / np.linalg.norm(x[0] - centre)
    across = v[0] - (v[0] @ first) * first
    return _Fit(centre, np.stack([first, across / np.linalg.norm(across)]), radius)


def _find_reversals(qd: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the samples at which joints turn back, and the joints, (r,) each; where one rests before, half way."""
    found = []
    for joint, speed in enumerate(qd.T):
        moving = np.flatnonzero(speed)
        turns = np.diff(np.sign(speed[moving])) != 0
        found += [(int(k), joint) for k in (moving[:-1][turns] + moving[1:][turns] + 1) // 2]
    samples, joints = np.array(sorted(found), dtype=np.intp).reshape(-1, 2).T
    return samples, joints
