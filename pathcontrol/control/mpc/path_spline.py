"""A path as a smooth spline of CasADi, with derivatives of all orders that optimisation asks for."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.symbolic_dynamics import load_casadi
from pathcontrol.tasks.task import PathTask

_COARSEST, _FINEST = 200, 3200  # cells of a path
_ACCURATE = 1e-6  # rad
_BEYOND = 20  # cells on either side of the path
_DEGREE = 5  # torques have q_d'' in them; their second derivatives are continuous then


def spline_of(task: PathTask, unit: float) -> Any:
    """Return the function of CasADi s/unit ↦ q_d, q_d' and q_d'', derivatives by s/unit, columns (n, 1) each.

    The spline has degree 5. It is refined until it errs by less than 1 µrad half-way between its knots, or has 3200
    cells. A closed path is periodic; an open one goes on as a cubic for a tenth of its length, and stays there.

    Args:
        task: the path.
        unit: the unit of the path parameter.
    """
    s0, s_end = task.one_traverse
    cells = _COARSEST
    while True:
        grid = s0 + (s_end - s0) / cells * np.arange(-_BEYOND, cells + _BEYOND + 1)
        path = _interpolate(task, grid, unit)
        middle = 0.5 * (grid[_BEYOND : -_BEYOND - 1] + grid[_BEYOND + 1 : -_BEYOND])
        found = np.array(path.map(len(middle))(middle / unit)[0]).T
        if cells >= _FINEST or np.abs(found - task.q_d(middle)).max() < _ACCURATE:
            return path
        cells *= 2


def _interpolate(task: PathTask, grid: Array, unit: float) -> Any:
    """Return the spline through a path, or what follows it, at the ``grid``."""
    ca, (s0, s_end) = load_casadi(), task.one_traverse
    knots, s = grid / unit, load_casadi().MX.sym("s")
    q = task.q_d(grid) if task.closed else _extended(task, grid)
    spline = ca.interpolant("path", "bspline", [knots.tolist()], q.ravel().tolist(), {"degree": [_DEGREE]})
    inside = ca.fmax(knots[1], ca.fmin(s, knots[-2]))
    if task.closed:
        inside = s - (s_end - s0) / unit * ca.floor((s - s0 / unit) / ((s_end - s0) / unit))
    point = spline(inside)
    tangent = ca.jacobian(point, s)
    return ca.Function("path", [s], [point, tangent, ca.jacobian(tangent, s)])


def _extended(task: PathTask, grid: Array) -> Array:
    """Return an open path at the ``grid``, (k, n); beyond its ends it goes on as a cubic."""
    s0, s_end = task.one_traverse
    q, width = task.q_d(np.clip(grid, s0, s_end)), grid[1] - grid[0]
    for end, inward in ((s0, width), (s_end, -width)):
        bend, inner = (task.ddq_d(np.array(at)) for at in (end, end + inward))
        over = np.where((grid - end) * inward < 0, grid - end, 0.0)[:, None]
        q += over * (task.dq_d(np.array(end)) + over * (bend / 2 + over * (inner - bend) / (6 * inward)))
    return q
