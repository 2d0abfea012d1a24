"""Projections of the state to the motion reference: σ̇ and V̇ for any of them, and the nearest point as one case."""

from __future__ import annotations

import numpy as np
import pytest
from given_speed import Given
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import cumulative_simpson
from strategies import floats, gains, tasks, vectors

import pathcontrol as pc
from pathcontrol.analysis.lyapunov_functions import state_to_reference_lyapunov

GAINS = {"K_p": [800.0, 500.0], "K_v": [45.0, 100.0]}
PAPER = {"K_p": 800.0, "K_v": [45.0, 100.0]}
states = st.tuples(vectors(2, 2.0), vectors(2, 4.0), floats(0, 6))


class Affine(pc.StateToReferenceProjection):
    """σ = aᵀq + bᵀq̇, which has nothing to do with the path."""

    a, b = np.zeros(2), np.zeros(2)

    def reference(self, q, qd, near):
        return q @ self.a + qd @ self.b


class Nearest(pc.StateToReferenceProjection):
    """The nearest point in a metric P, by Newton's method from the last one."""

    weight = np.ones(2)

    @property
    def metric(self):
        return np.asarray(self.weight)

    def reference(self, q, qd, near):
        s = near
        for _ in range(3):
            point = self.task.at(s)
            pull = self.weight * (point.q_d - q)
            slope = (self.weight * point.dq_d**2).sum(-1) + (pull * point.ddq_d).sum(-1)
            s = s - (pull * point.dq_d).sum(-1) / slope
        return s


class Ahead(pc.StateToReferenceProjection):
    """The angle of where the arm will be in 20 ms, less what it gains meanwhile on the circle."""

    def reference(self, q, qd, near):
        later = q + 0.02 * qd
        return np.arctan2(later[..., 1], later[..., 0]) - np.arctan(0.02 * 2.0)


class Master(pc.StateToReferenceProjection):
    """Joint 1 is the clock of joint 2."""

    def reference(self, q, qd, near):
        return q[..., 0]


def run(law, q=(0.9, 0.3), duration=2.0, **settings):
    return pc.simulate(law, list(q), duration=duration, progress=False, **settings)


def circle():
    return pc.Circle(1.0, 2.0)


def wave():
    """A path q₂ = 0.4 sin 2q₁ over q₁ = s."""
    return pc.SymbolicPath(["s", "0.4*sin(2*s)"], "1.0", s0=-1.2, s_end=1.4)


@given(
    tasks(), states, gains(2, 1, 900), gains(2, 0.5, 100), vectors(2, 1), vectors(2, 0.02), floats(-2, 2), floats(-9, 9)
)
def test_rates_of_any_projection_along_the_closed_loop(ideal_arm, task, state, K_p, K_v, a, b, w, wdot):
    """σ̇ = Π_q q̇ + Π_q̇ q̈ with the q̈ that the torque makes, and V̇ as the theorem says, at any speed and its rate."""
    assume(abs(w) > 1e-3 and task.closed)
    q, qd, _ = state
    inner = Affine(ideal_arm, task, K_p, K_v)
    inner.a, inner.b = a, b
    law = pc.LawWrapper(inner, Given(w, wdot))
    s = float(q @ a + qd @ b)
    point = task.at(np.array([s]))
    assume(1 - abs(w) * np.abs(b * point.velocity_slope[0]).sum() > 0.2)
    out = law.law(0.0, q, qd, np.array([s, 1.0, 0.0, w]))
    assume(bool(out.regular))
    qdd = ideal_arm.forward_dynamics(q, qd, out.tau - ideal_arm.friction.viscous * qd)
    scale = 1 + np.abs(qd).sum() + np.abs(qdd).sum()
    assert out.sdot == pytest.approx(a @ qd + b @ qdd, abs=1e-8 * scale)
    e_p_rate = point.dq_d[0] * out.sdot - qd
    e_v_rate = w * point.velocity_slope[0] * out.sdot + wdot * point.velocity[0] - qdd
    _, Vdot = state_to_reference_lyapunov(inner.at_speed(np.array(w)), out.s, out.sdot, out.e_p, out.e_v)
    along = out.e_p @ e_p_rate + out.e_v / inner.K_p @ e_v_rate
    terms = np.abs(out.e_p * e_p_rate).sum() + np.abs(out.e_v / inner.K_p * e_v_rate).sum()
    assert abs(along - Vdot) < 1e-7 * (1 + terms)


def make(kind, arm):
    task = wave() if kind is Master else circle()
    law = kind(arm, task, **GAINS)
    law.weight = np.array([3.0, 0.5])
    return law


@pytest.mark.parametrize(("kind", "wrapped"), [(Nearest, False), (Nearest, True), (Ahead, True), (Master, True)])
def test_v_changes_along_a_run_as_lyapunov_says(ideal_arm, kind, wrapped):
    law = make(kind, ideal_arm)
    law = pc.SpeedOverride(law, lambda t: 0.8 + 0.3 * np.sin(4 * t), acceleration=3.0) if wrapped else law
    start = (-1.0, -1.0) if kind is Master else (0.9, 0.3)
    there = run(law, start, 0.4, loop=pc.ContinuousTime(output_period=2e-3))
    V, Vdot = (part[0] for part in pc.lyapunov(law, there))
    change = cumulative_simpson(Vdot, dx=2e-3, initial=0)
    assert_allclose(V, V[0] + change, rtol=0, atol=1e-3 * V[0])  # Simpson's rule: h⁴(2K_v)⁴/180
    if kind is Nearest:
        assert Vdot.max() <= 1e-12
        assert V[-1] < 1e-3 * V[0]
    if kind is Master:  # which does not meet the condition
        assert Vdot.max() > 0.01 * V[0]


def test_projection_is_the_case_of_the_nearest_point(arm):
    for task in (circle(), pc.Ellipse([1.0, 0.6], 1.5), wave()):
        begin = task.q_d(np.array(task.s0)) + np.array([0.05, -0.05])
        known, own = pc.Projection(arm, task, 800.0, PAPER["K_v"], start="s0"), Nearest(arm, task, **PAPER)
        assert isinstance(known, pc.StateToReferenceProjection)
        one, other = (run(law, begin, 0.2, engine="pinocchio") for law in (known, own))
        assert_allclose(other.array("q"), one.array("q"), rtol=0, atol=1e-6)
        assert_allclose(other.array("s"), one.array("s"), rtol=0, atol=1e-6)
        V, Vdot = pc.lyapunov(known, one)
        same = pc.lyapunov(own, other)
        # one number k_p is P, of which the other has 1; at the end of an open path the plan is timed
        assert_allclose(800.0 * same.V, V, rtol=0, atol=1e-5 * V.max())
        assert_allclose(800.0 * same.Vdot, Vdot, rtol=0, atol=1e-4 * np.abs(Vdot).max())


def test_laps_are_counted_and_a_batch_is_its_members(arm):
    law = Ahead(arm, circle(), **PAPER)
    starts = np.array([[0.9, 0.3], [-0.5, 0.8], [0.1, -1.1]])
    together = run(law, starts, 3.8, loop=pc.SampledLoop(8e-3))
    assert (np.ptp(together.array("s"), axis=1) > 2 * np.pi).all()
    assert np.abs(np.diff(together.array("s"), axis=1)).max() < 0.1
    for row, start in enumerate(starts):
        alone = run(law, start, 0.5, loop=pc.SampledLoop(8e-3)).array("q")[0]
        assert_allclose(alone, together.array("q")[row, : len(alone)], rtol=0, atol=1e-9)
    batch = Nearest(arm, pc.TaskBatch([pc.Circle(1.0, v) for v in (1.0, 2.0, 3.0)]), **PAPER)
    third = Nearest(arm, pc.Circle(1.0, 3.0), **PAPER)
    assert_allclose(run(batch, starts, 0.4).array("q")[2], run(third, starts[2], 0.4).array("q")[0], rtol=0, atol=1e-9)


def test_a_control_tick_runs_it(arm):
    law = Ahead(arm, circle(), **PAPER)
    there = run(law, duration=0.5, loop=pc.SampledLoop(2.5e-3))
    tick = pc.ControlTick(law, 2.5e-3)
    tick.start([0.9, 0.3])
    pairs = zip(there.array("q")[0], there.array("qd")[0], strict=True)
    asked = [tick(q, qd).copy() for q, qd in pairs]
    assert_allclose(asked, there.array("tau_demand")[0], rtol=0, atol=1e-6)


def test_an_open_path_is_followed_to_its_end(arm):
    there = run(Master(arm, wave(), **PAPER), (-1.2, 0.4 * np.sin(-2.4)), 8.0, loop=pc.SampledLoop(5e-3))
    assert there.status[0] == "finished"
    assert np.rad2deg(pc.contour_error(there).max()) < 3


def test_where_it_is_not_defined_the_last_one_is_kept(arm):
    class Seen(Nearest):
        def reference(self, q, qd, near):
            return np.where(q[..., 1] > 0.5, np.nan, super().reference(q, qd, near))

    law = Seen(arm, circle(), **PAPER)
    out = law.law(0.0, np.array([0.8, 0.6]), np.array([0.5, 0.5]), np.array([0.3]))
    assert not out.regular
    assert (float(out.s), float(out.sdot)) == (0.3, 0.0)
    assert np.isfinite(out.tau).all()


OWN = """
import numpy as np
import pathcontrol as pc

class Angle(pc.StateToReferenceProjection):
    def reference(self, q, qd, near):
        return np.arctan2(q[..., 1], q[..., 0])
"""
FILE = """
duration = 0.4
start = {{ q = [0.9, 0.3] }}
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 2.0
[controller]
type = "{place}:Angle"
parameters = {{ K_p = 800.0, K_v = [45.0, 100.0], friction = "full" }}
"""


def test_it_is_a_law_of_experiment_files_saved_runs_and_reports(tmp_path, arm, monkeypatch):
    """The angle of the circle is that of its nearest point, (30)."""
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    path = tmp_path / "angle.toml"
    path.write_text(FILE.format(place="own.py"), encoding="utf-8")
    there, _, _ = pc.run_experiment(path, tmp_path / "out", progress=False)
    law = pc.Projection(arm, circle(), 800.0, PAPER["K_v"], friction="full")
    assert_allclose(there.array("q"), run(law, duration=0.4, engine="pinocchio").array("q"), rtol=0, atol=1e-6)
    saved = pc.Run.load(tmp_path / "out" / "run.nc")
    assert saved.config["controller"]["controller"] == "Angle"
    assert saved.config["controller"]["K_v"] == [45.0, 100.0]
    assert_array_equal(saved.array("q"), there.array("q"))
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])
    assert "Angle" in pc.report(saved, tmp_path / "report.html").read_text(encoding="utf-8")
    swept = (
        FILE.format(place="own.py") + '[sweep.parameters]\n"controller.parameters.K_p" = { grid = [400.0, 800.0] }\n'
    )
    path.write_text(swept, encoding="utf-8")
    assert pc.run_sweep(path, tmp_path / "swept", progress=False).samples == 2


def test_bad_gains_are_told(arm):
    for bad in ({"K_p": 0.0, "K_v": 1.0}, {"K_p": 1.0, "K_v": [1.0, 2.0, 3.0]}):
        with pytest.raises(pc.InputError, match="K_"):
            Master(arm, wave(), **bad)
