"""The limits that bind along a path, and the errors about limits that cannot be kept."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.profiles.topp.cell_constraints import Cells, static_shares
from pathcontrol.profiles.topp.dynamics import Samples, Torques
from pathcontrol.profiles.topp.joint_limits import JointLimits


class Binding(NamedTuple):
    """The limit that is used most at each knot: its kind, its joint and the share used, each (N + 1,)."""

    kinds: Array
    joints: Array
    shares: Array


def find_binding(limits: JointLimits, samples: Samples, cells: Cells, x: Array) -> Binding:
    """Return the most used limit at each knot, on either side of it, for ṡ² = x (N + 1,)."""
    used, m = cells.used(x), len(limits.rows)
    knots = np.full((len(x), m + len(limits.velocity)), -np.inf)
    knots[:-1, :m] = used[:, :m]
    knots[1:, :m] = np.maximum(knots[1:, :m], used[:, m : 2 * m])
    knots[:, m:] = np.abs(samples.knots.dq) * np.sqrt(x)[:, None] / limits.velocity
    row = knots.argmax(-1)
    kinds, joints = zip(*limits.rows, *(("velocity", i) for i in range(len(limits.velocity))), strict=True)
    return Binding(np.array(kinds)[row], np.array(joints)[row], np.take_along_axis(knots, row[:, None], -1)[:, 0])


def check_static_load(limits: JointLimits, samples: Samples, torques: Torques) -> None:
    """Check that the arm can pass every posture of the path slowly.

    Raises:
        TaskError: somewhere weight and dry friction alone exceed the torque of a joint.
    """
    static = static_shares(limits, torques)
    if static.max(initial=0.0) < 1 - 1e-9:
        return
    cell, end, row = np.unravel_index(int(static.argmax()), static.shape)
    kind, joint = limits.rows[row]
    knots, load = samples.knots, static.max() * limits.torque[joint]
    raise TaskError(
        f"at s = {knots.s[cell + end]:.6g} weight and dry friction take {load:.4g}, more than the "
        f"{limits.text(kind, joint)}: the arm cannot pass the posture {_text(knots.q[cell + end])} slowly; lower the "
        "payload or the margin, or lead the path elsewhere",
        joint=limits.robot.joint_names[joint],
        value=float(load),
        limit=float(limits.torque[joint]),
        s=float(knots.s[cell + end]),
    )


def check_rate(limits: JointLimits, samples: Samples, cells: Cells, name: str, rate: float | None, x: Array) -> None:
    """Check that the ``rate`` [1/s] at an end of the path, ∞ for any, is not above that of the profile x, (N + 1,).

    Raises:
        TaskError: it is larger.
    """
    knot = 0 if name == "start_rate" else -1
    if rate is None or np.isinf(rate) or rate**2 <= x[knot] * (1 + 1e-9):
        return
    used = find_binding(limits, samples, cells, x)
    limit = limits.text(str(used.kinds[knot]), int(used.joints[knot]))
    raise TaskError(
        f"{name} = {rate:g} 1/s is too fast: at s = {samples.s[knot]:.6g}, posture {_text(samples.q[knot])}, the arm "
        f"can have {np.sqrt(x[knot]):.4g} 1/s, where the {limit}, binds",
        argument=name,
        value=rate,
        limit=float(np.sqrt(x[knot])),
        s=float(samples.s[knot]),
    )


def _text(q: Array) -> str:
    """Write a posture for a message."""
    return str(np.round(q, 4).tolist())
