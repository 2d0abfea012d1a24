"""Lines of a chart for the joints of a run, by names that say no more than needed."""

from __future__ import annotations

from collections.abc import Sequence

from pathcontrol._arrays import Array
from pathcontrol.view.animation.charts.chart import Curve
from pathcontrol.view.animation.rollout import Recording


def joint_curves(recording: Recording, index: int, several: bool, values: Array, joints: Sequence[str]) -> list[Curve]:
    """Return a line for each column (k, m), named after the joints, or after the run if there is only one."""
    if several:
        return [Curve(recording.name, recording.time, values[:, 0], index)]
    names = short_names(joints)
    return [Curve(name, recording.time, values[:, j], index, shade=j) for j, name in enumerate(names)]


def short_names(names: Sequence[str]) -> list[str]:
    """Return names without the words that all of them begin or end with: panda_joint1 is joint1; joint_1 is not 1."""
    words = [name.split("_") for name in names]
    if len(names) < 2:
        return list(names)
    for drop, tested in ((slice(1, None), 0), (slice(-1), -1)):
        while len({word[tested] for word in words}) == 1 and all(_says_enough(word[drop]) for word in words):
            words = [word[drop] for word in words]
    return ["_".join(word) for word in words]


def _says_enough(words: Sequence[str]) -> bool:
    """Return whether shortened names are still names."""
    return any(word and not word.isdigit() for word in words)
