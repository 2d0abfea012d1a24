"""The charts of what an observer sees, for laws that have one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pathcontrol.analysis.disturbance_estimate import momentum_observer
from pathcontrol.analysis.observing_laws import compensates_observed, halts_at_contacts
from pathcontrol.control.base import KnownFriction
from pathcontrol.simulation.run import Run
from pathcontrol.view.animation.charts.chart import Entry
from pathcontrol.view.animation.charts.joint_curves import joint_curves
from pathcontrol.view.animation.drawn_rollout import DrawnRollout


def observed_torques(drawn_rollout: DrawnRollout, index: int, several: bool) -> list[Entry]:
    """Return the estimate of :func:`momentum_observer` of each joint, or of several runs the largest; of an observer.

    A law that compensates what it observes has to do with all that acts beside the motors, a law that halts at contacts
    with what friction does not explain.
    """
    recording = drawn_rollout.recording
    run = recording.run.with_robot(recording.robot)
    if not all(name in run for name in ("q", "qd", "tau")) or not run.model.has_mass:
        return []
    entries = []
    for title, friction in _list_estimates(run):
        seen = momentum_observer(run, friction=friction)[0]
        lines = np.abs(seen).max(-1)[:, None] if several else seen
        curves = joint_curves(recording, index, several, lines, recording.robot.joint_names)
        entries.append((f"{title}, largest" if several else title, run.unit("tau"), curves))
    return entries


def _list_estimates(run: Run) -> Iterator[tuple[str, KnownFriction]]:
    """Yield the title of each chart, and what of friction is known to its estimate."""
    if compensates_observed(run):
        yield "torque beside the motors, estimated", "none"
    if halts_at_contacts(run):
        yield "torque beside motors and friction, estimated", "full"
