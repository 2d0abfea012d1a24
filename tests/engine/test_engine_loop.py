"""The compiled loop against the reference: every law and everything that a sampled loop has."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol import SampledLoop, simulate

FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
MIDDLE = {
    "cicese_2dof": [0.3, 0.4],
    "ur5": [0.0, -1.2, 1.4, -0.4, 0.5, 0.2],
    "panda": [0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.8],
}
LAWS = ("ComputedTorque", "PDPlus", "SlotineLi", "ExtendedMotionPlan", "Projection")


@cache
def _arm(name):
    robot = pc.load_robot(name, lock=FINGERS if name == "panda" else None)
    friction = pc.Viscous(np.full(robot.n, 0.05)) + pc.Coulomb(np.full(robot.n, 0.1), np.full(robot.n, 0.08))
    return robot if name == "cicese_2dof" else robot.with_friction(friction)


def _task(name, closed):
    middle = np.array(MIDDLE[name])
    if closed:
        ones = np.arange(len(middle))
        return pc.Lissajous(0.25 + 0.05 * (ones % 3), 1 + ones % 2, 0.6, phases=ones, center=middle)
    turns = 0.4 * np.sin(np.arange(len(middle)) + np.arange(5)[:, None])
    return pc.WaypointPath(middle + turns, speed=2.0)


def _law(kind, robot, task, **options):
    start = task.q_d(np.array(task.sampled_interval[0])).reshape(-1, robot.n)[0]
    inertia = 1 / np.diag(np.linalg.inv(robot.mass_matrix(start)))
    gains = {
        "ComputedTorque": {"K_p": 400.0, "K_v": 40.0},
        "PDPlus": {"K_p": 200.0 * inertia, "K_v": 20.0 * inertia},
        "SlotineLi": {"Lambda": 8.0, "K_d": 20.0 * inertia},
        "ExtendedMotionPlan": {"K_p": 400.0, "K_v": 40.0, "k": 5.0},
        "Projection": {"k_p": 400.0, "K_v": 40.0},
    }[kind]
    return getattr(pc, kind)(robot, task, **gains, **options)


def _pair(law, q, **options):
    runs = [simulate(law, q, engine=engine, progress=False, **options) for engine in ("pinocchio", "compiled")]
    assert [run.config["engine"] for run in runs] == ["pinocchio", "compiled"]
    assert "engine_reason" not in runs[1].config
    return runs


def _apart(runs, name="q"):
    a, b = (run.array(name) for run in runs)
    assert a.shape == b.shape
    assert np.array_equal(np.isnan(a), np.isnan(b))
    return np.nanmax(np.abs(a - b))


@pytest.mark.parametrize(
    ("kind", "name", "closed"),
    # each law on each arm, and both, by turns, on closed and on open paths
    [(kind, name, (i + k) % 2 == 0) for i, kind in enumerate(LAWS) for k, name in enumerate(MIDDLE)],
)
def test_every_law_moves_the_arm_as_the_reference_does(kind, name, closed):
    robot, task = _arm(name), _task(name, closed)
    start = task.q_d(np.array(task.s0)) + 0.02
    loop = SampledLoop() if closed and name == "cicese_2dof" else SampledLoop(period=0.01)
    duration = 0.6 if closed else 2.3  # by which an open path has ended
    runs = _pair(_law(kind, robot, task), start, duration=duration, until="duration", loop=loop)
    assert _apart(runs) < 1e-11
    assert _apart(runs, "s") < 1e-10
    assert np.array_equal(runs[0].array("regular"), runs[1].array("regular"))
    if not closed:
        assert np.array_equal(runs[0].data.finish_time, runs[1].data.finish_time)


def test_encoders_differences_filter_delay_and_limits_are_those_of_the_reference():
    robot, task = _arm("cicese_2dof"), pc.Circle(1.0, 2.0)
    loop = SampledLoop(
        encoders=True, velocity="difference", filter_hz=80.0, delay=3.3e-3, torque_limits=True, substeps=2
    )
    runs = _pair(_law("ExtendedMotionPlan", robot, task), [0.9, 0.1], duration=1.5, loop=loop)
    counts = 2 * np.pi / robot.actuation.encoder_counts
    measured = [np.round(run.array("q_measured") / counts) for run in runs]
    differs = np.argwhere((measured[0] != measured[1]).any(axis=(0, 2)))
    until = int(differs[0, 0]) if differs.size else measured[0].shape[1]
    assert until > 100
    assert np.abs(runs[0].array("q")[:, :until] - runs[1].array("q")[:, :until]).max() < 1e-10
    peaks = [np.abs(run.array("e_p")[:, 400:]).max() for run in runs]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-3)


@pytest.mark.parametrize("velocity", ["exact", "difference"])
def test_noise_comes_from_the_same_streams(velocity):
    noise = pc.SensorNoise(position=1e-5, velocity=1e-3 if velocity == "exact" else 0.0, seed=4)
    loop = SampledLoop(noise=noise, velocity=velocity)
    starts = np.array([1.0, 0.0]) + np.random.default_rng(0).normal(0, 0.05, (5, 2))
    law = _law("Projection", _arm("cicese_2dof"), pc.Circle(1.0, 2.0))
    runs = _pair(law, starts, duration=0.5, loop=loop, first_rollout=3)
    assert _apart(runs) < 1e-11
    assert _apart(runs, "q_measured") < 1e-11


def test_pushes_sinusoids_and_forces_on_frames_are_those_of_the_reference():
    robot = _arm("ur5")
    disturbance = (
        pc.Push([5.0, -8.0, 4.0, 1.0, -1.0, 0.5], start=0.2, duration=0.3)
        + pc.Harmonic([3.0, 2.0, 1.0, 0.5, 0.5, 0.2], frequency=3.0, phase=0.4)
        + pc.FrameForce(robot, "tool0", [20.0, -10.0, 5.0], start=0.5, duration=0.4)
    )
    task = _task("ur5", True)
    law, loop = _law("ComputedTorque", robot, task), SampledLoop(period=5e-3)
    runs = _pair(law, task.q_d(np.array(task.s0)), duration=1.0, loop=loop, disturbance=disturbance)
    assert _apart(runs) < 1e-11


@pytest.mark.parametrize(("name", "joints"), [("cicese_2dof", [1, 0]), ("ur5", [2, 4]), ("panda", [1, 6])])
def test_joints_that_jam_are_those_of_the_reference(name, joints):
    robot = _arm(name)
    task = _task(name, True)
    jams = pc.JammedJoint(joints[0], 0.2, 0.3) + pc.JammedJoint(robot.joint_names[joints[1]], 0.4013, 0.2)
    law, loop = _law("ExtendedMotionPlan", robot, task), SampledLoop(period=5e-3)
    runs = _pair(law, task.q_d(np.array(task.s0)), duration=0.75, loop=loop, disturbance=jams)
    assert _apart(runs) < 1e-10


def test_stribeck_friction_and_sums_are_those_of_the_reference():
    robot = pc.load_robot("cicese_2dof").with_friction(
        pc.Viscous([2.0, 0.2])
        + pc.Stribeck([5.0, 1.0], [8.0, 1.6], [0.1, 0.05])
        + pc.Stribeck([0.5, 0.1], [0.6, 0.3], [0.5, 0.4])
    )
    task = _task("cicese_2dof", True)
    runs = _pair(_law("ExtendedMotionPlan", robot, task, friction="full"), [0.5, 0.3], duration=0.8)
    assert _apart(runs) < 1e-10


def test_each_rollout_has_its_own_gains_task_plant_friction_and_limits():
    robot, rng = pc.load_robot("cicese_2dof"), np.random.default_rng(2)
    tasks = [pc.Circle(0.8 + 0.05 * i, 1.5) for i in range(11)]
    frictions = [robot.friction if i % 3 else pc.Coulomb([4.0, 0.8]) + pc.Viscous([1.0, 0.1]) for i in range(11)]
    plants = [robot.with_payload(0.2 * i, "tool").with_friction(friction) for i, friction in enumerate(frictions)]
    law = pc.ExtendedMotionPlan(
        robot,
        pc.TaskBatch(tasks),
        rng.uniform(300, 900, (11, 1)),
        rng.uniform(30, 90, (11, 2)),
        k=rng.uniform(0, 20, 11),
    )
    loop = SampledLoop(torque_limits=rng.uniform(40, 150, (11, 2)))
    runs = _pair(law, [0.8, 0.1], duration=0.4, plant=plants, loop=loop)
    assert _apart(runs) < 1e-10
    assert _apart(runs, "tau") < 1e-6


def test_rollouts_that_diverge_are_marked_alike_and_disturb_nobody():
    robot = pc.load_robot("cicese_2dof").with_friction(None)
    gains = np.array([[800.0], [5e6], [400.0]])
    law = pc.ComputedTorque(robot, pc.Circle(1.0, 2.0), gains, 40.0)
    runs = _pair(law, [0.9, 0.1], duration=0.5)
    assert runs[0].data.status.values.tolist() == runs[1].data.status.values.tolist()
    assert runs[1].data.status.values[1] == "diverged"
    assert np.allclose(runs[0].data.diverged_time, runs[1].data.diverged_time, equal_nan=True)
    assert runs[0].data.reason.values.tolist() == runs[1].data.reason.values.tolist()
    assert _apart([run.rollout(2) for run in runs]) < 1e-10
    with pytest.raises(pc.SimulationError, match="diverged"):
        simulate(pc.ComputedTorque(robot, law.task, 5e6, 40.0), [0.9, 0.1], duration=0.5, engine="compiled")


def test_runs_end_where_those_of_the_reference_end():
    robot = pc.load_robot("cicese_2dof").with_friction(None)
    loop = SampledLoop(period=0.01)
    laps = _pair(_law("ComputedTorque", robot, pc.Circle(1.0, 6.0)), [1.0, 0.0], duration=5.0, laps=2, loop=loop)
    assert laps[0].time[-1] == laps[1].time[-1]
    assert laps[0].data.laps.values == laps[1].data.laps.values == 2
    starts = np.array([0.7, 1.2]) + np.random.default_rng(1).normal(0, 0.02, (32, 2))
    lines = pc.TaskBatch([pc.Line([0.7, 1.2], [0.2, 0.0], speed=v) for v in np.linspace(1.0, 4.0, 32)])
    many = _pair(_law("ExtendedMotionPlan", robot, lines), starts, duration=20.0, loop=loop)
    assert many[0].time[-1] == many[1].time[-1]
    assert np.array_equal(many[0].data.finish_time, many[1].data.finish_time)


def test_the_branches_of_a_path_that_crosses_itself_are_left_as_the_reference_leaves_them():
    robot = pc.load_robot("cicese_2dof").with_friction(None)
    eight = pc.Lissajous([0.8, 0.5], [1, 2], 1.0)
    push = pc.Push([0.0, 60.0], start=0.05, duration=0.15)  # from one branch across to the other
    jumps = {}
    for branch in ("follow", "nearest", "local"):
        law = pc.Projection(robot, eight, 800.0, [45.0, 100.0], branch=branch)
        runs = _pair(law, eight.q_d(np.array(2.4)), duration=0.4, loop=SampledLoop(period=5e-3), disturbance=push)
        assert _apart(runs) < 1e-9, branch
        jumps[branch] = np.abs(np.diff(runs[1].array("s")[0]))
    assert jumps["local"].max() < 0.1
    assert jumps["follow"].max() > 2.0
    assert jumps["nearest"].max() > 2.0
    assert jumps["nearest"].argmax() < jumps["follow"].argmax()


def test_a_sequence_of_paths_is_run_as_by_the_reference():
    robot = pc.load_robot("cicese_2dof")
    corners = [[0.6, 0.2], [0.9, 0.8], [0.2, 1.0]]
    lines = [pc.Line(a, b, speed=0.8) for a, b in itertools.pairwise(corners)]
    laws = [_law("ExtendedMotionPlan", robot, line, friction="full") for line in lines]
    runs = [
        pc.simulate_sequence(
            laws, corners[0], duration=6.0, loop=SampledLoop(period=5e-3), engine=engine, progress=False
        )
        for engine in ("pinocchio", "compiled")
    ]
    assert runs[1].config["engine"] == "compiled"
    assert _apart(runs) < 1e-11
    assert np.array_equal(runs[0].data.path_finish_time, runs[1].data.path_finish_time)


def test_strong_viscous_friction_is_condensed_as_in_the_reference_also_beside_weak():
    robot = pc.load_robot("xarm7")
    middle = np.array([0.3, -0.5, 0.2, 0.9, 0.1, 0.8, 0.4])
    task = pc.Lissajous(np.full(7, 0.2), [1, 2, 1, 2, 1, 2, 1], 0.4, phases=np.arange(7), center=middle)
    weak = robot.with_friction(pc.Viscous(np.full(7, 1e-4)))
    law = pc.ComputedTorque(robot, task, 100.0, 20.0, friction="none")
    runs = _pair(law, task.q_d(np.array(0.0)), duration=0.3, plant=[robot, weak, robot])
    assert _apart(runs) < 1e-10
    alone = simulate(law, task.q_d(np.array(0.0)), duration=0.3, plant=weak, engine="compiled", progress=False)
    assert np.array_equal(alone.array("q")[0], runs[1].array("q")[1])
