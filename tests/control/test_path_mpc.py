"""Model predictive path following: its optimum, its theorem, its limits, and what it does where none is found."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from two_link import START_RATE, TwoLinkLine, least_time

import pathcontrol as pc
from pathcontrol.control.mpc.path_problem import Inputs, follow
from pathcontrol.experiments.runner import load_setup
from pathcontrol.view.report.reproduction import script

casadi = pytest.importorskip("casadi")

from pathcontrol.control.mpc.path_spline import spline_of  # noqa: E402

TWO_LINK = pc.load_robot("two_link")
SLIDE = pc.load_robot(
    '<robot name="slide"><link name="base"/><link name="cart"><inertial><mass value="2"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="rail" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>'
    '<limit lower="-999" upper="999" effort="1e4" velocity="999"/></joint></robot>'
)
FAST = {"horizon": 1.2, "W": 1e-6, "R": 1e-5, "R_s": 1e-9, "margin": 0.0, "end": "free"}


class FastLine(TwoLinkLine):
    """The line of the two-link arm at a speed beyond its torques."""

    def theta(self, s):
        return 3.0 + 0.0 * np.asarray(s, dtype=float)


@cache
def circling(**options):
    return pc.PathMPC(pc.load_robot("cicese_2dof").with_friction(None), pc.Circle(1.0, 2.0), 0.3, 10, **options)


def plan(law, q, qd, z=None):
    """The first plan of a law and its motion, from (q, q̇)."""
    z = law.start(q, qd) if z is None else z
    s, sdot = z[0], z[1]
    e, edot = law.task.q_d(s) - q, law.task.dq_d(s) * sdot - qd
    inputs, reason = law._optimise(e, edot, s, sdot, law._unpack(z[2:]))
    assert not reason
    return inputs, follow(e, edot, s, sdot, inputs)


def regulator(A, B, Q, R):
    """The gain of the linear-quadratic regulator of a sampled system."""
    P = solve_discrete_are(A, B, Q, R)
    return np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)


def test_without_limits_it_is_the_linear_quadratic_regulator():
    law = pc.PathMPC(SLIDE, pc.Line([0.0], [50.0], 1.0), horizon=1.5, intervals=60, Q=1.0, W=0.1, R=1e-5, R_s=1e-5)
    step, x = law.step, np.array([0.02, -0.1])
    inputs, _ = plan(
        law, np.array([10.0]) - x[0], np.array([0.9]) - x[1], np.append([10.0, 0.9], law.start([0.0], [0.9])[2:])
    )
    beside = regulator(
        np.array([[1.0, step], [0.0, 1.0]]), np.array([[step**2 / 2], [step]]), np.diag([1.0, 0.0]), np.eye(1) * 1e-5
    )
    along = regulator(np.eye(1), np.eye(1) * step, np.eye(1) * 0.1, np.eye(1) * 1e-5)
    assert inputs.beside[0, 0] == pytest.approx(-(beside @ x)[0], rel=1e-3)
    assert inputs.along[0] == pytest.approx(along[0, 0] * 0.1, rel=1e-3)


def test_the_cost_falls_by_that_of_each_step():
    """A plan moved on by one step, and kept on the path at its last speed, may be taken again."""
    law, q, qd = circling(), np.array([0.99, 0.0]), np.array([0.0, 1.8])
    z, costs, spent, kept = law.start(q, qd), [], [], []
    for _ in range(5):
        inputs, motion = plan(law, q, qd, z)
        length = np.linalg.norm(law.task.dq_d(motion.s), axis=-1)
        nodes = law.Q * (motion.e**2).sum(-1) + law.W * (length * (motion.sdot - law.task.theta(motion.s))) ** 2
        moves = law.R * (inputs.beside**2).sum(-1) + law.R_s * (length[:-1] * inputs.along) ** 2
        costs.append(nodes.sum() + moves.sum())
        spent.append(nodes[0] + moves[0])
        kept.append(nodes[-1])
        s, sdot = motion.s[1], motion.sdot[1]
        q, qd = law.task.q_d(s) - motion.e[1], law.task.dq_d(s) * sdot - motion.edot[1]
        z = np.concatenate([[s, sdot], law._pack(inputs.moved(law.step, law.step))])
        assert np.abs([motion.e[-1], motion.edot[-1]]).max() < 1e-6  # the terminal constraint
    falls = -np.diff(costs)
    assert (falls >= np.array(spent[:-1]) - kept[:-1] - 1e-6 * costs[0]).all()
    assert costs[-1] < 0.2 * costs[0]


def test_the_arm_comes_to_its_path_at_the_desired_speed():
    law, loop = circling(), pc.SampledLoop(period=0.03, torque_limits=True, substeps=5)
    run = pc.simulate(law, [0.95, 0.05], duration=0.6, loop=loop, progress=False)
    assert run.array("regular").all()
    assert np.abs(run.array("e_p")[0, -1]).max() < 2e-3  # what torques that are held leave
    assert run.array("sdot")[0, -1] == pytest.approx(2.0, abs=1e-3)
    assert (np.abs(run.array("tau_demand")) < 0.9501 * law.robot.limits.effort).all()


def test_plans_tend_to_the_least_time_as_intervals_shrink():
    least, excess = least_time()[0], []
    for intervals in (18, 36, 72):
        law = pc.PathMPC(TWO_LINK, FastLine(), intervals=intervals, **FAST)
        q, dq = law.task.q_d(0.0), law.task.dq_d(0.0)
        inputs, motion = plan(law, q, dq * START_RATE)
        assert motion.s[-1] == pytest.approx(1.0)
        assert np.abs(motion.e).max() < 5e-4
        qdd = dq * inputs.along[0] + law.task.ddq_d(0.0) * START_RATE**2 - inputs.beside[0]
        shares = np.abs(TWO_LINK.inverse_dynamics(q, dq * START_RATE, qdd)) / TWO_LINK.limits.effort
        assert shares.max() == pytest.approx(1.0, abs=1e-3)
        excess.append(intervals * inputs.step - least)
    # the limits are kept at both ends of each interval
    assert 0.35 < excess[1] / excess[0] < 0.6
    assert 0.35 < excess[2] / excess[1] < 0.6
    assert 0 < excess[2] < 0.02 * least


def test_a_simulated_arm_passes_a_free_end_within_its_torques():
    law = pc.PathMPC(TWO_LINK, FastLine(), intervals=9, **FAST)
    q, qd = law.task.q_d(0.0), law.task.dq_d(0.0) * START_RATE
    loop = pc.SampledLoop(period=0.045, torque_limits=True, substeps=8)
    run = pc.simulate(law, q, qd=qd, duration=0.9, until="duration", loop=loop, progress=False)
    before = run.array("s")[0] < 1.0
    assert run.array("regular")[0, before].all()
    assert np.abs(run.array("e_p")[0, before]).max() < 0.02
    assert 1.0 - run.array("s")[0, before][-1] < 0.2
    assert (np.abs(run.array("tau_demand")[0, before]) < TWO_LINK.limits.effort * 1.0001).all()


def test_an_open_path_ends_at_rest():
    line = pc.Line([1.0, 0.8], [1.15, 0.7], 1.0)
    law = pc.PathMPC(TWO_LINK, line, 0.4, 8)
    loop = pc.SampledLoop(period=law.step, torque_limits=True, substeps=8)
    run = pc.simulate(law, line.start, duration=2.0, loop=loop, progress=False)
    assert run.finish_time[0] < 1.2
    assert run.array("q")[0, -1] == pytest.approx([1.15, 0.7], abs=1e-3)


def test_where_the_solver_fails_the_last_plan_goes_on(monkeypatch):
    law = circling()
    q, qd = np.array([[1.0, 0.0]]), np.array([[0.0, 2.0]])
    z = law.advance(law.start(q, qd), law.law(0.0, q, qd, law.start(q, qd)), law.step)
    q = law.task.q_d(z[:, 0])
    qd = law.task.dq_d(z[:, 0]) * z[:, 1:2]
    well = law.law(0.0, q, qd, z)
    monkeypatch.setattr(law._problem, "solve", lambda guess, inputs, around: (inputs, guess, "Infeasible"))
    with pytest.warns(pc.PathControlWarning, match=r"the solver of PathMPC stopped \(Infeasible\)"):
        out = law.law(0.0, q, qd, z)
    assert well.regular.all()
    assert not out.regular.any()
    assert out.tau == pytest.approx(well.tau, rel=0.05)


def test_each_rollout_has_its_own_problem():
    law = circling()
    q, qd = np.array([[0.99, 0.0], [1.0, 0.02]]), np.array([[0.0, 2.0], [0.1, 1.5]])
    both = law.law(0.0, q, qd, law.start(q, qd))
    for i in range(2):
        one = law.law(0.0, q[i], qd[i], law.start(q[i], qd[i]))
        np.testing.assert_array_equal(both.tau[i], one.tau)
        np.testing.assert_array_equal(both.zdot[i], one.zdot)


@pytest.mark.parametrize("factor", [0.0, -0.5])
def test_the_speed_may_be_overridden(factor):
    law = pc.SpeedOverride(circling(), [[0.0, factor]], acceleration=50.0)
    loop = pc.SampledLoop(period=0.03, substeps=5)
    run = pc.simulate(law, [1.0, 0.0], qd=[0.0, 2.0], duration=0.45, loop=loop, progress=False)
    assert run.array("sdot")[0, -1] == pytest.approx(2.0 * factor, abs=2e-3)
    assert np.abs(run.array("e_p")[0]).max() < 5e-3


def test_inputs_moved_by_an_interval_lose_the_first_one():
    rng = np.random.default_rng(0)
    inputs = Inputs(rng.normal(size=(6, 2)), rng.normal(size=6), 0.1)
    moved = inputs.moved(0.1, 0.1)
    assert moved.along == pytest.approx(np.append(inputs.along[1:], 0.0))
    assert moved.beside == pytest.approx(np.vstack([inputs.beside[1:], np.zeros((1, 2))]))
    later, whole = inputs.moved(0.2, 0.2), inputs.along * 0.1
    assert later.along[:2] * 0.2 == pytest.approx([whole[2] + whole[3], whole[4] + whole[5]])


@pytest.mark.parametrize(
    "task",
    [pc.Lissajous([1.0, 0.5], [1, 2], 1.0), pc.WaypointPath([[0.0, 0.5], [0.4, 1.0], [1.2, 0.4]], 0.5), TwoLinkLine()],
)
def test_the_spline_of_a_path_is_the_path(task):
    unit = 0.7
    path, (s0, s_end) = spline_of(task, unit), task.one_traverse
    for s in s0 + (s_end - s0) * np.array([0.0, 0.123, 0.5, 0.877, 1.0]):
        q, dq, ddq = (np.array(value)[:, 0] for value in path(s / unit))
        assert q == pytest.approx(task.q_d(np.array(s)), abs=1e-6)
        assert dq / unit == pytest.approx(task.dq_d(np.array(s)), abs=1e-4)
        assert ddq / unit**2 == pytest.approx(task.ddq_d(np.array(s)), abs=2e-2)
    if task.closed:
        assert np.array(path((s0 + 3 * task.period + 0.2) / unit)[0])[:, 0] == pytest.approx(
            task.q_d(s0 + 0.2), abs=1e-6
        )


def test_it_is_named_in_files_and_kept_with_runs(tmp_path, monkeypatch):
    path = tmp_path / "mpc.toml"
    path.write_text(
        'duration = 0.06\nrobot.source = "cicese_2dof"\ntask = { type = "circle", radius = 1.0, speed = 2.0 }\n'
        "start = { q = [1.0, 0.0], qd = [0.0, 2.0] }\nloop = { period = 0.03 }\n"
        '[controller]\ntype = "path_mpc"\nhorizon = "300 ms"\nintervals = 10\nW = 1e-4\ntorque = [100.0, 12.0]\n'
    )
    setup = load_setup(path)
    run = pc.simulate(setup.controller, [1.0, 0.0], qd=[0.0, 2.0], duration=0.06, loop=setup.loop, progress=False)
    said = run.config["controller"]
    assert (said["controller"], said["horizon"], said["intervals"], said["W"]) == ("PathMPC", 0.3, 10, 1e-4)
    law = pc.PathMPC(pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0), 0.3, 10, torque=[100.0, 12.0])
    loop = pc.SampledLoop(period=0.03)
    by_hand = pc.simulate(law, [1.0, 0.0], qd=[0.0, 2.0], duration=0.06, loop=loop, progress=False)
    np.testing.assert_array_equal(run.array("q"), by_hand.array("q"))
    run.save(tmp_path / "run.nc")
    saved = pc.Run.load(tmp_path / "run.nc")
    assert saved.config["controller"] == said
    monkeypatch.chdir(tmp_path)
    again: dict[str, object] = {}
    exec(script("run", saved), again)
    np.testing.assert_array_equal(again["run"].array("q"), run.array("q"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"W": 0.0}, "W = 0, expected a number greater than 0"),
        ({"margin": 1.0}, "margin = 1, expected the share"),
        ({"margin": "1.0"}, "margin = 1, expected the share"),
        ({"torque": None}, "expected a limit of each joint"),
        ({"intervals": 1}, "intervals = 1, expected a whole number from 2"),
        ({"horizon": -1.0}, "horizon = -1"),
        ({"end": "fre"}, "end = 'fre', expected one of 'rest', 'free'"),
    ],
)
def test_bad_arguments_are_told(options, words):
    with pytest.raises(pc.PathControlError, match=words):
        pc.PathMPC(TWO_LINK, TwoLinkLine(), **options)


def test_a_path_that_the_arm_cannot_hold_is_refused():
    with pytest.raises(pc.TaskError, match="the arm cannot pass the posture"):
        pc.PathMPC(TWO_LINK, pc.Line([0.0, 0.0], [0.5, 0.5], 1.0))


def test_it_is_not_linearised():
    for one in (circling(), pc.SpeedOverride(circling(), 0.5)):
        with pytest.raises(pc.InputError, match="PathMPC solves an optimisation"):
            pc.floquet(one, pc.SampledLoop(0.03))
