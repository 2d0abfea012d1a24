"""The bundled two-link arm on its straight line: equations of motion and least times by formulas of their own.

F. Debrouwere, Optimal Robot Path Following, PhD thesis, KU Leuven, 2015, and the example of time-optimal path following
of the toolbox rockit, which gives the parameters: links of 1 m in a vertical plane, 1 and 2 kg at their middles,
0.5 kg m² about these, |τ| ≤ 30 and 15 N m; the tool leads from (0, 1.5) to (1.5, 0) m and begins with 1 m/s. Its direct
method takes 0.8284, 0.8329 and 0.8336 s with 100, 1000 and 5000 intervals.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from pathcontrol import PathTask

TORQUE = np.array([30.0, 15.0])
START_RATE = 1 / np.hypot(1.5, 1.5)  # of s, which goes from 0 to 1, at 1 m/s
PUBLISHED = {100: 0.8284092528448338, 1000: 0.8329264935973172, 5000: 0.8335742877153355}


def straight_line(s):
    """q, q' and q'' of the tool's line at s, by inverse kinematics in closed form."""
    x, y = 1.5 * s, 1.5 * (1 - s)
    cos2 = (x * x + y * y - 2) / 2
    q2 = np.arccos(cos2)
    q1 = np.arctan2(y, x) - np.arctan2(np.sin(q2), 1 + cos2)
    s1, c1, s12, c12 = np.sin(q1), np.cos(q1), np.sin(q1 + q2), np.cos(q1 + q2)
    jacobian = np.stack([np.stack([-s1 - s12, -s12], -1), np.stack([c1 + c12, c12], -1)], -2)
    dq = np.linalg.solve(jacobian, np.array([[1.5], [-1.5]]))[..., 0]
    w1, w12 = dq[..., 0] ** 2, dq.sum(-1) ** 2
    turning = np.stack([c1 * w1 + c12 * w12, s1 * w1 + s12 * w12], -1)  # −J'q'
    return np.stack([q1, q2], -1), dq, np.linalg.solve(jacobian, turning[..., None])[..., 0]


class TwoLinkLine(PathTask):
    """The straight line of the tool, s from 0 to 1."""

    s0, s_end = 0.0, 1.0

    def q_d(self, s):
        return straight_line(np.asarray(s, dtype=float))[0]

    def dq_d(self, s):
        return straight_line(np.asarray(s, dtype=float))[1]

    def ddq_d(self, s):
        return straight_line(np.asarray(s, dtype=float))[2]

    def theta(self, s):
        return START_RATE + 0.0 * np.asarray(s, dtype=float)


def accelerations(s, squared, viscous):
    """The least and the largest s̈ that the torques allow at s and ṡ², by the arm's equations of motion in full."""
    q, dq, ddq = straight_line(s)
    coupling = np.cos(q[1])
    M = np.array([[3.75 + 2 * coupling, 1.0 + coupling], [1.0 + coupling, 1.0]])
    C = np.sin(q[1]) * np.array([-2 * dq[0] * dq[1] - dq[1] ** 2, dq[0] ** 2])
    g = 9.81 * np.array([2.5 * np.cos(q[0]) + np.cos(q.sum()), np.cos(q.sum())])
    a, rest = M @ dq, (M @ ddq + C) * squared + g + viscous * dq * np.sqrt(squared)
    return ((-np.sign(a) * TORQUE - rest) / a).max(), ((np.sign(a) * TORQUE - rest) / a).min()


@cache
def least_time(viscous=(0.0, 0.0), end_rate=None):
    """The least time from 1 m/s on, by two arcs in the plane of s and ṡ²: the fastest start, and back from the end.

    The end is free by default: where the least and the largest s̈ meet. The arcs meet in one switch.
    """
    friction = np.array(viscous)

    def arc(side, **kwargs):
        return solve_ivp(
            lambda s, z: [2 * accelerations(s, z[0], friction)[side], z[0] ** -0.5],
            **kwargs,
            rtol=1e-9,
            atol=1e-11,
            method="DOP853",
            dense_output=True,
        )

    def room(squared):
        least, largest = accelerations(1.0, squared, friction)
        return largest - least

    last = (1 - 1e-12) * brentq(room, 1e-3, 50.0, xtol=1e-13) if end_rate is None else end_rate**2
    back = arc(0, t_span=(1.0, 0.0), y0=[last, 0.0])

    def meet(s, z):
        return z[0] - back.sol(s)[0]

    meet.terminal = True
    start = arc(1, t_span=(0.0, 1.0), y0=[START_RATE**2, 0.0], events=meet)
    switch = start.t[-1]
    assert 0 < switch < 1
    return float(start.y[1, -1] - back.sol(switch)[1]), float(np.sqrt(last))
