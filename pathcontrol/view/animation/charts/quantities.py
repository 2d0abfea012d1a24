"""What is charted over time: errors, rates along the path, and torques beside their limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.limit_shares import RATIOS, limit_shares
from pathcontrol.analysis.readable import in_degrees
from pathcontrol.analysis.tool import feed_along, find_tool, tool_speed
from pathcontrol.analysis.torque_limits import torque_limits
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.animation.charts.chart import Chart, Curve
from pathcontrol.view.animation.drawn_rollout import Shot
from pathcontrol.view.animation.path_error import MILLIMETRE
from pathcontrol.view.animation.rollout import Take

#: title, unit and lines of one run
_Entry: TypeAlias = tuple[str, str, list[Curve]]


def charts(shots: Sequence[Shot]) -> list[Chart]:
    """The charts of some runs; lines of the same quantity in the same unit share one."""
    found: dict[tuple[str, str], list[Curve]] = {}
    several = len(shots) > 1
    makers: tuple[Callable[[Shot, int, bool], list[_Entry]], ...] = (_norms, _error, _rates, _torques, _shares)
    for maker in makers:
        for i, shot in enumerate(shots):
            for title, unit, curves in maker(shot, i, several):
                lines = found.setdefault((title, unit), [])
                lines += [curve for curve in curves if not any(curve.repeats(line) for line in lines)]
    return [Chart(title, unit, curves) for (title, unit), curves in found.items()]


def _norms(shot: Shot, index: int, several: bool) -> list[_Entry]:
    take, entries = shot.take, []
    for name, symbol, words in (("e_p", "‖e_p‖", "position error"), ("e_v", "‖e_v‖", "velocity error")):
        if name in take.run:
            values, unit = in_degrees(take.run.norm(name)[0], take.run.unit(name))
            curve = Curve(take.name if several else symbol, take.time, values, index)
            entries.append((f"{words} {symbol}", unit, [curve]))
    return entries


def _error(shot: Shot, index: int, several: bool) -> list[_Entry]:
    if shot.error is None:
        return []
    label = shot.take.name if several else shot.error.label
    return [(shot.error.label, shot.error.unit, [Curve(label, shot.take.time, shot.error.values, index)])]


def _rates(shot: Shot, index: int, several: bool) -> list[_Entry]:
    """The rate of the path parameter, beside the one that the task asks for there."""
    take = shot.take
    if "sdot" not in take.run:
        return []
    if take.task is not None and "qd" in take.run and find_tool(take.robot, take.task) is not None:
        return _feeds(take, take.task, index, several)
    curves = [Curve(take.name if several else "σ̇", take.time, take.run.array("sdot")[0], index)]
    if take.task is not None:
        theta = np.broadcast_to(take.task.theta(take.s), take.s.shape)
        curves.append(Curve("ϑ(s)", take.time, theta, index, "reference"))
    return [("rate along the path σ̇", "1/s", curves)]


def _feeds(take: Take, task: PathTask, index: int, several: bool) -> list[_Entry]:
    """The speed of the tool on a path that was made for it, beside the one that the plan asks for there."""
    speed = tool_speed(take.run, take.robot, task)[0]
    wanted = feed_along(task, take.robot, take.s)
    curves = [
        Curve(take.name if several else "tool", take.time, MILLIMETRE * speed, index),
        Curve("feed", take.time, MILLIMETRE * wanted, index, "reference"),
    ]
    return [("speed of the tool", "mm/s", curves)]


def _torques(shot: Shot, index: int, several: bool) -> list[_Entry]:
    """Torques in percent of their limits: of each joint, or of several runs the largest; in N m without limits."""
    take = shot.take
    if "tau" not in take.run:
        return []
    tau, joints = take.run.array("tau")[0], take.robot.joint_names
    limits = torque_limits(take.run, take.robot)
    limited = np.flatnonzero(np.isfinite(limits))
    if not len(limited):
        lines = np.abs(tau).max(-1)[:, None] if several else tau
        return [("torque", take.run.unit("tau"), _curves(take, index, several, lines, joints))]
    share = 100 * tau[:, limited] / limits[limited]
    share = np.abs(share).max(-1)[:, None] if several else share
    curves = _curves(take, index, several, share, [joints[j] for j in limited])
    ends, signs = take.time[[0, -1]], (1.0,) if several else (1.0, -1.0)
    curves += [Curve("limit", ends, np.full(2, 100.0 * sign), index, "limit") for sign in signs]
    return [("largest torque / limit" if several else "torque / limit", "%", curves)]


def _shares(shot: Shot, index: int, several: bool) -> list[_Entry]:
    """The largest shares [%] of limits of position and velocity; those of torques have a chart of their own."""
    take = shot.take
    curves: list[Curve] = []
    if "qd" not in take.run:
        return []
    for name, shares in limit_shares(take.run.with_robot(take.robot)).items():
        limited = np.isfinite(shares[0]).any(0)
        if RATIOS[name] != "torque" and limited.any():
            share, label = 100 * shares[0][:, limited].max(-1), RATIOS[name]
            label = f"{take.name}, {label}" if several else label
            curves.append(Curve(label, take.time, share, index, shade=len(curves)))
    if not curves:
        return []
    limit = Curve("limit", take.time[[0, -1]], np.full(2, 100.0), index, "limit")
    return [("position and velocity / limit, largest", "%", [*curves, limit])]


def _curves(take: Take, index: int, several: bool, values: Array, joints: Sequence[str]) -> list[Curve]:
    """A line for each column (k, m), called as the joints are, or as the run if there is only one."""
    if several:
        return [Curve(take.name, take.time, values[:, 0], index)]
    names = short_names(joints)
    return [Curve(name, take.time, values[:, j], index, shade=j) for j, name in enumerate(names)]


def short_names(names: Sequence[str]) -> list[str]:
    """Names without the words that all of them begin or end with: panda_joint1 is joint1; joint_1 is not 1."""
    words = [name.split("_") for name in names]
    if len(names) < 2:
        return list(names)
    for drop, tested in ((slice(1, None), 0), (slice(-1), -1)):
        while len({word[tested] for word in words}) == 1 and all(_says_enough(word[drop]) for word in words):
            words = [word[drop] for word in words]
    return ["_".join(word) for word in words]


def _says_enough(words: Sequence[str]) -> bool:
    return any(word and not word.isdigit() for word in words)
