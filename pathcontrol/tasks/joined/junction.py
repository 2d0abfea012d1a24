"""The junction of two paths: whether they meet there, and whether smoothly."""

from __future__ import annotations

import numpy as np

from pathcontrol.geometry.arc_length import curvature_vector
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.task import PathTask

_SAME = 1e-6  # rad; without unit for directions and speeds, 1/rad for curvatures


def gap(before: PathTask, after: PathTask) -> float:
    """Return the distance [rad] from the end of one path to the beginning of the next; 0 if it is negligible."""
    distance = float(np.linalg.norm(_start(after).q_d - _end(before).q_d))
    return distance if distance > _SAME else 0.0


def explain_gap(before: PathTask, after: PathTask) -> str:
    """Explain a gap between two paths: the joint with the largest, its positions, and what may help."""
    here, there = _end(before).q_d, _start(after).q_d
    j = int(np.argmax(np.abs(there - here)))
    apart = f"joint {j} ends at {here[j]:.9g} and begins at {there[j]:.9g} rad, {abs(there[j] - here[j]):.3g} rad apart"
    for turned, p, q in (("the second", here, _end(after).q_d), ("the first", _start(before).q_d, there)):
        if np.linalg.norm(q - p) <= _SAME:
            return f"{apart}; they meet if {turned} is reversed()"
    return f"{apart}; correct the paths, or bridge the gap with blend={np.linalg.norm(there - here):.2g} or more"


def explain_jump(before: PathTask, after: PathTask) -> str | None:
    """Explain what jumps where two paths meet: direction, curvature or speed; ``None`` if nothing does."""
    ends = _end(before), _start(after)
    lengths = [np.linalg.norm(p.dq_d) for p in ends]
    tangents = [p.dq_d / length for p, length in zip(ends, lengths, strict=True)]
    if (j := _jump(*tangents)) is not None:
        angle = np.degrees(np.arccos(np.clip(tangents[0] @ tangents[1], -1, 1)))
        return f"the direction turns by {angle:.3g}°, most in joint {j}; give a blend [rad]"
    bends = [p.ddq_d / length**2 for p, length in zip(ends, lengths, strict=True)]
    if (j := _jump(*bends)) is not None:
        if _jump(*[curvature_vector(p.dq_d, p.ddq_d) for p in ends]) is None:
            return "q_d'' jumps along the path, but the curvature does not; take by_arc_length() of both"
        return f"the curvature of joint {j} jumps from {bends[0][j]:.3g} to {bends[1][j]:.3g} 1/rad; give a blend [rad]"
    speeds = [p.theta * length for p, length in zip(ends, lengths, strict=True)]
    if abs(speeds[1] - speeds[0]) > _SAME * max(speeds):
        return (
            f"the path speed jumps from {speeds[0]:.3g} to {speeds[1]:.3g} rad/s; give a blend [rad], or one profile "
            "to all of them, with_profile(ConstantSpeed(…))"
        )
    return None


def _jump(a: np.ndarray, b: np.ndarray) -> int | None:
    """Return the joint in which two vectors differ most, ``None`` if they do not."""
    difference = np.abs(b - a)
    scale = 1 + max(np.abs(a).max(), np.abs(b).max())
    return int(np.argmax(difference)) if difference.max() > _SAME * scale else None


def _start(path: PathTask) -> PathPoint:
    """Return the first point of a path."""
    return path.at(np.asarray(path.s0))


def _end(path: PathTask) -> PathPoint:
    """Return the last point of a path."""
    return path.at(np.asarray(path.s_end))
