"""Seconds from a 1 m contour to a path of the joints, on arms of six and seven joints.

Beside it, if pin-pink and a QP solver are installed, a plain loop of differential inverse kinematics with as many
steps as the path was verified at: it gives postures at these points only, so its deviation is that at the points.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from time import perf_counter

import numpy as np

from pathcontrol import RobotModel, load_robot
from pathcontrol.cartesian.cartesian_path import CartesianPath
from pathcontrol.cartesian.orientation import FixedOrientation, NormalOrientation, Orientation
from pathcontrol.toolpaths.tool_curve import ToolCurve

DOWN = np.diag([1.0, -1.0, -1.0])
FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
REPEATS = 3


def contours() -> dict[str, ToolCurve]:
    """A circle and a wavy outline, 1 m long each."""
    circle = ToolCurve.circle([0.45, 0.1, 0.3], 1 / (2 * np.pi))
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    radius = 0.145 * (1 + 0.1 * np.cos(5 * angle))
    outline = np.stack([0.45 + radius * np.cos(angle), 0.1 + radius * np.sin(angle), 0.3 + 0 * angle], -1)
    return {"circle": circle, "outline": ToolCurve.spline(outline, closed=True)}


def best_time(function: Callable[[], object]) -> float:
    times = []
    for _ in range(REPEATS):
        begin = perf_counter()
        function()
        times.append(perf_counter() - begin)
    return min(times)


def measure(robot: RobotModel, frame: str, curve: ToolCurve, label: str, orientation: Orientation | None) -> None:
    path = CartesianPath(robot, frame, curve, orientation, speed=0.05)
    searched = best_time(lambda: CartesianPath(robot, frame, curve, orientation, speed=0.05))
    given = best_time(lambda: CartesianPath(robot, frame, curve, orientation, speed=0.05, start=path.start_posture))
    report = path.report
    print(
        f"{robot.name:6} {label:24} {searched:6.3f} s searched {given:6.3f} s from a start  {report.knots:5} knots  "
        f"{report.position_deviation * 1e6:6.2f} µm {report.angle_deviation * 1e6:6.2f} µrad at {report.points} points"
    )
    if isinstance(orientation, FixedOrientation):
        seconds, deviation, open_by = differential(robot, frame, curve, path.start_posture, report.points)
        if seconds:
            loop = f"{'':6} {'pin-pink, a QP a point':24} {seconds:6.3f} s"
            print(f"{loop} {deviation:42.2f} µm, a lap leaves {open_by:.1e} rad")


def differential(robot: RobotModel, frame: str, curve: ToolCurve, start: np.ndarray, points: int) -> tuple[float, ...]:
    """Seconds, largest deviation [µm] and what a lap of QP steps leaves of the posture; zeros without pin-pink."""
    if importlib.util.find_spec("pink") is None:
        return 0.0, 0.0, 0.0
    import pink
    import pinocchio as pin
    import qpsolvers

    if not qpsolvers.available_solvers:
        return 0.0, 0.0, 0.0
    model = robot.pinocchio_model
    configuration = pink.Configuration(model, model.createData(), start)
    tool, rest = pink.tasks.FrameTask(frame, 1.0, 1.0), pink.tasks.PostureTask(cost=1e-3)
    rest.set_target(start)
    deviation, begin = 0.0, perf_counter()
    for point in curve.position(np.linspace(curve.s0, curve.s_end, points + 1)[1:]):
        tool.set_target(pin.SE3(DOWN, point))
        velocity = pink.solve_ik(configuration, [tool, rest], 1.0, solver=qpsolvers.available_solvers[0])
        configuration.integrate_inplace(velocity, 1.0)
        reached = configuration.get_transform_frame_to_world(frame).translation
        deviation = max(deviation, float(np.linalg.norm(reached - point)))
    return perf_counter() - begin, 1e6 * deviation, float(np.abs(configuration.q - start).max())


def main() -> None:
    arms = [(load_robot("ur5"), "tool0"), (load_robot("panda", lock=FINGERS), "panda_hand_tcp")]
    held = {"position": None, "normal": NormalOrientation((0.0, 0.0, 1.0)), "orientation": FixedOrientation(DOWN)}
    for robot, frame in arms:
        for name, curve in contours().items():
            for kind, orientation in held.items():
                measure(robot, frame, curve, f"{name} {curve.length:.2f} m, {kind}", orientation)


if __name__ == "__main__":
    main()
