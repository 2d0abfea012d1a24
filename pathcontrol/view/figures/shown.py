"""The runs of a figure: one run, or several by their names, each with a colour of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.readable import in_degrees
from pathcontrol.analysis.window import own_samples
from pathcontrol.cartesian.recognition import as_toolpath
from pathcontrol.errors import InputError, TaskError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import select_rows
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.figures.lettering import plain
from pathcontrol.view.figures.lines import drawable
from pathcontrol.view.figures.style import RUN_COLOURS

#: one run, or several by the names they have in the legend
Runs = Run | Mapping[str, Run]

_DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1, 1.5, 1)))
_SAMPLES = 2881  # samples of a path, at least
_MOST_KNOTS = 100_000


class Shown(NamedTuple):
    """A run in a figure.

    Attributes:
        name: its name; empty for a run on its own.
        run: the run, of one rollout unless all are shown.
        task: the path it should have followed, or ``None``.
        colour: of its lines.
        dashes: line style; solid until the colours are used up.
    """

    name: str
    run: Run
    task: PathTask | None
    colour: str
    dashes: Any

    @property
    def label(self) -> str:
        """The name in the form that Matplotlib draws letter for letter."""
        return plain(self.name)

    @property
    def look(self) -> dict[str, Any]:
        """The keyword arguments of its lines."""
        return {"color": self.colour, "linestyle": self.dashes}

    @property
    def joints(self) -> list[str]:
        """The names of the joints."""
        return self.run.joints


def shown(run: Runs, task: PathTask | None = None, rollout: int | None = None) -> list[Shown]:
    """Return the runs of a figure in their order, each with its colour; ``task`` is by default each run's own.

    Raises:
        InputError: there is no run, there is no such rollout, or the task is for another number of joints.
    """
    named = run if isinstance(run, Mapping) else {"": run}
    if not named or not all(isinstance(one, Run) for one in named.values()):
        if not isinstance(run, Mapping):
            expect("run", run, Run)
        raise InputError(
            f"run = {run!r:.80}, expected a Run, or some by their names, as {{'path control': run}}",
            argument="run",
            value=run,
        )
    several = isinstance(run, Mapping)
    if task is not None:
        expect("task", task, PathTask)
    if rollout is not None and task is not None:
        task = select_rows(task, np.array([rollout]))
    chosen = {name: one if rollout is None else _cut_at_finish(one, rollout) for name, one in named.items()}
    return [
        Shown(
            str(name) if several else "",
            one,
            _find_fitting_task(one, task),
            RUN_COLOURS[i % len(RUN_COLOURS)],
            _DASHES[i // len(RUN_COLOURS) % len(_DASHES)],
        )
        for i, (name, one) in enumerate(chosen.items())
    ]


def _cut_at_finish(run: Run, rollout: int) -> Run:
    """Return a rollout until it finished, without the time in which it is held while others go on."""
    part = run.rollout(rollout)
    if run.rollouts == 1 or part.status[0] != "finished":
        return part
    return part.excerpt(np.arange(1), int(own_samples(part)[0]))


def check_joints(runs: Sequence[Shown]) -> list[str]:
    """Return the names of the joints that all the runs have.

    Raises:
        InputError: the runs are of different joints.
    """
    first = runs[0]
    for one in runs:
        if one.joints != first.joints:
            raise InputError(
                f"the runs are of different joints: {', '.join(first.joints)}; {', '.join(one.joints)}",
                argument="run",
                value=list(one.joints),
            )
    return first.joints


def own_robot(run: Run) -> RobotModel | None:
    """Return the robot of a run, where it knows it."""
    try:
        return run.robot
    except InputError:
        return None


def cutting(one: Shown) -> NDArray[np.bool_]:
    """Return where the arm follows no rapid of a toolpath, (time,)."""
    toolpath = as_toolpath(one.task) if "path_index" in one.run else None
    if toolpath is None:
        return np.ones(len(one.run.time), dtype=bool)
    return ~np.array([contour.rapid for contour in toolpath.contours])[one.run.array("path_index")]


def path_parameters(one: Shown) -> Array:
    """Return parameters s (k,) that show the whole path, or the used part of one without end."""
    assert one.task is not None
    try:
        lower, upper = one.task.one_traverse
    except TaskError:
        used = one.run.array("s")
        used = used[np.isfinite(used)]
        lower, upper = (used.min(), used.max()) if len(used) else one.task.sampled_interval
    knots = one.task.starts if isinstance(one.task, PathSequence) else one.task.knots
    inside = [] if knots is None or len(knots) > _MOST_KNOTS else [knots[(knots > lower) & (knots < upper)]]
    return np.unique(np.concatenate([np.linspace(lower, upper, _SAMPLES), *inside]))


def readable(run: Run, name: str, joint: int | None = None) -> tuple[Array, str]:
    """Return a variable (rollout, time, joint), or of one joint (rollout, time), in a reader's unit, and the unit.

    Degrees for angles; sliding joints stay in metres, and so does all of an arm that has both.
    """
    values, unit = run.array(name), run.unit(name)
    if joint is not None:
        values, unit = values[..., joint], _unit_of_joint(run, unit, joint)
    return in_degrees(drawable(values), unit)


def readable_like(values: Array, unit: str) -> Array:
    """Return ``values`` in SI units, in the ``unit`` that :func:`readable` gave."""
    return np.rad2deg(drawable(values)) if unit.startswith("deg") else drawable(values)


def _unit_of_joint(run: Run, unit: str, joint: int) -> str:
    """Return the unit of one joint of an arm with turning and sliding joints, where it is known."""
    robot = own_robot(run) if " or " in unit else None
    if robot is None or robot.n != len(run.joints):
        return unit
    return unit.split(" or ")[0 if robot.position_units[joint] == "rad" else 1]


def _find_fitting_task(run: Run, task: PathTask | None) -> PathTask | None:
    """Return the task if it fits the run."""
    task = run.task if task is None else task
    if task is not None and task.n != len(run.joints):
        raise InputError(
            f"the task is for {task.n} joints, the run has {len(run.joints)}",
            argument="task",
            value=task.n,
            limit=len(run.joints),
        )
    return task
