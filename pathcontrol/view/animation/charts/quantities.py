"""The quantities charted over time: errors, rates along the path, and torques beside their limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pathcontrol.analysis.limit_shares import RATIOS, limit_shares
from pathcontrol.analysis.readable import in_degrees
from pathcontrol.analysis.tool_following import feed_along, find_tool, tool_speed
from pathcontrol.analysis.torque_limits import torque_limits, torque_shares
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.animation.charts.chart import Chart, Curve, Entry
from pathcontrol.view.animation.charts.joint_curves import joint_curves
from pathcontrol.view.animation.charts.observed_torques import observed_torques
from pathcontrol.view.animation.charts.power_curves import power_balance_curves
from pathcontrol.view.animation.drawn_rollout import DrawnRollout
from pathcontrol.view.animation.path_error import MILLIMETRE
from pathcontrol.view.animation.rollout import Recording


def charts(drawn_rollouts: Sequence[DrawnRollout]) -> list[Chart]:
    """Return the charts of some runs; lines of the same quantity in the same unit share one."""
    found: dict[tuple[str, str], list[Curve]] = {}
    several = len(drawn_rollouts) > 1
    makers: tuple[Callable[[DrawnRollout, int, bool], list[Entry]], ...] = (
        _norms,
        _error,
        _rates,
        _torques,
        observed_torques,
        power_balance_curves,
        _shares,
    )
    for maker in makers:
        for i, drawn_rollout in enumerate(drawn_rollouts):
            for title, unit, curves in maker(drawn_rollout, i, several):
                lines = found.setdefault((title, unit), [])
                lines += [curve for curve in curves if not any(curve.repeats(line) for line in lines)]
    return [Chart(title, unit, curves) for (title, unit), curves in found.items()]


def _norms(drawn_rollout: DrawnRollout, index: int, several: bool) -> list[Entry]:
    """Return the norms of the errors of joints."""
    recording, entries = drawn_rollout.recording, []
    for name, symbol, words in (("e_p", "‖e_p‖", "position error"), ("e_v", "‖e_v‖", "velocity error")):
        if name in recording.run:
            values, unit = in_degrees(recording.run.norm(name)[0], recording.run.unit(name))
            curve = Curve(recording.name if several else symbol, recording.time, values, index)
            entries.append((f"{words} {symbol}", unit, [curve]))
    return entries


def _error(drawn_rollout: DrawnRollout, index: int, several: bool) -> list[Entry]:
    """Return the error by which the run is coloured."""
    if drawn_rollout.error is None:
        return []
    label = drawn_rollout.recording.name if several else drawn_rollout.error.label
    return [
        (
            drawn_rollout.error.label,
            drawn_rollout.error.unit,
            [Curve(label, drawn_rollout.recording.time, drawn_rollout.error.values, index)],
        )
    ]


def _rates(drawn_rollout: DrawnRollout, index: int, several: bool) -> list[Entry]:
    """Return the rate of the path parameter, beside the planned one."""
    recording = drawn_rollout.recording
    if "sdot" not in recording.run:
        return []
    if recording.task is not None and "qd" in recording.run and find_tool(recording.robot, recording.task) is not None:
        return _feeds(recording, recording.task, index, several)
    curves = [Curve(recording.name if several else "σ̇", recording.time, recording.run.array("sdot")[0], index)]
    if recording.task is not None:
        theta = np.broadcast_to(recording.task.theta(recording.s), recording.s.shape)
        curves.append(Curve("ϑ(s)", recording.time, theta, index, "reference"))
    return [("rate along the path σ̇", "1/s", curves)]


def _feeds(recording: Recording, task: PathTask, index: int, several: bool) -> list[Entry]:
    """Return the speed of the tool on a path that was made for it, beside the planned one."""
    speed = tool_speed(recording.run, recording.robot, task)[0]
    wanted = feed_along(task, recording.robot, recording.s)
    curves = [
        Curve(recording.name if several else "tool", recording.time, MILLIMETRE * speed, index),
        Curve("feed", recording.time, MILLIMETRE * wanted, index, "reference"),
    ]
    return [("speed of the tool", "mm/s", curves)]


def _torques(drawn_rollout: DrawnRollout, index: int, several: bool) -> list[Entry]:
    """Return torques in percent of their limits, of each joint or of several runs the largest; else in N m."""
    recording = drawn_rollout.recording
    if "tau" not in recording.run:
        return []
    tau, joints = recording.run.array("tau")[0], recording.robot.joint_names
    limits = torque_limits(recording.run, recording.robot)
    limited = np.flatnonzero(np.isfinite(limits).any(0))
    if not len(limited):
        lines = np.abs(tau).max(-1)[:, None] if several else tau
        return [("torque", recording.run.unit("tau"), joint_curves(recording, index, several, lines, joints))]
    share = np.sign(tau[:, limited]) * 100 * torque_shares(tau[:, limited], limits[:, limited])
    share = np.abs(share).max(-1)[:, None] if several else share
    curves = joint_curves(recording, index, several, share, [joints[j] for j in limited])
    ends, signs = recording.time[[0, -1]], (1.0,) if several else (1.0, -1.0)
    curves += [Curve("limit", ends, np.full(2, 100.0 * sign), index, "limit") for sign in signs]
    return [("largest torque / limit" if several else "torque / limit", "%", curves)]


def _shares(drawn_rollout: DrawnRollout, index: int, several: bool) -> list[Entry]:
    """Return the largest shares [%] of limits of position and velocity; torques have a chart of their own."""
    recording = drawn_rollout.recording
    curves: list[Curve] = []
    if "qd" not in recording.run:
        return []
    for name, shares in limit_shares(recording.run.with_robot(recording.robot)).items():
        limited = np.isfinite(shares[0]).any(0)
        if RATIOS[name] != "torque" and limited.any():
            share, label = 100 * shares[0][:, limited].max(-1), RATIOS[name]
            label = f"{recording.name}, {label}" if several else label
            curves.append(Curve(label, recording.time, share, index, shade=len(curves)))
    if not curves:
        return []
    limit = Curve("limit", recording.time[[0, -1]], np.full(2, 100.0), index, "limit")
    return [("position and velocity / limit, largest", "%", [*curves, limit])]
