"""Time-optimal profiles beside toppra: 1000 grid points on a 6-joint arm, the same paths, one run.

Prints the median over random splines of the best of several repeats each: ours without friction, its ratio to toppra on
the same problem, and its ratio to ours with viscous and Coulomb friction. toppra solves with its compiled Seidel solver
and checks nothing between the grid points; needs the extra ``robots`` and toppra.

Run it with: python benchmarks/time_optimal.py
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np
import toppra

from pathcontrol import Coulomb, PathTask, RobotModel, Viscous, WaypointPath, load_robot
from pathcontrol.profiles.topp.time_optimal import time_optimal

POINTS, PATHS, REPEATS = 1000, 9, 15


def geometry(path: PathTask) -> toppra.interpolator.AbstractGeometricPath:
    """A path as toppra wants it."""

    class Geometry(toppra.interpolator.AbstractGeometricPath):
        dof, path_interval, waypoints = path.n, np.array([path.s0, path.s_end]), None

        def __call__(self, s, order=0):
            return [path.q_d, path.dq_d, path.ddq_d][order](np.asarray(s, dtype=float))

    return Geometry()


def solve_with_toppra(robot: RobotModel, path: PathTask) -> None:
    limits, scheme = robot.limits, toppra.constraint.DiscretizationType.Interpolation
    torque = np.stack([-limits.effort, limits.effort], -1)
    velocity = np.stack([-limits.velocity, limits.velocity], -1)
    constraints = [
        toppra.constraint.JointTorqueConstraint(robot.inverse_dynamics, torque, np.zeros(robot.n), scheme),
        toppra.constraint.JointVelocityConstraint(velocity),
    ]
    grid = np.linspace(path.s0, path.s_end, POINTS)
    instance = toppra.algorithm.TOPPRA(constraints, geometry(path), gridpoints=grid, solver_wrapper="seidel")
    instance.compute_parameterization(0.01, 0.01)


def best(function: Callable[[], object]) -> float:
    """The shortest of several runs [ms]: what the machine is not disturbed in."""
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        function()
        times.append(perf_counter() - start)
    return 1e3 * min(times)


def main() -> None:
    robot = load_robot("ur5").with_friction(None)
    limits = robot.limits
    rubbing = robot.with_friction(Viscous(0.1 * limits.effort / limits.velocity) + Coulomb(0.05 * limits.effort))
    rows = []
    for seed in range(PATHS):
        path = WaypointPath(np.random.default_rng(seed).uniform(-1.5, 1.5, (6, 6)), 1.0)
        ours = best(lambda path=path: time_optimal(robot, path, points=POINTS, margin=0.0))
        with_friction = best(lambda path=path: time_optimal(rubbing, path, points=POINTS, margin=0.0))
        rows.append((ours, ours / best(lambda path=path: solve_with_toppra(robot, path)), with_friction / ours))
    ours, ratio, friction = np.median(rows, axis=0)
    print(f"{POINTS} points, {robot.n} joints: {ours:.1f} ms (worst path {max(row[0] for row in rows):.1f} ms)")
    print(f"beside toppra on the same path: {ratio:.2f}; with viscous and Coulomb friction: {friction:.2f}")


if __name__ == "__main__":
    main()
