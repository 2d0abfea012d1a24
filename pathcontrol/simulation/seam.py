"""The seam between two laws that drive one arm, where the observer of the one goes on in the other."""

from __future__ import annotations

from typing import NamedTuple

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller


class Left(NamedTuple):
    """The law that drove the arm last, and its state (N, m) at its time t [s], when it was left."""

    controller: Controller
    z: Array
    t: float


def start_next(controller: Controller, q: Array, qd: Array, left: Left | None) -> Array:
    """Return the state with which a law takes over at (q, q̇), (N, n) each, from the one before it, if there is one."""
    z = controller.start(q, qd)
    if left is None or controller.observer is None or left.controller.observer is None:
        return z
    return controller.inherit(z, left.z, left.t)
