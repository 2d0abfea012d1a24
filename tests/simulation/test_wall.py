"""Walls: they push and never pull, take energy out and put none in, and are the ones of closed forms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

import pathcontrol as pc

ENGINES = ["compiled", "pinocchio"]
FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
ARM = pc.load_robot("cicese_2dof")
SMOOTH = ARM.with_friction(None)
LAW = pc.ExtendedMotionPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
TIPS = {"cicese_2dof": "tool", "ur5": "tool0", "panda": "panda_hand"}
ALWAYS = np.array([True])


@cache
def arm(name):
    return pc.load_robot(name, lock=FINGERS if name == "panda" else None)


def simulated(wall, law=LAW, q=(0.7, 1.2), duration=2.0, **options):
    return pc.simulate(law, q, duration=duration, disturbance=wall, progress=False, **options)


def across(stiffness=None, x=0.6, **options):
    """The wall at x = 0.6 m, which cuts the circle of the arm."""
    return pc.Wall("tool", [x, 0.0, 0.0], [-3.0, 0.0, 0.0], stiffness, rigid=stiffness is None, **options)


def step(robot, wall, q, qd, tau=None, h=1e-9):
    wall = wall.find_names(robot)
    tau = np.zeros_like(q) if tau is None else tau
    return pc.Plant(robot, h).advance(q[None], qd[None], np.atleast_2d(tau), None, [(wall, ALWAYS)])


def touching(seed, name, **options):
    """A random arm without friction that moves into a random wall at its tip."""
    rng, robot = np.random.default_rng(seed), arm(name)
    robot = robot.with_friction(None)
    q, qd, normal = rng.normal(0.4, 0.5, robot.n), rng.normal(size=robot.n), rng.normal(size=3)
    if name == "cicese_2dof":
        normal[1] = 0.0  # it moves in this plane
    wall = pc.Wall(TIPS[name], robot.frame_pose(q, TIPS[name])[:3, 3], normal, **options).find_names(robot)
    if wall.jacobian(q[None])[0, 0] @ qd > 0:
        qd = -qd
    return robot, wall, q, qd


@given(st.integers(0, 2**32 - 1), st.sampled_from(list(TIPS)))
def test_an_impact_on_a_rigid_wall_is_the_inelastic_one_of_momenta(seed, name):
    robot, wall, q, qd = touching(seed, name, rigid=True)
    _, after = step(robot, wall, q, qd)
    M, row = robot.mass_matrix(q), wall.jacobian(q[None])[0, 0]
    expected = qd - np.linalg.solve(M, row) * (row @ qd) / (row @ np.linalg.solve(M, row))
    assert_allclose(after[0], expected, rtol=0, atol=1e-5 * np.abs(qd).max())


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(list(TIPS)), st.floats(0.05, 5.0))
def test_the_impulse_of_an_impact_lies_in_the_cone_of_friction(seed, name, friction):
    robot, wall, q, qd = touching(seed, name, rigid=True, friction=friction)
    _, after = step(robot, wall, q, qd, h=1e-12)  # in which gravity does nothing
    M, J = robot.mass_matrix(q), wall.jacobian(q[None])[0]
    assume(np.linalg.svd(J, compute_uv=False)[:2].min() > 0.1)  # else λ and its friction are not told apart
    impulse, *_ = np.linalg.lstsq(J.T, M @ (after[0] - qd), rcond=None)
    assert_allclose(J.T @ impulse, M @ (after[0] - qd), rtol=0, atol=1e-8)  # nothing else has pushed
    push, grip, slip = impulse[0], impulse[1:], J[1:] @ after[0]
    assert push > 0
    assert J[0] @ after[0] >= -1e-5 * np.abs(J[0] @ qd)  # however friction presses the point to the wall or off it
    assert np.hypot(*grip) <= friction * push * (1 + 1e-4)
    assert grip @ slip <= 1e-6 * push * np.abs(qd).max()
    if np.hypot(*slip) > 1e-4 * np.abs(qd).max():  # it slips: all of friction acts, against the slip
        assert_allclose(grip, -friction * push * slip / np.hypot(*slip), rtol=0, atol=2e-3 * friction * push)
    assert robot.kinetic_energy(q, after[0]) <= robot.kinetic_energy(q, qd) * (1 + 1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_nothing_gets_through_a_rigid_wall_however_rough_it_is(engine):
    rng, rollouts = np.random.default_rng(5), 60 if engine == "compiled" else 12
    q, qd = rng.normal(0.4, 0.5, (rollouts, 2)), rng.normal(0, 2.0, (rollouts, 2))
    normal = rng.normal(size=(rollouts, 3)) * [1.0, 0.0, 1.0]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    point = ARM.frame_pose(q, "tool")[:, :3, 3] - 1e-4 * normal
    wall = pc.Wall("tool", point, normal, rigid=True, friction=np.geomspace(5.0, 0.3, rollouts)).find_names(ARM)
    approach = (wall.jacobian(q)[:, 0] * qd).sum(-1, keepdims=True)
    dead, loop = pc.TorqueLimitDrop(0.0), pc.SampledLoop(torque_limits=True)
    run = simulated(wall + dead, LAW, q, 0.05, qd=np.where(approach > 0, -qd, qd), loop=loop, engine=engine)
    gap = np.stack([wall.gap(one) for one in np.swapaxes(run.array("q"), 0, 1)])
    assert gap.min() > -1e-4


@settings(max_examples=6, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(list(TIPS)),
    st.sampled_from([None, 1e3, 1e5, 1e7, 1e12]),
    st.sampled_from([0.0, 0.4]),
)
def test_energy_of_arm_and_wall_never_grows(seed, name, stiffness, friction):
    kind = {"rigid": True} if stiffness is None else {"stiffness": stiffness}
    robot, wall, q, qd = touching(seed, name, friction=friction, **kind)
    plant, tau = pc.Plant(robot, 2e-4), np.zeros((1, robot.n))
    q, qd, energies = q[None], qd[None], []
    for _ in range(100):
        spring = 0.5 * (stiffness or 0.0) * min(float(wall.gap(q)[0]), 0.0) ** 2 if (stiffness or 0) < 1e9 else 0.0
        energies.append(float((robot.kinetic_energy(q, qd) + robot.potential_energy(q))[0]) + spring)
        q, qd = plant.advance(q, qd, tau, None, [(wall, ALWAYS)])
    # what the midpoint rule itself may be off by in so many steps of 0.2 ms
    most = 2e-4 * max(1.0, float(robot.kinetic_energy(q, qd)[0]))
    assert np.max(np.array(energies) - np.minimum.accumulate(energies)) <= most
    if stiffness is None or stiffness > 1e6:
        assert wall.gap(q)[0] > -2e-3


@pytest.mark.parametrize("damping", [0.0, 60.0])
def test_a_spring_and_a_damper_bounce_as_their_equation_says(damping):
    """One joint whose weight is carried: m ẍ = −k x − c ẋ at the wall, x the depth of the point."""
    robot = pc.load_robot("cicese_2dof", lock={"joint_2": 0.0}).with_friction(None)
    origin, k = robot.frame_pose(np.zeros(1), "tool")[:3, 3], 1e5
    wall = pc.Wall("tool", origin, [-1.0, 0.0, 0.0], k, damping=damping).find_names(robot)
    row = wall.jacobian(np.zeros((1, 1)))[0, 0, 0]
    mass = float(robot.mass_matrix(np.zeros(1))[0, 0]) / row**2
    bounce = solve_ivp(
        lambda t, y: [y[1], -(k * y[0] + damping * y[1]) / mass],
        (0.0, 1.0),
        [0.0, 0.01],
        rtol=1e-11,
        atol=1e-15,
        events=_is_let_go(k, damping),
    )
    left, until = bounce.y_events[0][0], 1.2 * bounce.t_events[0][0]
    errors = []
    for h in (4e-4, 2e-4, 1e-4):
        plant, q, qd = pc.Plant(robot, h), np.zeros((1, 1)), np.full((1, 1), -0.01 / row)
        for _ in range(round(until / h)):
            q, qd = plant.advance(q, qd, robot.gravity(q), None, [(wall, ALWAYS)])
        errors.append(abs(row * qd[0, 0] + left[1]))  # left[1] is below 0: out of the wall
    assert errors[-1] < 2e-4 * 0.01 * (1 if damping == 0 else 50)
    assert errors[-1] < 0.7 * errors[0] + 1e-7


def _is_let_go(k, damping):
    def event(t, y):
        return k * y[0] + damping * y[1] if t > 1e-4 else 1.0

    event.terminal, event.direction = True, -1
    return event


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7, 1e12, None])
def test_at_rest_the_wall_carries_what_gravity_presses_at_the_usual_step(stiffness):
    """Motors without torque: the arm falls on a floor and comes to rest where gravity is Jᵀ times the wall's force."""
    robot = SMOOTH.with_friction(pc.Viscous([4.0, 0.6]))
    law = pc.ComputedTorque(robot, pc.Circle(1.0, 1.0), 800.0, 45.0)
    kind = {"rigid": True} if stiffness is None else {"stiffness": stiffness}
    floor = pc.Wall("tool", [0.0, 0.0, 0.6], [0.0, 0.0, 1.0], friction=2.0, **kind)
    off = pc.Dropout(0.0, fallback="zero")
    run = simulated(floor + off, law, [1.2, 0.6], 12.0)
    q, floor = run.array("q")[:, -1], floor.find_names(robot)
    assert np.abs(run.array("qd")[0, -1]).max() < 1e-5
    J = floor.jacobian(q)[0]
    along = int(np.abs(J[1:]).sum(-1).argmax()) + 1  # the direction of the plane in which it moves
    forces = np.linalg.solve(J[[0, along]].T, robot.gravity(q)[0])
    assert forces[0] > 0
    assert abs(forces[1]) <= 2.0 * forces[0]
    depth = -floor.gap(q)[0]
    expected = 0.0 if stiffness is None else forces[0] / stiffness
    assert depth == pytest.approx(expected, rel=1e-3, abs=2e-5)


@pytest.mark.parametrize(("share", "sticks"), [(0.98, True), (1.02, False)])
def test_the_point_sticks_up_to_friction_and_slides_with_the_rest(share, sticks):
    """Motors press with F along the wall's inside and pull with T along it; T − μF accelerates what slides."""
    mu, press = 0.5, 40.0
    q = np.array([0.8, 0.9])
    wall = pc.Wall("tool", SMOOTH.frame_pose(q, "tool")[:3, 3], [-1.0, 0.0, 0.4], rigid=True, friction=mu)
    wall = wall.find_names(SMOOTH)
    J = wall.jacobian(q[None])[0]
    along = int(np.abs(J[1:]).sum(-1).argmax()) + 1  # the direction of the plane in which it moves
    tau = SMOOTH.gravity(q) + J[0] * -press + J[along] * share * mu * press
    _, after = step(SMOOTH, wall, q, np.zeros(2), tau, h=1e-4)
    if sticks:
        assert np.abs(after).max() < 1e-8
        return
    M, both = SMOOTH.mass_matrix(q), J[[0, along]]
    # M a = Jᵀ(λ − F) + J_tᵀ(T − μ λ) with J a = 0
    A = np.block([[M, -(both[0] - mu * both[1])[:, None]], [both[:1], np.zeros((1, 1))]])
    solution = np.linalg.solve(A, np.append(both[0] * -press + both[1] * share * mu * press, 0.0))
    assert solution[2] > 0
    assert_allclose(after[0], 1e-4 * solution[:2], rtol=1e-2, atol=1e-11)


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(list(TIPS)), st.sampled_from([None, 1e4, 1e6]))
def test_the_engine_agrees_with_the_reference(seed, name, stiffness):
    rng, robot = np.random.default_rng(seed), arm(name)
    n = robot.n
    robot = robot.with_friction(pc.Viscous(rng.uniform(0, 1, n)) + pc.Coulomb(rng.uniform(0, 2, n)))
    centre = np.where(np.arange(n) == 3, -1.5, 0.4)
    task = pc.Lissajous(np.full(n, 0.3), np.arange(n) % 2 + 1, 1.0, center=centre)
    law = pc.ExtendedMotionPlan(robot, task, 400.0, np.full(n, 40.0), 5.0)
    at = robot.frame_pose(task.q_d(np.array(0.2)), TIPS[name])[:3, 3]
    ahead = at - robot.frame_pose(task.q_d(np.array(0.0)), TIPS[name])[:3, 3]
    normal = -ahead + 0.3 * np.linalg.norm(ahead) * rng.normal(size=3)
    kind = {"rigid": True} if stiffness is None else {"stiffness": stiffness}
    wall = pc.Wall(TIPS[name], at, normal, friction=rng.uniform(0, 0.5), duration=0.3, **kind)
    push, loop = pc.Push(np.ones(n)), pc.SampledLoop(period=5e-3)
    runs = [simulated(wall + push, law, task.q_d(np.array(0.0)), 0.35, engine=e, loop=loop) for e in ENGINES]
    assert "engine_reason" not in runs[0].config
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("engine", "kind"),
    [
        ("pinocchio", {"stiffness": 1e4}),
        ("compiled", {"stiffness": 1e6, "friction": 0.3}),
        ("compiled", {"rigid": True, "friction": 0.2}),
    ],
)
def test_the_tool_stays_out_for_as_long_as_the_wall_stands(kind, engine):
    wall = pc.Wall("tool", [0.6, 0.0, 0.0], [-1.0, 0.0, 0.0], start=0.05, duration=0.25, **kind)
    run, calm = (simulated(d, q=(0.2, 0.3), duration=t, engine=engine) for d, t in ((wall, 0.45), (None, 0.05)))
    gap = wall.find_names(ARM).gap(run.array("q")[0])
    stands = (run.time >= 0.05) & (run.time <= 0.3 + 1e-9)
    assert gap[stands].min() > {"stiffness": -800.0 / kind.get("stiffness", 1.0)}.get(next(iter(kind)), -1e-4)
    assert (gap[stands] < 1e-3).mean() > 0.2
    assert gap[run.time > 0.4].min() < -0.01
    before = run.time <= 0.05 + 1e-9
    assert_array_equal(run.array("q")[:, before], calm.array("q"))


@pytest.mark.parametrize("engine", ENGINES)
def test_each_rollout_has_its_wall_with_the_bits_it_has_alone(engine):
    points, stiffness = np.array([[0.6, 0.0, 0.0], [0.5, 0.0, 0.0], [0.7, 0.0, 0.2]]), np.array([1e4, np.inf, 1e6])
    options = {
        "friction": np.array([0.0, 0.3, 0.1]),
        "start": np.array([0.0, 0.05, 0.1]),
        "duration": [0.15, np.inf, 0.05],
    }
    run = {"q": (0.2, 0.3), "duration": 0.16, "engine": engine, "loop": pc.SampledLoop(period=5e-3)}
    together = simulated(pc.Wall("tool", points, [-1.0, 0.0, 0.1], stiffness, **options), **run)
    assert together.rollouts == 3
    for i in range(3):
        own = {name: values[i] for name, values in options.items()}
        wall = pc.Wall("tool", points[i], [-1.0, 0.0, 0.1], stiffness[i], **own)
        alone = simulated(wall, **run)
        assert_array_equal(together.array("q")[i], alone.array("q")[0])


def test_a_corner_of_two_walls_is_left_by_neither():
    robot = SMOOTH.with_friction(pc.Viscous([4.0, 0.6]))
    law = pc.ComputedTorque(robot, pc.Circle(1.0, 1.0), 800.0, 45.0)
    floor = pc.Wall("tool", [0.0, 0.0, 0.75], [0.2, 0.0, 1.0], rigid=True)
    corner = floor + pc.Wall("tool", [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], rigid=True)  # the floor slopes down to it
    run, other = (
        simulated(corner + pc.Dropout(0.0, fallback="zero"), law, [0.8, 0.6], 0.8, engine=engine) for engine in ENGINES
    )
    assert_allclose(run.array("q"), other.array("q"), rtol=0, atol=1e-6)
    for wall in corner.terms:
        gap = wall.find_names(robot).gap(run.array("q")[0])
        assert gap.min() > -1e-4
        assert (gap < 1e-4).mean() > 0.1  # it is reached


def test_joints_that_stick_or_are_held_do_so_at_a_wall():
    q, tau = np.array([0.8, 0.9]), ARM.gravity([0.8, 0.9])
    wall = pc.Wall("tool", ARM.frame_pose(q, "tool")[:3, 3], [-1.0, 0.0, 0.0], rigid=True).find_names(ARM)
    plant, here, still = pc.Plant(ARM, 2.5e-3), q[None], np.zeros((1, 2))
    pulled = tau[None] + 0.9 * ARM.friction.levels(np.zeros(2))[0]
    for _ in range(20):
        here, still = plant.advance(here, still, pulled, None, [(wall, ALWAYS)])
    assert_array_equal(here[0], q)
    held = np.array([[False, True]])
    here, moved = plant.advance(q[None], np.array([[0.5, 0.5]]), 2 * tau[None], held, [(wall, ALWAYS)])
    assert here[0, 1] == q[1]
    assert moved[0, 1] == 0
    assert (wall.jacobian(q[None])[0, 0, 0] * moved[0, 0]) > -1e-5


def test_the_length_of_a_normal_says_nothing():
    runs = [
        simulated(pc.Wall("tool", [0.6, 0.0, 0.0], [-x, 0.0, 0.0], 1e5), q=(0.2, 0.3))
        for x in (1.0, 7e3, 1e-200, 1e200)
    ]
    for run in runs[1:]:
        assert_array_equal(run.array("q"), runs[0].array("q"))


class MyPlan(pc.ExtendedMotionPlan):
    """The same law, which the engine does not know."""


def test_a_law_in_python_meets_the_same_walls():
    mine = MyPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    walls = across([1e5, np.inf], friction=[0.2, 0.4], start=[0.0, 0.3]) + across(1e4, x=0.65, duration=0.6)
    runs = [simulated(walls, law, (0.2, 0.3), 0.8) for law in (LAW, mine)]
    assert "only the plant" in runs[1].config["engine_reason"]
    assert_allclose(runs[1].array("q"), runs[0].array("q"), rtol=0, atol=1e-9)


class Edge(pc.Wall):
    """A wall of one's own, with an argument of its own."""

    def __init__(self, x):
        super().__init__("tool", [x, 0.0, 0.0], [-1.0, 0.0, 0.0], 1e4)


def test_a_wall_of_ones_own_is_met_as_one_of_the_library():
    runs = [simulated(wall, duration=0.5, engine="pinocchio") for wall in (across(1e4), Edge(0.6))]
    runs.append(simulated(Edge(0.6), duration=0.5))
    assert "Edge is not one of the library" in runs[2].config["engine_reason"]
    for run in runs[1:]:
        assert_array_equal(run.array("q"), runs[0].array("q"))


def test_more_walls_than_the_engine_takes_are_met_in_the_reference_and_the_run_says_so():
    mine = MyPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    walls = sum((across(1e5, x=2.0 + i) for i in range(4)), start=across(1e5))
    for law in (LAW, mine):
        run = simulated(walls, law, (0.2, 0.3), 0.05)
        assert run.config["engine"] == "pinocchio"
        assert "4 at most" in run.config["engine_reason"]
        with pytest.raises(pc.EngineError, match="4 at most"):
            simulated(walls, law, engine="compiled")


def test_what_is_likely_a_slip_is_told():
    with pytest.warns(pc.PathControlWarning, match=r"'tool' starts 0.0557 m beyond its wall"):
        simulated(across(1e3, x=0.66), duration=0.01)
    with pytest.warns(
        pc.PathControlWarning, match="'tool' starts 0.0557 m beyond its wall, which is rigid and lets it"
    ):
        simulated(across(x=0.66), duration=0.01)
    with pytest.warns(pc.PathControlWarning, match="points are in metres"):
        simulated(across(1e3, x=600.0), duration=0.01)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 0], 1e4), "normal = .* of any other length"),
        (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 1]), "expected a stiffness.* or rigid=True"),
        (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 1], 1e4, rigid=True), "expected a stiffness.* or rigid=True"),
        (lambda: pc.Wall("tool", [0, 0], [0, 0, 1], 1e4), r"point has shape \(2,\)"),
        (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 1], -1.0), "stiffness = -1.0"),
        (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 1], 0.0), "stiffness = 0.0"),
        (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 1], 1e4, -0.1), "friction = -0.1"),
        (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, np.nan], 1e4), "normal"),
        (lambda: pc.Wall(3, [0, 0, 0], [0, 0, 1], 1e4), "frame = 3"),
        (
            lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 1], rigid=[True, False]),
            "rigid = .* a stiffness of inf is rigid for one",
        ),
        (lambda: simulated(pc.Wall("hand", [0, 0, 0], [0, 0, 1], 1e4)), "hand"),
        (lambda: simulated(across(), loop=pc.ContinuousTime()), "continuous time cannot"),
        (lambda: simulated(across([1e3, 1e4]), q=[[0.7, 1.2]] * 3), "Wall"),
    ],
)
def test_what_cannot_be(make, said):
    with pytest.raises(pc.PathControlError, match=said):
        make()
