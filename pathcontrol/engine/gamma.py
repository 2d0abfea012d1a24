"""The distance of states to the curve Γ of a task by the engine, which follows the nearest point along a run."""

from __future__ import annotations

from ctypes import addressof
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._identity import KnownOf
from pathcontrol.engine.library import load_library
from pathcontrol.engine.structs import Gamma, Memory
from pathcontrol.engine.table import PathTable, bezier_points, task_table
from pathcontrol.errors import EngineError
from pathcontrol.tasks.base import PathTask

_TURN = 1 / 8  # rad over a piece of a cell, which is taken to hold one minimum at most
_MOST_PIECES = 256
_SAMPLES = 9  # of a cell, to see how far Γ turns in it
_LOOKS, _MOST_WORK = 16, 1 << 14  # states that are looked at before, and pieces that each may have to be compared with


class _Ready(NamedTuple):
    """A table with the balls around Γ in its cells, and how many pieces each is cut into."""

    table: PathTable
    gamma: Gamma
    memory: Memory
    centre: Array
    radius: Array
    pieces: Array


_READY: KnownOf[PathTask, dict[tuple[float, bool], _Ready]] = KnownOf()


def distances_to_gamma(task: PathTask, q: Array, qd: Array, weight: float, braking: bool) -> tuple[Array, Array]:
    """Return the distances [rad] of states (m, n) to Γ, and the parameters of the nearest points, (m,) each.

    It is the global minimum at every state. States that follow one another, as those of a run, are fastest.

    Args:
        task: path and velocity profile.
        q: joint positions [rad], (m, n).
        qd: joint velocities [rad/s], (m, n).
        weight: w [s], how much a velocity counts beside a position.
        braking: take ϑ with the ending of the controllers' plan.

    Raises:
        EngineError: there is no compiled library, the task has no table, or its Γ is so wild that searching the table
            cell by cell takes too long.
    """
    library = load_library()
    table, path, kept = task_table(task)
    ready = _READY.get(task) or _READY.keep(task, {})
    known = ready.get((weight, braking))
    if known is None or known.table is not table:
        memory = Memory()
        gamma = Gamma(addressof(memory.keep(path)), weight, braking)
        centre, radius = _balls(table, weight, braking)
        gamma.centre, gamma.radius = memory.address(centre), memory.address(radius)
        pieces = _pieces(table, weight)
        gamma.pieces = memory.address(pieces, np.int32)
        memory.keep(kept)
        known = ready[weight, braking] = _Ready(table, gamma, memory, centre, radius, pieces)
    states = np.concatenate([q, weight * qd], axis=-1)
    _check_work(known, states)
    distance, s = np.empty((2, len(states)))
    arrays = (states, distance, s)
    library.pathcontrol_gamma(addressof(known.gamma), 1, len(states), *(a.ctypes.data for a in arrays))
    return distance, s


def _check_work(ready: _Ready, states: Array) -> None:
    """Check that few of the pieces of Γ may be nearest to a state, as far as the balls around its cells tell.

    Raises:
        EngineError: there are too many.
    """
    looked = states[:: len(states) // _LOOKS + 1]
    work = [0]
    for x in looked[np.isfinite(looked).all(-1)]:
        away = np.linalg.norm(ready.centre - x, axis=-1)
        work.append(int(ready.pieces[away - ready.radius <= (away + ready.radius).min()].sum()))
    if max(work) > _MOST_WORK:
        raise EngineError(f"{max(work)} pieces of Γ may be nearest to a state, expected at most {_MOST_WORK}")


def _velocity(table: PathTable) -> Array:
    """r = q_d'ϑ as polynomials (K, 10, n) of s − knot, from the highest power down."""
    c = table.coefficients
    slope, rate = c[:, :-1, :-1] * np.arange(5, 0, -1)[:, None], c[..., -1]
    r = np.zeros((len(c), 10, slope.shape[-1]))
    for i in range(5):
        r[:, i : i + 6] += slope[:, i, None] * rate[..., None]
    return r


def _balls(table: PathTable, weight: float, braking: bool) -> tuple[Array, Array]:
    """A ball around [q_d; w r] in each cell, centres (K, 2n) and radii (K,), by Bézier points, which enclose curves."""
    q, r = bezier_points(table.knots, table.coefficients[..., :-1]), bezier_points(table.knots, _velocity(table))
    if braking and table.ending is not None:  # r times something between the shares at both ends
        left = (table.ending.s_end - table.knots) / table.ending.braking
        share = np.clip(left, 0.0, 1.0)[:, None, None]
        r = np.concatenate([r * share[:-1], r * share[1:]], axis=1)
    centres = [0.5 * (points.min(1) + points.max(1)) for points in (q, weight * r)]
    radii = [
        np.linalg.norm(points - centre[:, None], axis=-1).max(1)
        for points, centre in zip((q, weight * r), centres, strict=True)
    ]
    return np.concatenate(centres, axis=-1), np.hypot(*radii) * (1 + 1e-12)


def _pieces(table: PathTable, weight: float) -> Array:
    """Into how many pieces each cell is cut so that Γ turns little over each, (K,)."""
    width = np.diff(table.knots)
    x = np.linspace(0.0, 1.0, _SAMPLES)[:, None] * width
    tangents = []
    for polynomials, factor in ((table.coefficients[..., :-1], 1.0), (_velocity(table), weight)):
        degree = polynomials.shape[1] - 1
        slope = np.zeros((_SAMPLES, len(width), polynomials.shape[-1]))
        for power in range(degree):
            slope = slope * x[..., None] + (degree - power) * polynomials[:, power]
        tangents.append(factor * slope)
    tangent = np.concatenate(tangents, axis=-1)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=-1, keepdims=True), np.finfo(float).tiny)
    chord = np.linalg.norm(np.diff(tangent, axis=0), axis=-1)
    turn = 2 * np.arcsin(np.minimum(chord / 2, 1.0)).sum(0)
    return np.clip(np.ceil(turn / _TURN), 1, _MOST_PIECES).astype(np.int32)
