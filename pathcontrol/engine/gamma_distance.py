"""The distance of states to the curve Γ of a task, by the engine, which follows the nearest point along a run."""

from __future__ import annotations

from ctypes import addressof
from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._identity import IdentityCache
from pathcontrol.engine.library import load_library
from pathcontrol.engine.path_table import PathTable, bezier_points, task_table
from pathcontrol.engine.structs import Gamma, Memory, address_of
from pathcontrol.errors import EngineError
from pathcontrol.tasks.task import PathTask

_TURN = 1 / 8  # rad; a piece of a cell that turns by no more is taken to hold at most one minimum
_MOST_PIECES = 256
_SAMPLES = 9  # samples of Γ in a cell
_LOOKS, _MOST_WORK = 16, 1 << 14  # probed points of Γ; allowed pieces to compare with each of them
_CORNER = 1e-6  # a jump of Γ' by this share of the largest ‖Γ'‖ is a corner


class _TabulatedGamma(NamedTuple):
    """A table with the engine's data of its Γ, and the most pieces that a state on Γ has to be compared with."""

    table: PathTable
    gamma: Gamma
    memory: Memory
    work: int


_READY: IdentityCache[PathTask, dict[tuple[float, bool], _TabulatedGamma]] = IdentityCache()


def distances_to_gamma(task: PathTask, q: Array, qd: Array, weight: float, braking: bool) -> tuple[Array, Array]:
    """Return the distances [rad] of states to Γ, and the parameters of the nearest points, (*series, m) each.

    It is the global minimum at every state, and NaN where a state is not finite. States of a series that follow one
    another, as those of a rollout, are fastest; a series has the same bits alone and among others.

    Args:
        task: path and velocity profile.
        q: joint positions [rad], (*series, m, n).
        qd: joint velocities [rad/s], (*series, m, n).
        weight: w [s], how much a velocity counts beside a position.
        braking: take ϑ with the ending of the controllers' plan.

    Raises:
        EngineError: there is no compiled library, the task has no table, or its Γ is so wild that searching the table
            cell by cell takes too long.
    """
    library = load_library()
    table, path, kept = task_table(task)
    braking = braking and table.ending is not None
    ready = _READY.get(task) or _READY.keep(task, {})
    known = ready.get((weight, braking))
    if known is None or known.table is not table:
        memory = Memory()
        gamma = Gamma(addressof(memory.keep(path)), weight, braking)
        centre, radius = _balls(table, weight, braking)
        gamma.centre, gamma.radius = memory.address(centre), memory.address(radius)
        shape = _measure_cells(table, weight, braking)
        gamma.pieces, gamma.smooth = memory.address(shape.pieces, np.int32), memory.address(shape.smooth, np.int32)
        gamma.length, gamma.straight = memory.address(shape.length), memory.address(shape.straight)
        memory.keep(kept)
        known = ready[weight, braking] = _TabulatedGamma(
            table, gamma, memory, _count_candidates(centre, radius, shape.pieces)
        )
    if known.work > _MOST_WORK:
        raise EngineError(
            f"{known.work} pieces of Γ may be nearest to a state on it, expected at most {_MOST_WORK}",
            value=known.work,
            limit=_MOST_WORK,
        )
    *series, rows, _ = q.shape
    states = [np.ascontiguousarray(values, dtype=np.float64) for values in (q, qd)]
    distance, s = np.empty((2, *series, rows))
    pointers = map(address_of, (*states, distance, s))
    library.pathcontrol_gamma(addressof(known.gamma), prod(series), rows, *pointers)
    return distance, s


def _count_candidates(centre: Array, radius: Array, pieces: NDArray[np.int32]) -> int:
    """Return the most pieces of Γ that may be nearest to one of its points, judged by the balls around its cells."""
    away = (np.linalg.norm(centre - point, axis=-1) for point in centre[:: len(centre) // _LOOKS + 1])
    return max(int(pieces[d - radius <= (d + radius).min()].sum()) for d in away)


def _velocity_polynomials(table: PathTable) -> Array:
    """Return r = q_d'ϑ as polynomials (K, 10, n) of s − knot, from the highest power down."""
    c = table.coefficients
    slope, rate = c[:, :-1, :-1] * np.arange(5, 0, -1)[:, None], c[..., -1]
    r = np.zeros((len(c), 10, slope.shape[-1]))
    for i in range(5):
        r[:, i : i + 6] += slope[:, i, None] * rate[..., None]
    return r


def _balls(table: PathTable, weight: float, braking: bool) -> tuple[Array, Array]:
    """Return a ball around [q_d; w r] in each cell, centres (K, 2n) and radii (K,).

    The hull of the Bézier points encloses the curve.
    """
    q, r = (
        bezier_points(table.knots, table.coefficients[..., :-1]),
        bezier_points(table.knots, _velocity_polynomials(table)),
    )
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


class _Shape(NamedTuple):
    """The course of Γ in each cell, (K,) each.

    Attributes:
        pieces: number of pieces to cut the cell into, so that Γ turns little over each.
        length: length of Γ in the cell.
        straight: lower bound of ‖Γ'‖²/‖Γ''‖: up to this distance of a state its square is a convex function of s.
        smooth: True where Γ' is continuous at the beginning of the cell.
    """

    pieces: NDArray[np.int32]
    length: Array
    straight: Array
    smooth: NDArray[np.bool_]


def _measure_cells(table: PathTable, weight: float, braking: bool) -> _Shape:
    """Estimate the course of Γ from samples of each cell, with a margin of a tenth."""
    width = np.diff(table.knots)
    tangent, bend = _derivatives(table, weight, braking, np.linspace(0.0, 1.0, _SAMPLES)[:, None] * width)
    speed, curvature = (np.linalg.norm(values, axis=-1) for values in (tangent, bend))
    tiny = np.finfo(float).tiny
    direction = tangent / np.maximum(speed, tiny)[..., None]
    chord = np.linalg.norm(np.diff(direction, axis=0), axis=-1)
    turn = 2 * np.arcsin(np.minimum(chord / 2, 1.0)).sum(0)
    straight = 0.9 * speed.min(0) ** 2 / np.maximum(1.1 * curvature.max(0), tiny)
    jump = np.linalg.norm(tangent[0] - np.roll(tangent[-1], 1, axis=0), axis=-1)
    if braking and table.ending is not None:  # where braking begins, Γ has a corner inside a cell
        begin = table.ending.s_end - table.ending.braking
        straight = np.where((table.knots[:-1] <= begin) & (begin <= table.knots[1:]), 0.0, straight)
    return _Shape(
        np.clip(np.ceil(turn / _TURN), 1, _MOST_PIECES).astype(np.int32),
        1.1 * speed.max(0) * width,
        straight,
        jump <= _CORNER * speed.max(),
    )


def _derivatives(table: PathTable, weight: float, braking: bool, x: Array) -> tuple[Array, Array]:
    """Return Γ' and Γ'' at s − knot = x (m, K), (m, K, 2n) each."""
    q, r = table.coefficients[..., :-1], _velocity_polynomials(table)
    (_, dq, ddq), (velocity, dr, ddr) = (_jet(polynomials, x) for polynomials in (q, r))
    if braking and table.ending is not None:
        left = (table.ending.s_end - table.knots[:-1] - x) / table.ending.braking
        share, slope = np.clip(left, 0.0, 1.0)[..., None], np.where(left < 1, -1 / table.ending.braking, 0.0)[..., None]
        dr, ddr = dr * share + velocity * slope, ddr * share + 2 * dr * slope
    return np.concatenate([dq, weight * dr], axis=-1), np.concatenate([ddq, weight * ddr], axis=-1)


def _jet(polynomials: Array, x: Array) -> tuple[Array, Array, Array]:
    """Return value and two derivatives of polynomials (K, d + 1, n), from the highest power down, at x (m, K)."""
    value, slope, bend = np.zeros((3, *x.shape, polynomials.shape[-1]))
    for coefficient in np.moveaxis(polynomials, 1, 0):
        bend = bend * x[..., None] + 2 * slope
        slope = slope * x[..., None] + value
        value = value * x[..., None] + coefficient
    return value, slope, bend
