"""A joint that jams does not move at all; the rest follows from momentum, energy and the arm with that joint locked."""

from __future__ import annotations

import numpy as np
import pytest
from circle_file import CIRCLE_FILE
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc

FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
FRICTION = pc.Viscous([2.0, 0.2]) + pc.Coulomb([7.0, 1.5])


def arm(name, friction=None):
    robot = pc.load_robot(name, lock=FINGERS if name == "panda" else None)
    return robot if friction is None else robot.with_friction(friction)


def law_of(robot, **gains):
    circle = pc.Lissajous(np.full(robot.n, 0.3), np.arange(robot.n) % 2 + 1, 1.0, center=np.full(robot.n, 0.4))
    return pc.ExtendedMotionPlan(robot, circle, 400.0, np.full(robot.n, 40.0), 5.0, **gains)


def start_of(law):
    return law.task.q_d(np.array(0.0)) + 0.05


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
@pytest.mark.parametrize("name", ["cicese_2dof", "ur5", "panda"])
def test_it_moves_by_exactly_nothing_and_goes_on_when_it_is_let_go(name, engine):
    law = law_of(arm(name))
    joint = law.robot.n - 1
    jam = pc.JammedJoint(law.robot.joint_names[joint], start=0.2, duration=0.3)
    run = pc.simulate(law, start_of(law), duration=0.8, disturbance=jam, engine=engine, progress=False)
    during = (run.time >= 0.2 - 1e-9) & (run.time <= 0.5 + 1e-9)
    q, qd = run.array("q")[0], run.array("qd")[0]
    assert np.ptp(q[during], axis=0)[joint] == 0
    assert (np.ptp(np.delete(q[during], joint, axis=1), axis=0) > 1e-3).all()
    assert (qd[during][1:, joint] == 0).all()
    assert np.ptp(q[run.time > 0.5 + 1e-9], axis=0)[joint] > 1e-3


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["cicese_2dof", "panda"]))
def test_the_impulse_of_stopping_acts_on_the_jammed_joint_alone(seed, name):
    rng, robot = np.random.default_rng(seed), arm(name)
    robot = robot.with_friction(pc.no_friction(robot.n))
    q, qd = rng.normal(size=(2, 1, robot.n))
    held = np.zeros((1, robot.n), dtype=bool)
    held[0, rng.integers(robot.n)] = True
    _, after = pc.Plant(robot, 1e-13).advance(q, qd, np.zeros((1, robot.n)), held)
    M = robot.mass_matrix(q[0])
    assert (after[held] == 0).all()
    assert_allclose((M @ after[0])[~held[0]], (M @ qd[0])[~held[0]], rtol=0, atol=1e-10)


@pytest.mark.parametrize("viscous", [0.2, 200.0])
def test_the_rest_moves_as_the_arm_with_that_joint_locked(viscous):
    n, joint = 7, 3
    panda = arm("panda").with_friction(pc.Viscous(np.full(n, viscous)) + pc.Coulomb(np.full(n, 0.3)))
    rng = np.random.default_rng(1)
    q, qd, tau = rng.normal(0.3, 0.5, (1, n)), rng.normal(size=(1, n)), rng.normal(0, 20.0, (1, n))
    others, held = np.arange(n) != joint, np.arange(n) == joint
    qd[0, joint] = 0.0
    locked = panda.reduced({panda.joint_names[joint]: q[0, joint]})
    whole, rest = pc.Plant(panda, 2e-3), pc.Plant(locked, 2e-3)
    part_q, part_qd, alone = q[:, others], qd[:, others], q[0, joint]
    for _ in range(200):
        q, qd = whole.advance(q, qd, tau, held[None])
        part_q, part_qd = rest.advance(part_q, part_qd, tau[:, others])
    assert q[0, joint] == alone
    assert_allclose(q[:, others], part_q, rtol=0, atol=1e-11)
    assert_allclose(qd[:, others], part_qd, rtol=0, atol=1e-10)


def test_what_holds_a_joint_does_no_work():
    robot = arm("cicese_2dof", pc.no_friction(2))
    drift = []
    for step in (2e-3, 1e-3):
        plant, q, qd = pc.Plant(robot, step), np.array([[0.5, 1.0]]), np.array([[2.0, 0.0]])
        energy = robot.kinetic_energy(q, qd) + robot.potential_energy(q)
        for _ in range(round(1.0 / step)):
            q, qd = plant.advance(q, qd, np.zeros((1, 2)), np.array([[False, True]]))
        drift.append(float(np.abs(robot.kinetic_energy(q, qd) + robot.potential_energy(q) - energy)[0]))
    assert drift[0] / drift[1] == pytest.approx(4.0, abs=0.6)  # the order of the step


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
@pytest.mark.parametrize("name", ["cicese_2dof", "ur5"])
def test_each_rollout_has_a_jam_of_its_own_with_the_bits_it_has_alone(name, engine):
    """One that jams while others are held, and their other joints stick, changes nothing of these."""
    robot = arm(name)
    law = law_of(robot.with_friction(pc.Viscous(np.full(robot.n, 1.0)) + pc.Coulomb(np.full(robot.n, 5.0))))
    first, second = robot.joint_names[:2]
    joints, starts, spans = [first, second, first], np.array([0.02, 0.05, 0.12]), np.array([0.06, 0.02, np.inf])
    options = {"duration": 0.15, "engine": engine, "progress": False}
    together = pc.simulate(law, start_of(law), disturbance=pc.JammedJoint(joints, starts, spans), **options)
    assert together.rollouts == 3
    for i in range(3):
        jam = pc.JammedJoint(joints[i], starts[i], spans[i])
        alone = pc.simulate(law, start_of(law), disturbance=jam, **options)
        assert_array_equal(together.array("q")[i], alone.array("q")[0])


class MyPlan(pc.ExtendedMotionPlan):
    """The same law, which the engine does not know."""


def test_a_law_in_python_meets_the_same_jam():
    known = law_of(arm("ur5"))
    mine = MyPlan(known.robot, known.task, 400.0, np.full(6, 40.0), 5.0)
    jam = pc.JammedJoint([1, 2], 0.1, 0.1)
    runs = [pc.simulate(law, start_of(law), duration=0.3, disturbance=jam, progress=False) for law in (known, mine)]
    assert "only the plant" in runs[1].config["engine_reason"]
    assert_allclose(runs[1].array("q"), runs[0].array("q"), rtol=0, atol=1e-11)


def test_a_motor_goes_on_pushing_and_friction_of_a_held_joint_does_nothing():
    free, rough = (law_of(arm("cicese_2dof", f)) for f in (pc.no_friction(2), pc.Coulomb([0.0, 30.0])))
    jam = pc.JammedJoint("joint_2", 0.0)
    runs = [pc.simulate(law, start_of(law), duration=0.3, disturbance=jam, progress=False) for law in (free, rough)]
    assert_array_equal(runs[0].array("q")[..., 1], runs[1].array("q")[..., 1])
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-12)
    assert np.ptp(runs[0].array("tau_demand")[0, :, 1]) > 0.1


def test_attributes_of_a_disturbance_of_ones_own_may_be_called_anything():
    class Kick(pc.Disturbance):
        def __init__(self):
            self.on, self.held = 1.0, True

        def torque(self, t, q, qd):
            return self.on * np.ones_like(q)

    run = run_with(Kick() + pc.JammedJoint("joint_2"))
    assert np.ptp(run.array("q")[0, :, 1]) == 0


def test_joints_of_rollouts_are_named_or_numbered_as_one_likes():
    runs = [run_with(pc.JammedJoint(joints, 0.02)) for joints in (["joint_1", 1], ["joint_1", "joint_2"], [0, 1])]
    for run in runs:
        assert_array_equal(run.array("q"), runs[0].array("q"))


def test_a_file_says_it(tmp_path):
    file = tmp_path / "jam.toml"
    file.write_text(
        CIRCLE_FILE
        + """
        [disturbance]
        type = "jammed_joint"
        joint = "joint_2"
        start = 0.1
        duration = 0.1
        """
    )
    run = pc.run_experiment(file, tmp_path / "out", progress=False).run
    during = (run.time >= 0.1 - 1e-9) & (run.time <= 0.2 + 1e-9)
    assert np.ptp(run.array("q")[0, during, 1]) == 0


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda: pc.JammedJoint(1.5), pc.InputError, "joint = 1.5, expected the name"),
        (lambda: pc.JammedJoint(-1), pc.InputError, "joint = -1, expected the name"),
        (lambda: pc.JammedJoint("joint_2", 0.0, 0.0), pc.InputError, "duration = 0.0"),
        (lambda: run_with(pc.JammedJoint("elbow")), pc.UnknownNameError, "no movable joint 'elbow'; it has joint_1"),
        (lambda: run_with(pc.JammedJoint(2)), pc.InputError, "joint = 2, but the arm has joints 0 to 1"),
        (lambda: run_with(pc.JammedJoint(0), loop=pc.ContinuousTime()), pc.InputError, "continuous time cannot"),
    ],
)
def test_what_cannot_be(make, error, said):
    with pytest.raises(error, match=said):
        make()


def run_with(disturbance, **options):
    law = law_of(arm("cicese_2dof"))
    return pc.simulate(law, start_of(law), duration=0.1, disturbance=disturbance, progress=False, **options)
