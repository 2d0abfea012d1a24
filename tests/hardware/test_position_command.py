"""Position commands: the simulation in free motion, and an arm that is held waits on its path."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import InputError

H = 2e-3
JAM, END = (0.4, 1.0), 1.6  # s


def task_of(n):
    if n == 2:
        return pc.Circle(0.5, 2.0)
    center, phases = [0.0, -1.2, 1.4, -0.2, 1.5, 0.0], [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
    return pc.Lissajous(np.full(6, 0.35), [1, 2, 1, 2, 1, 2], speed=1.0, center=center, phases=phases)


def law_of(n, kind=pc.ExtendedMotionPlan, task=None):
    robot = pc.load_robot("cicese_2dof" if n == 2 else "ur5")
    gains = {"k_p": 400.0} if kind is pc.Projection else {"K_p": 400.0}
    gains |= {"k": 40.0} if kind is pc.ExtendedMotionPlan else {}
    return kind(robot, task or task_of(n), K_v=40.0, **gains)


def start_of(law):
    return np.asarray(law.task.q_d(np.array(law.task.s0)), dtype=float)


def serve(step, q, duration, lag=0.0, jammed=None):
    """What is commanded and where the arm is, (k, n) each: a servo with a lag, and a joint that jams for a while."""
    commands, positions, share = [], [], -np.expm1(-H / lag) if lag else 1.0
    for k in range(round(duration / H)):
        command = step(q.copy())
        commands.append(command)
        positions.append(q)
        q = q + share * (command - q)
        if jammed is not None and JAM[0] <= k * H < JAM[1]:
            q[jammed] = positions[-1][jammed]
    return np.array(commands), np.array(positions)


def contour_error(task, q):
    return np.linalg.norm(task.q_d(task.sigma_bar(q)) - q, axis=-1)


@pytest.mark.parametrize(("n", "lag"), [(2, 0.1), (6, 0.0)])
@pytest.mark.parametrize("kind", [pc.ExtendedMotionPlan, pc.Projection, pc.ComputedTorque])
def test_commands_in_free_motion_are_the_simulation_at_the_servo_rate(n, lag, kind):
    law = law_of(n, kind)
    start = start_of(law) + 0.05
    ideal = law.robot.with_friction(pc.Viscous(law.compensated))
    run = pc.simulate(law, start, duration=0.6, plant=ideal, loop=pc.SampledLoop(period=H), progress=False)
    command = pc.PositionCommand(law, H, lag=lag, velocity=100.0)
    command.start(start)
    commands, _ = serve(command.step, start, 0.6, lag)
    assert np.abs(commands - run.array("q")[0, 1:]).max() < 1e-8  # the engine's path is a table within 1e-9
    assert abs(command.s - run.array("s")[0, -1]) < 1e-6
    assert np.abs(command.qd - run.array("qd")[0, -1]).max() < 1e-6


def test_an_override_is_followed_as_in_the_simulation():
    inner = law_of(2)
    law, other = (pc.SpeedOverride(inner, [[0.3, 0.2], [0.9, 1.3]]) for _ in range(2))
    ideal = inner.robot.with_friction(pc.Viscous(inner.compensated))
    run = pc.simulate(law, start_of(inner), duration=1.5, plant=ideal, loop=pc.SampledLoop(period=H), progress=False)
    command = pc.PositionCommand(other, H, velocity=100.0)
    command.start(start_of(inner))
    commands, _ = serve(command.step, start_of(inner), 1.5)
    assert np.abs(commands - run.array("q")[0, 1:]).max() < 2e-4  # the factor passes one more rule


@pytest.mark.parametrize("u", [0.0, 0.2, 1.5])
def test_commands_begin_at_the_speed_that_is_asked_for(u):
    inner = law_of(2)
    start, command = start_of(inner), pc.PositionCommand(pc.SpeedOverride(inner, u), H)
    ideal = inner.robot.with_friction(pc.Viscous(inner.compensated))
    law = pc.SpeedOverride(inner, u)
    run = pc.simulate(law, start, duration=0.3, plant=ideal, loop=pc.SampledLoop(period=H), progress=False)
    command.start(start)
    commands, _ = serve(command.step, start, 0.3)
    assert np.abs(commands - run.array("q")[0, 1:]).max() < 1e-8


@pytest.mark.parametrize(
    ("kind", "n", "jammed"),
    [
        *((pc.ExtendedMotionPlan, 2, 0), (pc.ExtendedMotionPlan, 6, 0)),
        *((pc.Projection, 2, 0), (pc.Projection, 6, 3)),
    ],
)
def test_an_arm_that_jams_waits_on_its_path(kind, n, jammed):
    law, limit = law_of(n, kind), 2.0
    command = pc.PositionCommand(law, H, lag=0.1, velocity=limit)
    start = start_of(law)
    command.start(start)
    commands, q = serve(command.step, start, END, 0.1, jammed)
    plan = iter(pc.plan_trajectory(law.task, 1 / H, END + 0.1).q[1:])
    _, timed = serve(lambda q: next(plan), start, END, 0.1, jammed)
    released = slice(round(JAM[1] / H), None)
    ours, theirs = (contour_error(law.task, each[released]).max() for each in (q, timed))
    assert theirs > 0.1
    assert ours <= theirs / 3
    steps = np.abs(np.diff(commands, axis=0))
    assert steps.max() <= limit * H * (1 + 1e-9)
    there, later, last = command_parameters(law.task, commands, [*JAM, END - H])
    assert later - there < 0.6 * 0.5  # half of what the timed plan passes in a unit of ϑ; it waited
    assert last - later > 0.3  # and goes on


def command_parameters(task, commands, times):
    """The path parameters, counted on, of the commands at some times, in units of ϑ."""
    s = np.unwrap(task.sigma_bar(commands), period=task.period)
    return (s[np.round(np.array(times) / H).astype(int)] - s[0]) / float(np.mean(task.theta(s)))


def test_commands_keep_to_the_path_when_they_are_paced():
    law, limit = law_of(2), 0.4
    command = pc.PositionCommand(law, H, velocity=limit)
    command.start(start_of(law), law.task.dq_d(np.array(0.0)) * law.task.theta(np.array(0.0)))  # as fast as the plan
    commands, _ = serve(command.step, start_of(law), 3.0)
    speed = np.abs(np.diff(commands, axis=0)) / H
    assert speed.max() <= limit * (1 + 1e-9)
    assert speed[500:].max(axis=1).min() > 0.9 * limit  # some joint is always near its limit
    assert contour_error(law.task, commands).max() < 1e-3


def test_pacing_keeps_accelerations_where_the_pace_can():
    law, limit = law_of(2), 6.0
    start = start_of(law)
    velocity = np.asarray(law.task.dq_d(np.array(0.0)) * law.task.theta(np.array(0.0)))
    command = pc.PositionCommand(law, H, velocity=0.7, acceleration=limit)
    command.start(start, velocity)
    commands, _ = serve(command.step, start, 2.0)
    acceleration = np.abs(np.diff(commands[100:], n=2, axis=0)) / H**2
    assert acceleration.max() <= limit * 1.05


def test_holding_and_going_on_without_a_jump():
    law = law_of(6, pc.Projection)
    command, q = pc.PositionCommand(law, H), start_of(law)
    command.start(q)
    went, q = [], q
    for act, seconds in ((None, 0.2), (command.hold, 0.6), (command.resume, 0.3), (command.reverse, 0.6)):
        if act is not None:
            act()
        s = command.s
        for _ in range(round(seconds / H)):
            q = command.step(q)
            went.append(q)
        if act == command.hold:
            assert np.abs(np.diff(went[-50:], axis=0)).max() < 1e-7
            assert np.abs(command.qd).max() < 1e-4
        else:
            assert (command.s - s) * (-1 if act == command.reverse else 1) > 0.1
    assert np.abs(np.diff(went, n=2, axis=0)).max() / H**2 < 60.0


@pytest.mark.parametrize("n", [2, 6])
def test_no_command_is_beyond_a_limit_whatever_is_measured(n):
    law, rng, limit = law_of(n), np.random.default_rng(n), 1.0
    command, q = pc.PositionCommand(law, H, lag=0.05, velocity=limit), start_of(law)
    command.start(q)
    low, high = law.robot.limits.lower, law.robot.limits.upper
    limited = low < high
    last = q
    for _ in range(400):
        measured = last + rng.normal(0, rng.choice([1e-4, 0.1, 10.0]), n)
        bad = rng.choice(["", "", "", "nan", "shape", "none"])
        measured = {"nan": measured * np.nan, "shape": measured[:1], "none": None}.get(bad, measured)
        if rng.random() < 0.02:
            [command.hold, command.resume][rng.integers(2)]()
        now = command.step(measured)
        assert np.isfinite(now).all()
        assert (np.abs(now - last) <= limit * H * (1 + 1e-9)).all()
        assert ((now >= low) & (now <= high))[limited].all()
        last = now


@pytest.mark.parametrize("again", ["resume", "start"])
def test_bad_measurements_are_bridged_and_many_hold_the_plan(again):
    law = law_of(2)
    command, q = pc.PositionCommand(law, H), start_of(law)
    command.start(q)
    for k in range(150):
        q = command.step(None if 100 <= k < 104 else q)
    assert command.faults == 4
    moved = np.abs(command.qd).max()
    for _ in range(300):
        command.step(np.full(2, np.nan))
    assert np.abs(command.qd).max() < 1e-3 < moved
    if again == "resume":
        q = command.q
        command.resume()
    else:
        q = start_of(law)
        command.start(q)
    for _ in range(200):
        q = command.step(q)
    assert np.abs(command.qd).max() > 0.3


@pytest.mark.parametrize("ticks", [1, 5, 8, 400])
def test_measurements_that_jump_move_nothing_and_many_hold_the_plan(ticks):
    """As of encoders that turn over, or a glitch on the line; nor does it however long it lasts."""
    law = law_of(2)
    command, still = (pc.PositionCommand(law, H) for _ in range(2))
    q = p = start_of(law)
    command.start(q), still.start(p)
    for k in range(max(200, 100 + ticks)):
        glitch = 100 <= k < 100 + ticks
        q = command.step(q + 2 * np.pi if glitch else q)
        p = still.step(np.full(2, np.nan) if glitch else p)
        assert (q == p).all()
    assert command.faults == ticks
    command.resume()
    command.step(q + 0.2)  # whoever goes on has looked where the arm is
    assert command.faults == ticks


@pytest.mark.parametrize("kind", [pc.Projection, pc.ExtendedMotionPlan])
def test_an_arm_far_from_its_path_is_refused_also_by_a_step_without_a_start(kind):
    law = law_of(6, kind)
    begin = start_of(law)
    for q, said in (
        (begin + 0.5, "widen tube"),
        (begin[::-1], "widen tube"),
        (np.rad2deg(begin), "did you mean degrees"),
    ):
        for act in (pc.PositionCommand(law, H).start, pc.PositionCommand(law, H).step):
            with pytest.raises(InputError, match=said):
                act(q)
    pc.PositionCommand(law, H, tube=2.0).start(begin + 0.5)
    one, other = pc.PositionCommand(law, H), pc.PositionCommand(law, H)
    one.start(begin + 0.1)
    assert (one.step(begin + 0.1) == other.step(begin + 0.1)).all()


def test_commands_are_the_same_again_from_the_same_measurements():
    law = law_of(2)
    command, q = pc.PositionCommand(law, H, lag=0.05), start_of(law)
    runs = []
    for _ in range(2):
        command.start(q)
        runs.append(serve(command.step, q, 0.5, 0.05)[0])
    assert (runs[0] == runs[1]).all()


@pytest.mark.parametrize(
    "options",
    [{"period": 0.0}, {"lag": -1.0}, {"velocity": 0.0}, {"acceleration": [1.0]}, {"tolerance": 0.0}, {"tube": 0.0}],
)
def test_wrong_arguments_are_told(options):
    with pytest.raises(InputError, match=next(iter(options))):
        pc.PositionCommand(law_of(2), **options)


def test_laws_for_several_rollouts_are_refused():
    robot = pc.load_robot("cicese_2dof")
    law = pc.ComputedTorque(robot, pc.TaskBatch([task_of(2), task_of(2)]), 400.0, 40.0)
    with pytest.raises(InputError, match="several rollouts"):
        pc.PositionCommand(law)
    with pytest.raises(InputError):
        pc.PositionCommand(law_of(2)).start([0.0])
