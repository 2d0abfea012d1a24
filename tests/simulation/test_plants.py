"""Each rollout its own plant: to the last bit what it is alone, whatever the others are."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from strategies import floats

from pathcontrol import (
    ContinuousTime,
    Coulomb,
    ExtendedMotionPlan,
    FrictionLaw,
    InputError,
    Plant,
    Projection,
    RobotBatch,
    RobotModel,
    Run,
    SampledLoop,
    Stribeck,
    Viscous,
    load_robot,
    simulate,
    simulate_sequence,
)
from pathcontrol.robot.friction import friction_of_each
from pathcontrol.robot.recipe import recipe_of, robot_of

START = np.deg2rad([40.0, 70.0])
LOOP = SampledLoop(encoders=True, velocity="difference", torque_limits=True)


class Ramp(FrictionLaw):
    """A law that the library does not know: dry friction that grows with the speed."""

    @property
    def n(self) -> int:
        return 2

    def levels(self, qd):
        level = 0.5 + 0.1 * np.minimum(np.abs(qd), 3.0)
        return level, level


ARM = load_robot("cicese_2dof")  # hypothesis cannot have fixtures that a strategy needs
PAYLOADS = [ARM, *(ARM.with_payload(mass, "tool") for mass in (0.5, 2.0)), ARM.with_armature([0.05, 0.002])]
LAWS = [
    ARM.friction,
    Viscous([1.0, 0.3]) + Coulomb([5.0, 1.0]),
    Viscous([3.0, 0.1]) + Coulomb([9.0, 2.0], [8.0, 1.0]),
    Stribeck([4.0, 1.0], [6.0, 1.5], [0.1, 0.2]) + Viscous([2.0, 0.2]),
    Viscous([2.0, 0.2]),
]
OWN = {"pinocchio": [Ramp()], "compiled": []}  # of an engine, the laws that only the reference knows


@st.composite
def arms(draw: st.DrawFn, laws: list[FrictionLaw] = LAWS) -> RobotModel:
    return draw(st.sampled_from(PAYLOADS)).with_friction(draw(st.sampled_from(laws)))


def assert_rows_equal(together: Run, alone: Run, i: int) -> None:
    for name in together.data.data_vars:
        assert_array_equal(together.array(name)[i], alone.array(name)[0], err_msg=f"{name} of rollout {i}")


def law(arm, circle, **options):
    return ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0, **options)


@pytest.mark.parametrize("engine", ["pinocchio", "compiled"])
@settings(max_examples=6)
@given(st.data(), st.integers(1, 3))
def test_a_batch_is_the_loop_over_its_plants(engine, data, copies):
    from pathcontrol import Circle

    plants = data.draw(st.lists(arms(LAWS + OWN[engine]), min_size=2, max_size=9))
    plants = [*plants, *[plants[0]] * (3 * copies)]  # some share a rigid body, or all that they are
    controller = law(ARM, Circle(1.0, 2.0))
    q = START + 0.3 * np.random.default_rng(2).normal(size=(len(plants), 2))

    def ran(q, plant):
        return simulate(controller, q, duration=0.1, plant=plant, loop=LOOP, engine=engine, progress=False)

    together = ran(q, plants)
    for i, plant in enumerate(plants[: -3 * copies]):
        assert_rows_equal(together, ran(q[i], plant), i)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_arms_of_many_joints(name):
    pytest.importorskip("example_robot_data")
    lock = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0} if name == "panda" else None
    arm = load_robot(name, lock=lock)
    rng = np.random.default_rng(3)
    laws = [Viscous(rng.uniform(0, 2, arm.n)) + Coulomb(rng.uniform(0, 3, arm.n)) for _ in range(6)]
    plants = [arm.with_friction(friction) for friction in laws]
    plants += [arm.with_payload(mass, arm.frame_names[-1]).with_friction(laws[0]) for mass in (1.0, 2.0)]
    q, qd, tau = rng.normal(size=(3, len(plants), arm.n))
    qd[:, 0] = 0.0  # that may stick
    for _ in range(3):
        batch = Plant(RobotBatch(plants), 1e-3).advance(q, qd, tau)
        alone = [Plant(plant, 1e-3).advance(q[[i]], qd[[i]], tau[[i]]) for i, plant in enumerate(plants)]
        assert_array_equal(batch[0], np.concatenate([a[0] for a in alone]))
        assert_array_equal(batch[1], np.concatenate([a[1] for a in alone]))
        q, qd = batch


def test_results_do_not_depend_on_threads_or_how_a_batch_is_cut(arm, circle):
    rng = np.random.default_rng(4)
    masses = rng.choice([0.0, 1.0, 2.0], 24)
    payloads = {mass: arm.with_payload(mass, "tool") for mass in np.unique(masses)}
    q = START + 0.3 * rng.normal(size=(24, 2))
    gains = rng.uniform(400, 1200, (24, 2))

    def run(rows: slice, threads: int) -> Run:
        parallel = {mass: plant.with_threads(threads) for mass, plant in payloads.items()}
        some = [parallel[mass] for mass in masses[rows]]
        controller = Projection(arm.with_threads(threads), circle, gains[rows, :1], gains[rows] / 10)
        return simulate(controller, q[rows], duration=0.2, plant=some, loop=LOOP, progress=False)

    whole = run(slice(0, 24), 1)
    for cuts, threads in (([0, 24], 2), ([0, 1, 2, 9, 24], 1), ([0, 12, 24], 2)):
        parts = [run(slice(a, b), threads) for a, b in pairwise(cuts)]
        for name in whole.data.data_vars:
            assert_array_equal(np.concatenate([part.array(name) for part in parts]), whole.array(name), err_msg=name)


def test_equal_arms_are_one(arm):
    again = load_robot("cicese_2dof")
    batch = RobotBatch([arm, again, arm.with_payload(1.0, "tool"), again.with_payload(1.0, "tool"), arm])
    assert len(batch) == 5
    assert len(batch.bodies) == 2


def test_friction_of_each_is_that_of_each():
    laws = [*LAWS, Ramp(), Ramp(), *LAWS[::-1]]
    together = friction_of_each(laws)
    qd = np.random.default_rng(6).normal(size=(len(laws), 2))
    qd[3] = 0.0
    assert_array_equal(together.torque(qd), [one.torque(v) for one, v in zip(laws, qd, strict=True)])
    assert_array_equal(together.smoothed(qd, 0.1), [one.smoothed(v, 0.1) for one, v in zip(laws, qd, strict=True)])


@settings(max_examples=10)
@given(st.lists(floats(0, 10), min_size=4, max_size=4))
def test_friction_coefficients_may_have_rows(levels):
    """The same as a plant for each, and one object for all of them."""
    from pathcontrol import Circle

    rows = Viscous(np.outer(levels, [0.3, 0.02])) + Coulomb(np.outer(levels, [1.0, 0.2]))
    plants = [ARM.with_friction(Viscous([0.3 * x, 0.02 * x]) + Coulomb([x, 0.2 * x])) for x in levels]
    controller = law(ARM, Circle(1.0, 2.0))
    runs = [
        simulate(controller, START, duration=0.05, plant=plant, progress=False)
        for plant in (ARM.with_friction(rows), plants)
    ]
    for name in runs[0].data.data_vars:
        assert np.allclose(runs[0].array(name), runs[1].array(name), rtol=1e-9, atol=1e-9), (
            name
        )  # 0.3x is rounded twice


def test_a_heavier_load_on_the_same_model_is_heavier(arm, circle):
    """Of two plants with the same law, the one with the payload needs more torque to be held up."""
    plants = [arm, arm.with_payload(3.0, "tool")]
    q = np.array([[np.pi / 2, 0.0]] * 2)
    tau = [plant.gravity(q[0])[0] for plant in plants]
    qdd = RobotBatch(plants).forward_dynamics(q, np.zeros((2, 2)), np.tile(arm.gravity(q[0]), (2, 1)))
    assert abs(qdd[0, 0]) < 1e-9 < qdd[1, 0] * np.sign(tau[0] - tau[1])


def test_masses_scale_linearly(arm):
    """M and g are linear in the masses: scaled all by c, both are; scaled one, the parts add up."""
    rng = np.random.default_rng(8)
    q, qd, qdd = rng.normal(size=(3, 20, 2))
    both = arm.with_masses({"joint_1": 1.7, "joint_2": 1.7})
    assert np.allclose(both.inverse_dynamics(q, qd, qdd), 1.7 * arm.inverse_dynamics(q, qd, qdd), rtol=1e-12)
    first, second = arm.with_masses({"joint_1": 1.7}), arm.with_masses({"joint_2": 1.7})
    sums = first.inverse_dynamics(q, qd, qdd) + second.inverse_dynamics(q, qd, qdd)
    assert np.allclose(sums, 2.7 * arm.inverse_dynamics(q, qd, qdd), rtol=1e-12)
    again = robot_of(json.loads(json.dumps(recipe_of(second))))
    assert_array_equal(again.mass_matrix(q), second.mass_matrix(q))
    with pytest.raises(InputError, match=r"scale of joint_2 = 0, expected a number greater than 0"):
        arm.with_masses({"joint_2": 0.0})


def test_limits_and_encoders_of_each(arm, circle):
    limits = np.array([[150.0, 15.0], [100.0, 9.0]])
    counts = np.array([[1000.0, 360.0], [2000.0, 720.0]])
    loop = SampledLoop(torque_limits=limits, encoders=counts)
    run = simulate(law(arm, circle), [START, START], duration=0.2, loop=loop, progress=False)
    assert_array_equal(np.abs(run.array("tau")).max(1), limits)
    assert_array_equal(run.array("tau_limit"), np.broadcast_to(limits[:, None], run.array("tau").shape))
    without = run.with_data(run.data.drop_vars("tau_limit"))  # which a rollout alone has in its settings
    for i in range(2):
        one = SampledLoop(torque_limits=limits[i], encoders=counts[i])
        assert_rows_equal(without, simulate(law(arm, circle), START, duration=0.2, loop=one, progress=False), i)
    with pytest.raises(InputError, match="torque_limits has rows for 2 rollouts, expected 1 or 3"):
        simulate(law(arm, circle), [START] * 3, duration=0.2, loop=loop, progress=False)


def test_continuous_time_has_plants_too(arm, circle):
    plants, loop = [arm, arm.with_payload(1.0, "tool"), arm.with_friction(None)], ContinuousTime(output_period=0.01)
    together = simulate(law(arm, circle), START, duration=0.1, plant=plants, loop=loop, progress=False)
    for i, plant in enumerate(plants):
        alone = simulate(law(arm, circle), START, duration=0.1, plant=plant, loop=loop, progress=False)
        assert np.abs(together.array("q")[i] - alone.array("q")[0]).max() < 1e-6


def test_the_run_knows_its_plants(arm, circle, tmp_path):
    plants = [arm.with_payload(mass, "tool") for mass in np.linspace(0.1, 1.0, 100)]
    run = simulate(law(arm, circle), START, duration=0.01, plant=plants, progress=False)
    assert run.robot is plants[0]
    assert run.rollout(7).robot is plants[7]
    assert run.config["plant"]["arms"] == run.config["plant"]["rigid_bodies"] == 100
    again = Run.load(run.rollout(7).save(tmp_path / "seven.nc"))
    assert_array_equal(again.robot.mass_matrix(START), plants[7].mass_matrix(START))


def test_the_record_stays_small(arm, circle):
    rows = arm.with_friction(Coulomb(np.ones((1000, 2))))
    controller = ExtendedMotionPlan(arm, circle, np.full((1000, 2), 800.0), [45.0, 100.0], np.full(1000, 20.0))
    run = simulate(controller, START, duration=0.005, plant=rows, progress=False)
    assert len(json.dumps(run.config)) < 3000
    assert run.config["controller"]["K_p"] == {"shape": [1000, 2], "min": 800.0, "max": 800.0}
    assert run.config["controller"]["K_v"] == [45.0, 100.0]


def test_plants_that_do_not_fit(arm, circle):
    controller = law(arm, circle)
    options = {"duration": 0.1, "progress": False}
    with pytest.raises(InputError, match="plant has 2 arms, q and qd are 3 initial states"):
        simulate(controller, [START] * 3, plant=[arm, arm], **options)
    with pytest.raises(InputError, match=r"plant\[1\] = 3, expected a RobotModel"):
        simulate(controller, START, plant=[arm, 3], **options)
    with pytest.raises(InputError, match="plant is an empty list"):
        simulate(controller, START, plant=[], **options)
    with pytest.raises(InputError, match=r"plant\[1\] has the joints"):
        simulate(controller, START, plant=[arm, arm.reduced({"joint_1": 0.0})], **options)
    with pytest.raises(InputError, match="a sequence has a single rollout"):
        simulate_sequence([controller], START, plant=[arm, arm], **options)


@pytest.mark.parametrize("first", [0, 4])
def test_a_rollout_alone_has_its_own_row_of_friction(first, tmp_path):
    """As arm and as model of the law, also of a part of a batch, and read from a file."""
    from pathcontrol import Circle, momentum_observer

    levels = np.array([[1.0, 0.5], [7.0, 1.7], [10.0, 2.0]])
    arm = ARM.with_friction(Coulomb(levels))
    run = simulate(law(arm, Circle(1.0, 2.0)), START, duration=0.05, first_rollout=first, progress=False)
    run.save(tmp_path / "run.nc")
    together = momentum_observer(run, friction="full")
    for one in (run, Run.load(tmp_path / "run.nc")):
        for i, row in enumerate(levels):
            alone = one.rollout(i)
            for known in (alone.robot, alone.model):
                assert_array_equal(known.friction.levels(np.zeros(2))[0], row)
            assert_array_equal(momentum_observer(alone, friction="full")[0], together[i])
