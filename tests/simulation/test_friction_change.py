"""Friction that changes for a while: the arm moves as one with that friction, and a joint at rest sticks."""

from __future__ import annotations

import numpy as np
import pytest
from circle_file import CIRCLE_FILE
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof")
LAW = pc.ExtendedMotionPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
STRIBECK = pc.Viscous([2.0, 0.2]) + pc.Stribeck([5.0, 1.0], [8.0, 1.6], [0.1, 0.05])


def simulated(change, law=LAW, q=(0.7, 1.2), duration=0.35, **options):
    return pc.simulate(law, q, duration=duration, disturbance=change, progress=False, **options)


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_it_is_the_arm_with_that_friction(engine):
    factor, level = np.array([2.0, 0.5]), np.array([0.3, 0.2])
    run = simulated(pc.FrictionChange(factor, coulomb=level), engine=engine)
    own = ARM.friction
    law = pc.Viscous(factor * own.viscous) + pc.Coulomb(*(factor * one + level for one in own.levels(np.zeros(2))))
    other = simulated(None, plant=ARM.with_friction(law), engine=engine)
    assert_allclose(run.array("q"), other.array("q"), rtol=0, atol=1e-12)


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_before_and_with_a_factor_of_one_nothing_is_changed(engine):
    calm = simulated(None, engine=engine)
    changed = simulated(pc.FrictionChange(3.0, 0.2, 0.1), engine=engine)
    before = changed.time <= 0.2 + 1e-9
    assert_array_equal(changed.array("q")[:, before], calm.array("q")[:, before])
    assert np.abs(changed.array("q") - calm.array("q"))[:, ~before].max() > 1e-5
    assert_array_equal(simulated(pc.FrictionChange(1.0, 0.2, 0.1), engine=engine).array("q"), calm.array("q"))


def test_a_sliding_joint_stops_where_the_closed_form_says_and_sticks():
    """One joint whose weight is carried: M q̈ = −factor F, so it runs on by M q̇²/(2 factor F)."""
    robot = pc.load_robot("cicese_2dof", lock={"joint_2": 0.0}).with_friction(pc.Coulomb([2.0]))
    plant = pc.Plant(pc.FrictionChange(20.0, 0.1, 1.0).change_arm(0.5, robot), 1e-4)
    M, q, qd = float(robot.mass_matrix(np.zeros(1))[0, 0]), np.zeros((1, 1)), np.ones((1, 1))
    for _ in range(1000):
        q, qd = plant.advance(q, qd, robot.gravity(q + 0.5e-4 * qd))
    assert q[0, 0] == pytest.approx(M / (2 * 40.0), rel=1e-3)
    assert qd[0, 0] == 0
    rest, still = plant.advance(q, qd, robot.gravity(q) + 39.9)  # forty hold, two would not
    assert (rest == q).all()
    assert (still == 0).all()


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["cicese_2dof", "ur5", "panda"]))
def test_the_engine_agrees_with_the_reference_on_random_changes(seed, name):
    rng = np.random.default_rng(seed)
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    robot = pc.load_robot(name, lock=fingers if name == "panda" else None)
    n = robot.n
    robot = robot.with_friction(pc.Viscous(rng.uniform(0, 1, n)) + pc.Coulomb(rng.uniform(0, 2, n)))
    task = pc.Lissajous(np.full(n, 0.3), np.arange(n) % 2 + 1, 1.0, center=np.full(n, 0.4))
    law = pc.ExtendedMotionPlan(robot, task, 400.0, np.full(n, 40.0), 5.0)
    changes = pc.FrictionChange(rng.uniform(0, 20, n), rng.uniform(0, 0.2), rng.uniform(0.01, 0.2))
    changes = changes + pc.FrictionChange(rng.uniform(0, 3), 0.1, coulomb=rng.uniform(0, 2, n)) + pc.Push(np.ones(n))
    start, loop = task.q_d(np.array(0.0)), pc.SampledLoop(period=5e-3)
    runs = [simulated(changes, law, start, 0.3, engine=e, loop=loop) for e in ("compiled", "pinocchio")]
    assert runs[0].config["engine"] == "compiled"
    assert "engine_reason" not in runs[0].config
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-10)


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["cicese_2dof", "ur5"]))
def test_friction_that_jumps_takes_energy_out_and_a_joint_at_rest_stays(seed, name):
    rng = np.random.default_rng(seed)
    robot = pc.load_robot(name)
    n = robot.n
    robot = robot.with_friction(pc.Coulomb(rng.uniform(1.0, 5.0, n)) + pc.Viscous(rng.uniform(0.0, 1.0, n)))
    plant = pc.Plant(pc.FrictionChange(rng.uniform(1.0, 30.0)).change_arm(0.0, robot), 1e-4)
    q, qd = rng.normal(size=(1, n)), np.where(rng.random((1, n)) < 0.5, 0.0, rng.normal(size=(1, n)))
    energies = []
    for _ in range(100):
        energies.append(float((robot.kinetic_energy(q, qd) + robot.potential_energy(q))[0]))
        q, qd = plant.advance(q, qd, np.zeros((1, n)))
    assert (np.diff(energies) <= 1e-8).all()
    level = plant.robot.friction.levels(np.zeros((1, n)))[0]
    rest, still = plant.advance(q, np.zeros((1, n)), robot.gravity(q) + 0.99 * level * rng.choice([-1, 1], n))
    assert (still == 0).all()
    assert (rest == q).all()


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_each_rollout_has_its_own_with_the_bits_it_has_alone(engine):
    factor, start = np.array([[3.0, 1.0], [0.0, 8.0], [1.0, 1.0]]), np.array([0.05, 0.1, 0.0])
    together = simulated(pc.FrictionChange(factor, start, [0.1, np.inf, 0.2]), engine=engine, duration=0.3)
    assert together.rollouts == 3
    for i, span in enumerate([0.1, np.inf, 0.2]):
        alone = simulated(pc.FrictionChange(factor[i], start[i], span), engine=engine, duration=0.3)
        assert_array_equal(together.array("q")[i], alone.array("q")[0])


def test_stribeck_groups_and_plants_of_one_s_own_change_alike():
    plants = [
        ARM.with_friction(law) for law in (STRIBECK, pc.Coulomb([4.0, 0.8]), STRIBECK + pc.Viscous([900.0, 90.0]))
    ]
    change = pc.FrictionChange(np.array([[2.0], [5.0], [0.3]]), 0.05, 0.1)
    runs = [simulated(change, plant=plants, q=[[0.7, 1.2]] * 3, engine=e) for e in ("compiled", "pinocchio")]
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-10)


class MyPlan(pc.ExtendedMotionPlan):
    """The same law, which the engine does not know."""


def test_a_law_in_python_and_a_delay_meet_the_same_change():
    mine = MyPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    change, loop = pc.FrictionChange([[3.0, 1.0], [1.0, 9.0]], 0.1013, 0.1), pc.SampledLoop(delay=1e-3, substeps=2)
    runs = [simulated(change, law, loop=loop) for law in (LAW, mine)]
    assert "only the plant" in runs[1].config["engine_reason"]
    assert_allclose(runs[1].array("q"), runs[0].array("q"), rtol=0, atol=1e-11)


def test_a_sequence_meets_it_where_its_time_is():
    paths = [pc.Line([0.0, 0.0], [0.1, 0.1], 1.0), pc.Line([0.1, 0.1], [0.2, 0.1], 1.0)]
    laws = [pc.ComputedTorque(ARM, path, 400.0, 40.0) for path in paths]
    one, calm, other = (
        pc.simulate_sequence(
            laws, [0.0, 0.0], duration=0.6, disturbance=pc.FrictionChange(factor, 0.3), engine=engine, progress=False
        )
        for engine, factor in (("compiled", 2.0), ("compiled", 1.0), ("pinocchio", 2.0))
    )
    assert_allclose(one.array("q"), other.array("q"), rtol=0, atol=1e-10)
    before = one.time[: len(calm.time)] <= 0.3 + 1e-9
    assert_array_equal(one.array("q")[:, : len(before)][:, before], calm.array("q")[:, : len(before)][:, before])


def test_a_file_says_it_with_one_number(tmp_path):
    file = tmp_path / "rough.toml"
    file.write_text(
        CIRCLE_FILE
        + """
        [[disturbance]]
        type = "friction_change"
        factor = 3.0
        start = "100 ms"
        duration = 0.1
        [[disturbance]]
        type = "friction_change"
        coulomb = [0.0, "0.5 N m"]
        start = 0.2
        """
    )
    run = pc.run_experiment(file, tmp_path / "out", progress=False).run
    first, second = run.config["disturbance"]["terms"]
    assert (first["factor"], first["start"], second["coulomb"]) == (3.0, 0.1, [0.0, 0.5])
    assert run.config["engine"] == "compiled"


def test_a_factor_that_changes_nothing_is_told():
    ur5 = pc.load_robot("ur5").with_friction(None)
    law = pc.ComputedTorque(ur5, pc.Line(np.zeros(6), np.full(6, 0.1), 1.0), 400.0, 40.0)
    with pytest.warns(pc.PathControlWarning, match="has no friction, so FrictionChange"):
        simulated(pc.FrictionChange(5.0), law, np.zeros(6), 0.05)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: pc.FrictionChange(-0.5), "factor = -0.5, expected numbers not below 0"),
        (lambda: pc.FrictionChange(coulomb=[1.0, -1.0]), "coulomb = .* expected numbers not below 0"),
        (lambda: pc.FrictionChange(np.inf), "factor"),
        (lambda: pc.FrictionChange(2.0, duration=0.0), "duration = 0.0"),
        (lambda: simulated(pc.FrictionChange([1.0, 2.0, 3.0])), "FrictionChange"),
        (lambda: simulated(pc.FrictionChange(2.0), loop=pc.ContinuousTime()), "continuous time cannot"),
    ],
)
def test_what_cannot_be(make, said):
    with pytest.raises(pc.InputError, match=said):
        make()
