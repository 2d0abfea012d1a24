"""Masses that the arm picks up: momentum is conserved, energy is accounted for, and the arm goes on with the mass."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from circle_file import CIRCLE_FILE
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc
from pathcontrol.simulation.arm.changing_arm import ChangingArm

ENGINES = ["compiled", "pinocchio"]
FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
ARM = pc.load_robot("cicese_2dof")
LAW = pc.ExtendedMotionPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
TIPS = {"cicese_2dof": "tool", "ur5": "tool0", "panda": "panda_hand"}


@cache
def arm(name):
    return pc.load_robot(name, lock=FINGERS if name == "panda" else None)


def simulated(pick, law=LAW, q=(0.7, 1.2), duration=0.5, **options):
    return pc.simulate(law, q, duration=duration, disturbance=pick, progress=False, **options)


def struck(robot, pick, q, qd):
    """The velocity after a pick at tick 4."""
    return ChangingArm(robot, pick.find_names(robot), 2.5e-3).strike(4, q[None], qd[None])[0]


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1), st.sampled_from(list(TIPS)), st.floats(0.01, 30.0), st.booleans())
def test_momentum_is_conserved_and_energy_is_that_of_the_inelastic_impact(seed, name, mass, flies):
    rng, robot = np.random.default_rng(seed), arm(name)
    q, qd, offset = rng.normal(size=robot.n), rng.normal(size=robot.n), rng.normal(0, 0.2, 3)
    v = rng.normal(size=3) if flies else np.zeros(3)
    after = struck(robot, pc.PickUp(mass, TIPS[name], 0.01, offset=offset, velocity=v), q, qd)
    tip = robot.with_frame("mass", TIPS[name], offset)
    J, loaded = tip.frame_jacobian(q, "mass")[:3], robot.with_payload(mass, TIPS[name], offset)
    before = robot.mass_matrix(q) @ qd
    assert_allclose(loaded.mass_matrix(q) @ after, before + mass * J.T @ v, rtol=0, atol=1e-10 * (1 + mass))
    # the loss is ½ uᵀ m* u of the relative velocity u = J q̇ − v, m*⁻¹ = 1/m + J M⁻¹ Jᵀ
    u, reduced = J @ qd - v, np.linalg.inv(np.eye(3) / mass + J @ np.linalg.solve(robot.mass_matrix(q), J.T))
    lost = robot.kinetic_energy(q, qd) + 0.5 * mass * v @ v - loaded.kinetic_energy(q, after)
    assert lost == pytest.approx(0.5 * u @ reduced @ u, rel=1e-8, abs=1e-10)


def test_one_joint_slows_down_by_its_share_of_inertia():
    one = pc.load_robot("cicese_2dof", lock={"joint_2": 0.0})
    inertia, arm_length, mass = float(one.mass_matrix(np.zeros(1))[0, 0]), 0.9, 3.0
    after = struck(one, pc.PickUp(mass, "tool", 0.01), np.array([0.4]), np.array([2.0]))
    assert after[0] == pytest.approx(2.0 * inertia / (inertia + mass * arm_length**2), rel=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_arm_goes_on_with_the_mass_from_the_tick_of_the_pick(engine):
    pick = pc.PickUp(2.0, "tool", 0.1, offset=[0.0, 0.0, -0.05])
    run, calm = (simulated(d, engine=engine) for d in (pick, None))
    at = round(0.1 / 2.5e-3)
    assert_array_equal(run.array("q")[:, : at + 1], calm.array("q")[:, : at + 1])
    assert_array_equal(run.array("qd")[:, : at + 1], calm.array("qd")[:, : at + 1])
    loaded = ARM.with_payload(2.0, "tool", [0.0, 0.0, -0.05])
    q, qd, tau = (run.array(name)[0, at][None] for name in ("q", "qd", "tau"))
    after = np.linalg.solve(loaded.mass_matrix(q[0]), ARM.mass_matrix(q[0]) @ qd[0])
    q, qd = pc.Plant(loaded, 2.5e-3).advance(q, after[None], tau)
    assert_allclose(run.array("q")[0, at + 1], q[0], rtol=0, atol=1e-12)
    assert_allclose(run.array("qd")[0, at + 1], qd[0], rtol=0, atol=1e-10)
    for tick in range(at + 1, at + 41):  # from there it is the arm with a payload
        q, qd = pc.Plant(loaded, 2.5e-3).advance(q, qd, run.array("tau")[0, tick][None])
    assert_allclose(run.array("q")[0, at + 41], q[0], rtol=0, atol=1e-10)


@pytest.mark.parametrize("engine", ENGINES)
def test_put_down_the_velocity_stays(engine):
    run = simulated(pc.PickUp(2.0, "tool", -1.0, 1.1), engine=engine)
    always = simulated(pc.PickUp(2.0, "tool", -1.0), engine=engine)
    loaded = simulated(None, plant=ARM.with_payload(2.0, "tool"), engine=engine)
    assert_allclose(always.array("q"), loaded.array("q"), rtol=0, atol=1e-12)
    at = round(0.1 / 2.5e-3)
    assert_array_equal(run.array("qd")[:, : at + 1], always.array("qd")[:, : at + 1])
    q, qd, tau = (run.array(name)[0, at][None] for name in ("q", "qd", "tau"))
    q, qd = pc.Plant(ARM, 2.5e-3).advance(q, qd, tau)
    assert_allclose(run.array("qd")[0, at + 1], qd[0], rtol=0, atol=1e-10)


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(list(TIPS)))
def test_the_engine_agrees_with_the_reference(seed, name):
    rng, robot = np.random.default_rng(seed), arm(name)
    n = robot.n
    robot = robot.with_friction(pc.Viscous(rng.uniform(0, 1, n)) + pc.Coulomb(rng.uniform(0, 2, n)))
    task = pc.Lissajous(np.full(n, 0.3), np.arange(n) % 2 + 1, 1.0, center=np.where(np.arange(n) == 3, -1.0, 0.4))
    law = pc.ExtendedMotionPlan(robot, task, 400.0, np.full(n, 40.0), 5.0)
    times = rng.uniform(0, 0.2, 2)
    pick = pc.PickUp(rng.uniform(0.1, 3.0, 2), TIPS[name], times, [0.1, np.inf], rng.normal(0, 0.1, (2, 3)))
    pick = pick + pc.PickUp(0.5, TIPS[name], 0.12, velocity=[0.3, 0.0, 0.0]) + pc.FrictionChange(2.0, 0.05, 0.1)
    loop = pc.SampledLoop(period=5e-3)
    runs = [simulated(pick, law, task.q_d(np.array(0.0)), 0.3, engine=e, loop=loop) for e in ENGINES]
    assert "engine_reason" not in runs[0].config
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-10)


@pytest.mark.parametrize("engine", ENGINES)
def test_each_rollout_has_its_mass_with_the_bits_it_has_alone(engine):
    masses, times, spans = np.array([1.0, 2.5, 0.3]), np.array([0.05, 0.1, 0.1]), np.array([0.1, np.inf, 0.02])
    together = simulated(pc.PickUp(masses, "tool", times, spans), duration=0.2, engine=engine)
    assert together.rollouts == 3
    for i in range(3):
        alone = simulated(pc.PickUp(masses[i], "tool", times[i], spans[i]), duration=0.2, engine=engine)
        assert_array_equal(together.array("q")[i], alone.array("q")[0])
        assert_array_equal(together.array("qd")[i], alone.array("qd")[0])


def test_plants_of_their_own_pick_up_alike():
    plants = [ARM, ARM.with_masses({"joint_2": 1.3}), ARM.with_friction(None)]
    pick = pc.PickUp(1.0, "tool", 0.1)
    runs = [simulated(pick, plant=plants, engine=e) for e in ENGINES]
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-11)
    assert_array_equal(runs[0].array("q")[0], simulated(pick).array("q")[0])


class MyPlan(pc.ExtendedMotionPlan):
    """The same law, which the engine does not know."""


class Bolt(pc.PickUp):
    """A mass of one's own, with other arguments."""

    def __init__(self, grams):
        super().__init__(1e-3 * grams, "tool", 0.1)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_mass_of_ones_own_is_picked_up_as_one_of_the_library(engine):
    runs = [simulated(pick, duration=0.2, engine=engine) for pick in (pc.PickUp(0.5, "tool", 0.1), Bolt(500.0))]
    assert_allclose(runs[1].array("q"), runs[0].array("q"), rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    "make", [lambda: pc.PickUp(1.0, "tip", 0.0), lambda: pc.Wall("tip", [2, 0, 0], [-1, 0, 0], 1e4)]
)
def test_arms_of_other_lengths_are_refused_as_one_batch(make):
    plants = [ARM.with_frame("tip", "tool", [0.0, 0.0, z]).with_payload(mass, "tool") for z, mass in ((0, 1), (0, 2))]
    simulated(make(), duration=0.01, plant=plants)
    plants[1] = ARM.with_frame("tip", "tool", [0.0, 0.0, -0.1])
    with pytest.raises(pc.InputError, match=r"'tip' of (PickUp|Wall) is elsewhere on plant\[1\] than on plant\[0\]"):
        simulated(make(), duration=0.01, plant=plants)


def test_a_law_in_python_meets_the_same_mass():
    mine = MyPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    pick, loop = pc.PickUp([1.0, 2.0], "tool", [0.1, 0.1512]), pc.SampledLoop(delay=1e-3, substeps=2)
    runs = [simulated(pick, law, loop=loop) for law in (LAW, mine)]
    assert "only the plant" in runs[1].config["engine_reason"]
    assert_allclose(runs[1].array("q"), runs[0].array("q"), rtol=0, atol=1e-11)


@pytest.mark.parametrize("shift", [-1, 0, 1])
def test_a_pick_at_the_seam_of_a_sequence_strikes_once(shift):
    smooth = ARM.with_friction(None)
    paths = [pc.Line([0.0, 0.0], [0.1, 0.1], 1.0), pc.Line([0.1, 0.1], [0.2, 0.1], 1.0)]
    laws = [pc.ComputedTorque(smooth, path, 400.0, 40.0) for path in paths]
    calm = pc.simulate_sequence(laws, [0.0, 0.0], duration=0.8, progress=False)
    seam = int(np.flatnonzero(np.diff(calm.data["path_index"].values))[0]) + 1
    flying = pc.PickUp(0.5, "tool", (seam + shift) * 2.5e-3, velocity=[1.0, 0.0, 0.0])
    runs = [
        pc.simulate_sequence(laws, [0.0, 0.0], duration=0.8, disturbance=flying, engine=e, progress=False)
        for e in ENGINES
    ]
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-11)
    kick = np.linalg.norm(np.diff(runs[0].array("qd")[0], axis=0), axis=-1)
    assert int(kick.argmax()) == seam + shift
    assert kick.max() > 5 * np.sort(kick)[-2]


def test_a_jammed_joint_does_not_move_when_a_flying_mass_is_caught():
    catch = pc.PickUp(1.0, "tool", 0.1, velocity=[3.0, 0.0, 0.0]) + pc.JammedJoint(1, 0.05, 0.2)
    run = simulated(catch)
    during = (run.time >= 0.05) & (run.time <= 0.25)
    assert np.ptp(run.array("q")[0, during, 1]) == 0


def test_a_file_says_it(tmp_path):
    file = tmp_path / "pick.toml"
    file.write_text(
        CIRCLE_FILE
        + """
        [disturbance]
        type = "pick_up"
        mass = "500 g"
        frame = "tool"
        time = "100 ms"
        offset = ["50 mm", 0.0, 0.0]
        """
    )
    run = pc.run_experiment(file, tmp_path / "out", progress=False).run
    assert run.config["disturbance"]["mass"] == 0.5
    assert run.config["engine"] == "compiled"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: pc.PickUp(0.0, "tool", 1.0), "mass = 0.0, expected numbers above 0"),
        (lambda: pc.PickUp([1.0, -1.0], "tool", 1.0), "mass = .* expected numbers above 0"),
        (lambda: pc.PickUp(1.0, 3, 1.0), "frame = 3"),
        (lambda: pc.PickUp(1.0, "tool", np.nan), "start|time"),
        (lambda: pc.PickUp(1.0, "tool", 0.1, offset=[0.0, 0.0]), r"offset has shape \(2,\)"),
        (lambda: pc.PickUp(1.0, "tool", 0.1, -1.0), "duration = -1.0"),
        (lambda: simulated(pc.PickUp(1.0, "hand", 0.1)), "hand"),
        (lambda: simulated(pc.PickUp(1.0, "tool", 0.1), loop=pc.ContinuousTime()), "continuous time cannot"),
        (lambda: simulated(pc.PickUp([1.0, 2.0], "tool", 0.1), q=[[0.7, 1.2]] * 3), "PickUp"),
    ],
)
def test_what_cannot_be(make, said):
    with pytest.raises(pc.PathControlError, match=said):
        make()
