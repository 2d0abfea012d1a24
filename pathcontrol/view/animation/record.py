"""The recording of runs as a film: arms, desired paths and tool paths, in one HTML file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect_choice
from pathcontrol.view.animation.animation import Animation
from pathcontrol.view.animation.charts.plane import plane
from pathcontrol.view.animation.charts.quantities import charts
from pathcontrol.view.animation.drawn_rollout import DrawnRollout, draw_rollouts
from pathcontrol.view.animation.metric_tables import tables
from pathcontrol.view.animation.payload import Film
from pathcontrol.view.animation.recorded_runs import film_title, make_recordings
from pathcontrol.view.animation.scene.arm_layout import Layout, shifts
from pathcontrol.view.animation.scene.camera import Camera, view_direction
from pathcontrol.view.animation.scene.legend import labels, legend
from pathcontrol.view.animation.scene.scene_builder import Stage
from pathcontrol.view.animation.scene.tool_lines import add_lines, add_markers
from pathcontrol.view.animation.scene.wall_plates import add_plates

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run
    from pathcontrol.tasks.task import PathTask
    from pathcontrol.view.animation.rollout import Recording

MOST_GHOSTS = 6  # with a label each: those of more would hide the arm, and the legend names them anyway


def record(
    run: Run | Mapping[str, Run],
    robot: RobotModel | None = None,
    task: PathTask | None = None,
    *,
    rollout: int = 0,
    layout: Layout = "beside",
    tool: str | None = None,
) -> Animation:
    """Animate one rollout of a run, or of several runs together, without a server, a browser or the network.

    The line that the tool draws is coloured by the contour error, on a toolpath by the distance from the drawing;
    ghosts draw in the colours of their runs. Links are nowhere farther than 5e-5 m from where they were at the samples
    of the run, and the entries of their rotations not more than 5e-5 off.

    Args:
        run: what happened, or several runs by what they are to be called.
        robot: the arm that it happened to; by default the run's own. One for all, if there are several runs.
        task: the path it should have followed, by default the run's own; none is drawn if that is not known.
        rollout: which of the rollouts, counted from 0.
        layout: several arms ``"beside"`` one another, or ``"ghosted"``: in one another, all but the first
            see-through and in the colour of their run.
        tool: the frame whose path is drawn; by default the one that the task was made for, and the tool in it, or else
            the end of the robot's longest limb, such as ``tool`` or ``tool0``.

    Raises:
        InputError: run, robot and task do not belong together, a run does not know its robot and none is given,
            there is no such rollout, or no run at all.
        UnknownNameError: the robot has no frame ``tool``, or there is no such layout.
    """
    expect_choice("layout", layout, get_args(Layout))
    recordings = make_recordings(run, robot, task, rollout, tool)
    film = _make_film(recordings, rollout, layout)
    film.header["tables"] = tables(recordings)
    return Animation(film)


def record_for_page(run: Run | Mapping[str, Run], *, rollout: int = 0, layout: Layout = "beside") -> Animation:
    """Animate runs as :func:`record` does, for a page that has tables of its own: they are not measured for this."""
    expect_choice("layout", layout, get_args(Layout))
    return Animation(_make_film(make_recordings(run, None, None, rollout, None), rollout, layout))


def _make_film(recordings: Sequence[Recording], rollout: int, layout: Layout) -> Film:
    """Return the film of recordings, without tables."""
    drawn_rollouts, film = draw_rollouts(recordings), Film()
    ghosted = layout == "ghosted" and len(recordings) > 1
    film.header = {
        "version": 1,
        "title": film_title(recordings, rollout),
        "duration": max(recording.duration for recording in recordings),
        "runs": [{"name": recording.name, "color": list(recording.color[:3])} for recording in recordings],
        "legend": legend(drawn_rollouts, ghosted),
        **_picture(film, drawn_rollouts, layout, ghosted),
        "charts": [chart.header(film) for chart in charts(drawn_rollouts)],
        "plane": plane(drawn_rollouts).header(film, drawn_rollouts),
        "tables": [],
    }
    return film


def _picture(film: Film, drawn_rollouts: Sequence[DrawnRollout], layout: Layout, ghosted: bool) -> dict[str, Any]:
    """Return everything visible in the scene, and the camera."""
    direction = view_direction(
        _all(drawn_rollout.sight for drawn_rollout in drawn_rollouts),
        _all(drawn_rollout.body for drawn_rollout in drawn_rollouts),
    )
    moved = shifts([drawn_rollout.seen for drawn_rollout in drawn_rollouts], direction, layout)
    whole = _all(drawn_rollout.seen + shift for drawn_rollout, shift in zip(drawn_rollouts, moved, strict=True))
    stage, width = Stage(film), max(drawn_rollout.line_width for drawn_rollout in drawn_rollouts)
    stage.add_ground(whole)
    for i, (drawn_rollout, shift) in enumerate(zip(drawn_rollouts, moved, strict=True)):
        stage.add_arm(i, drawn_rollout.recording, shift, ghost=ghosted and i > 0)
    add_lines(stage, drawn_rollouts, moved, width, ghosted)
    add_markers(stage, drawn_rollouts, moved, width)
    add_plates(stage, drawn_rollouts, moved, ghosted)
    labelled = 1 < len(drawn_rollouts) <= (MOST_GHOSTS if ghosted else len(drawn_rollouts))
    names = labels(drawn_rollouts, ghosted) if labelled else []
    above = [shift + name["offset"] for shift, name in zip(moved, names, strict=False)]
    camera = Camera.framing(np.concatenate([whole, *np.reshape(above, (-1, 1, 3))]), direction)
    near = Camera.framing(
        _all(drawn_rollout.sight + shift for drawn_rollout, shift in zip(drawn_rollouts, moved, strict=True)), direction
    )
    return stage.header() | {"camera": camera.seen_from_near(near, width), "labels": names}


def _all(parts: Iterable[Array]) -> Array:
    """Return all points of several parts."""
    return np.concatenate(list(parts))
