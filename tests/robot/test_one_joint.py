"""Arms of a single joint, turning or sliding, go through the whole house: closed forms judge what they do."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.segment import Polyline

RADIUS, SWEEP = 0.4, 1.2
KINDS = ("revolute", "continuous", "prismatic")


@cache
def arm(kind: str) -> pc.RobotModel:
    """A link along x that turns about −y, or slides along y."""
    axis, limit = ("0 1 0" if kind == "prismatic" else "0 -1 0"), "" if kind == "continuous" else 'lower="-3" upper="3"'
    return pc.load_robot(f"""<robot name="one"><link name="base"/><link name="tip"/>
      <link name="a"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="j" type="{kind}"><parent link="base"/><child link="a"/><axis xyz="{axis}"/>
        <limit {limit} effort="30" velocity="5"/><dynamics damping="0.5" friction="0.3"/></joint>
      <joint name="t" type="fixed"><parent link="a"/><child link="tip"/><origin xyz="{RADIUS} 0 0"/></joint>
    </robot>""")


def contour(kind: str) -> pc.Contour:
    if kind == "prismatic":
        return pc.Contour((Polyline(np.array([[RADIUS, 0.0, 0.0], [RADIUS, 0.3, 0.0]])),), feed=0.1)
    across, up = np.array([RADIUS, 0.0, 0.0]), np.array([0.0, 0.0, RADIUS])
    return pc.Contour((Arc(np.zeros(3), across, up, 0.0, SWEEP),), feed=0.1)


def joint(kind: str, s: np.ndarray) -> np.ndarray:
    """The position of the joint a length s [m] along the contour, (N, 1)."""
    return (s if kind == "prismatic" else s / RADIUS)[:, None]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_pose_and_jacobian_have_one_column(kind, batch):
    robot, q = arm(kind), np.random.default_rng(0).uniform(-1, 1, (*batch, 1))
    pose, jacobian = robot.frame_kinematics(q, "tip")
    assert np.array_equal(pose, robot.frame_pose(q, "tip"))
    assert np.array_equal(jacobian, robot.frame_jacobian(q, "tip"))
    assert jacobian.shape == (*batch, 6, 1)
    zero = np.zeros(batch)
    turning = [-RADIUS * np.sin(q[..., 0]), zero, RADIUS * np.cos(q[..., 0]), zero, zero - 1, zero]
    sliding = [zero, zero + 1, zero, zero, zero, zero]
    assert np.allclose(jacobian[..., 0], np.stack(sliding if kind == "prismatic" else turning, axis=-1), atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_path_of_the_tool_is_that_of_the_joint(kind):
    curve = pc.smooth(contour(kind)).curves[0]
    path = pc.CartesianPath(arm(kind), "tip", curve, speed=0.1)
    s = np.linspace(path.s0, path.s_end, 101)
    assert np.abs(path.q_d(s) - joint(kind, s)).max() < 1e-6
    assert np.allclose(path.theta(s), 0.1, rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_toolpath_runs_and_is_measured_drawn_filmed_and_kept(kind, tmp_path):
    robot, task = arm(kind), pc.ToolpathTask(arm(kind), "tip", pc.Toolpath((contour(kind),)), clearance=0.0)
    laws = [pc.ExtendedMotionPlan(robot, path, 400.0, 40.0, 5.0) for path in task]
    run = pc.simulate_sequence(laws, task.q_d(np.array(0.0)), duration=20.0, task=task, progress=False)
    assert run.status[0] == "finished"
    assert pc.toolpath_metrics(run)["tool_deviation_peak"][0] < 1e-9  # one joint cannot leave its circle or line
    for figure in (pc.tool_figure, pc.deviation_figure, pc.error_figure, pc.torque_figure, pc.phase_figure):
        assert figure(run).axes
    assert pc.record(run).html()
    saved = pc.Run.load(run.save(tmp_path / "one.nc"))
    assert np.allclose(saved.task.q_d(np.array([0.1, 0.2])), task.q_d(np.array([0.1, 0.2])), atol=1e-9)


@pytest.mark.parametrize("law", [pc.ComputedTorque, pc.PDPlus, pc.Projection])
def test_every_law_and_clock_takes_one_joint(law):
    robot = arm("continuous")
    path = pc.CartesianPath(robot, "tip", pc.smooth(contour("continuous")).curves[0], speed=0.1)
    for loop in (None, pc.ContinuousTime()):
        controller = law(robot, path, 400.0, 40.0)
        run = pc.simulate(controller, np.tile(path.start_posture, (2, 1)), duration=0.5, loop=loop, progress=False)
        assert np.isfinite(run.array("q")).all()
        assert np.isfinite(pc.metrics(run)["e_p_peak"]).all()
