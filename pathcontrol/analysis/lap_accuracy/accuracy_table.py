"""Accuracy and repeatability of runs in words, where their paths have cycles that can be compared."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.lap_accuracy.path_accuracy import PathAccuracy, accuracy
from pathcontrol.analysis.readable import readable_number
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run


def find_accuracy(run: Run) -> PathAccuracy | None:
    """Return the accuracy of a run after its first lap; ``None`` where it has no cycle, or lacks what is compared."""
    try:
        return accuracy(run) if all(name in run for name in ("q", "qd", "s")) else None
    except InputError:
        return None


def accuracy_table(run: Run) -> list[list[str]]:
    """Return the criteria of a run as rows of texts for a reader, heads first; empty where there are none."""
    found = find_accuracy(run)
    if found is None:
        return []
    speed = f"{found.unit}/s"
    rows = [
        ("path accuracy AT", readable_number(found.path_accuracy, found.unit)),
        ("path repeatability RT", readable_number(found.path_repeatability, found.unit)),
        ("velocity accuracy AV", _percent(found.velocity_accuracy)),
        ("velocity repeatability RV", _percent(found.velocity_repeatability)),
        ("velocity fluctuation FV", readable_number(found.velocity_fluctuation, speed)),
    ]
    if found.rotation is not None:
        rows += [
            ("orientation accuracy, about x, y, z", _angles(found.orientation_accuracy)),
            ("orientation repeatability, about x, y, z", _angles(found.orientation_repeatability)),
        ]
    if found.corners:
        many = f"{len(found.corners)} corner{'s' if len(found.corners) > 1 else ''}"
        rows += [
            (f"cornering round-off, largest of {many}", readable_number(found.cornering_round_off, found.unit)),
            (f"cornering overshoot, largest of {many}", readable_number(found.cornering_overshoot, found.unit)),
        ]
    cycles = f"{found.cycles} cycle{'s' if found.cycles > 1 else ''}, {len(found.s)} sections"
    return [["criterion", cycles], *map(list, rows)]


def _percent(share: float) -> str:
    """Return a share in per cent."""
    return "–" if np.isnan(share) else f"{100 * share:.3g} %"


def _angles(values: Array) -> str:
    """Return angles about three axes as a text."""
    return ", ".join(readable_number(float(value), "rad") for value in values)
