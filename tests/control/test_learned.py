"""Learned: a torque over the place on the path, learned lap by lap, and forgotten where the load is another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from strategies import floats

import pathcontrol as pc
from pathcontrol.analysis.run_remarks import remarks
from pathcontrol.control.law_gains import with_gains
from pathcontrol.control.learning.learned_table import LearnedTable

CICESE = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(0.3, 3.0)  # 10 rad/s
START = CIRCLE.q_d(np.array(0.0))
LAP, PERIOD = np.pi / 5, 7e-3


class Kept(pc.Learned):
    """A learned law that keeps its last state, for a look at the table."""

    def outcome(self, z):
        self.last = self.recall(z)
        return super().outcome(z)


def law(kind=pc.Projection, arm=CICESE, **options):
    plan = {"k": 20.0} if kind is pc.ExtendedMotionPlan else {}
    return kind(arm, CIRCLE, 800.0, [45.0, 100.0], **plan, **options)


def run(controller, laps, **settings):
    settings = {"loop": pc.SampledLoop(PERIOD), "qd": CIRCLE.at(np.zeros(1)).velocity[0]} | settings
    return pc.simulate(controller, START, laps=laps, duration=3.0 * laps, progress=False, **settings)


# --- the table ---------------------------------------------------------------------------------------------


def go_round(table, memory, lap, torque, ticks=400):
    """Return the memory after a lap in which a torque of the place was seen."""
    memory = table.write(memory, np.array([float(lap)]), np.zeros((1, 1)), np.zeros(1), 0.0)
    for i in range(ticks):
        at = np.array([lap + (i + 0.5) / ticks])
        memory = table.write(memory, at, torque(at, memory)[None], np.array([1e-3]), 0.0)
    return memory


@settings(max_examples=20)
@given(floats(0.05, 1.0), floats(-0.95, 0.95))
def test_a_lap_is_the_contraction_that_is_promised(gain, change):
    """Where what is seen changes by Δ with what is added, the error shrinks by 1 − γ + γΔ."""
    table, right = LearnedTable(8, 1, gain, 1e9), 5.0
    memory = table.start(np.array([-1.0]))

    def see(at, memory):
        return right + change * (table.read(memory, at)[0] - right)

    errors = []
    for lap in range(5):
        memory = go_round(table, memory, lap, see, ticks=24)
        errors.append(table.read(memory, np.array([0.3]))[0, 0] - right)
    factor = 1 - gain + gain * change
    first = change * (0 - right)  # a node that knows nothing takes all
    assert_allclose(errors[1:], first * factor ** np.arange(4), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("wave", [1, 5, 16])
def test_what_is_kept_of_a_wave_is_its_closed_form_and_not_shifted(wave):
    table = LearnedTable(32, 1, 1.0, 1e9)
    memory = table.start(np.array([-1.0]))
    for lap in range(2):
        memory = go_round(table, memory, lap, lambda at, _: np.cos(2 * np.pi * wave * at + 0.4), ticks=1600)
    kept = np.sinc(wave / 32) ** 2  # of the averages; NumPy's sinc has the π
    expected = kept * np.cos(2 * np.pi * wave * np.arange(32) / 32 + 0.4)
    assert_allclose(table.split(memory).torque[0, :, 0], expected, atol=1e-3)


@settings(max_examples=20)
@given(st.lists(st.floats(-3, 3), min_size=30, max_size=30), floats(0.05, 1.0))
def test_the_table_never_exceeds_what_was_seen(seen, gain):
    table = LearnedTable(4, 1, gain, 0.5)
    memory = table.start(np.array([-1.0]))
    for i, torque in enumerate(seen):
        memory = table.write(memory, np.array([i / 5]), np.array([[torque]]), np.array([1e-3]), 0.0)
    assert np.abs(table.split(memory).torque).max() <= max(map(abs, seen)) + 1e-12


def test_a_table_that_no_longer_fits_is_replaced_by_the_next_lap_whatever_its_gain():
    table = LearnedTable(8, 1, 0.1, 0.4)
    memory = table.start(np.array([-1.0]))
    for lap, right in enumerate([2.0, 2.0, 2.0, 5.0, 5.0, 5.0]):
        memory = go_round(table, memory, lap, lambda at, _, right=right: np.array([right]), ticks=40)
        parts = table.split(memory)
        assert parts.forgotten == (lap > 3)  # at the end of the fourth lap, which the fifth begins
        assert_allclose(parts.torque, 0.0 if lap == 0 else 2.0 if lap < 5 else 5.0)
    assert parts.time == 0.0


@pytest.mark.parametrize("ticks", [40, 33, 24, 18])
def test_nodes_between_ticks_that_are_far_apart_have_no_gaps(ticks):
    table = LearnedTable(32, 1, 1.0, 0.5)
    memory = table.start(np.array([-1.0]))
    for lap in range(2):
        memory = go_round(table, memory, lap, lambda at, _: np.array([4.0]), ticks=ticks)
    assert_allclose(table.split(memory).torque, 4.0)


# --- what is learned ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def learned():
    """Return a law that has gone round six times, and its run."""
    controller = Kept(law(), nodes=32)
    return controller, run(controller, 6)


@pytest.fixture(scope="module")
def last_state(learned):
    """Return the state of that law at the end of its run."""
    controller, one = learned
    return pc.law_states(one, controller)[:, -1]


def test_what_is_learned_is_the_dry_friction_of_the_motion(learned):
    """Away from where a joint turns round, τ̂ is its level in the direction of the desired motion."""
    controller, _ = learned
    velocity = CIRCLE.at(controller.nodes).velocity
    for joint, (plus, minus) in enumerate(((7.17, 8.049), (1.734, 1.734))):
        moves = np.abs(velocity[:, joint]) > 1.0
        expected = np.where(velocity[:, joint] > 0, plus, -minus)
        assert_allclose(controller.last.torque[0, moves, joint], expected[moves], atol=0.03)


def test_errors_fall_to_what_the_law_leaves_without_dry_friction(learned):
    errors = pc.lap_errors(learned[1])
    free = pc.lap_errors(run(law(arm=CICESE.with_friction(pc.Viscous(CICESE.friction.viscous))), 3))
    assert errors[-1] < 0.1 * errors[1]
    assert errors[-1] < free[-1] + 1e-3
    assert learned[1].array("forgotten")[0] == 0
    assert not remarks(learned[1])


def test_the_first_lap_is_that_of_the_law_inside(learned):
    plain = run(law(), 1)
    count = len(plain.time) - 2
    assert_allclose(learned[1].array("q")[0, :count], plain.array("q")[0, :count], atol=1e-9)


@pytest.mark.parametrize("kind", [pc.ExtendedMotionPlan, pc.ComputedTorque])
def test_every_law_errs_less(kind):
    errors = pc.lap_errors(run(pc.Learned(law(kind), nodes=32), 3))
    assert errors[2] < 0.4 * errors[1]


@pytest.mark.parametrize("friction", ["full", "observed"])
def test_what_a_law_compensates_already_is_not_compensated_twice(friction):
    controller = Kept(law(friction=friction), nodes=32)
    errors = pc.lap_errors(run(controller, 3))
    assert errors[2] < 1.2 * errors[1]
    assert (np.median(np.abs(controller.last.torque[0]), axis=0) < [0.5, 0.05]).all()  # of 7.6 and 1.7 N m


def test_a_model_with_wrong_inertia_learns_too():
    heavy = CICESE.with_masses(dict.fromkeys(CICESE.joint_names, 1.3))
    errors = pc.lap_errors(run(pc.Learned(law(), nodes=32), 4, plant=heavy))
    assert errors[3] < 0.3 * errors[1]


def test_motors_at_their_limits_wind_nothing_up(learned):
    """What the motors cannot give is no disturbance: where they saturate the table is the friction, and no more."""
    limits = 0.8 * np.abs(learned[1].array("tau_demand")[0, -120:]).max(0)
    controller = Kept(law(), nodes=32)
    limited = run(controller, 3, loop=pc.SampledLoop(PERIOD, torque_limits=limits))
    assert (np.abs(limited.array("tau_demand")[0, -120:]) > limits).any(0).all()
    assert (np.abs(controller.last.torque[0]).max(0) < [9.0, 2.2]).all()


def test_the_table_of_a_run_is_found_again(learned):
    controller, one = learned
    early = one.excerpt(np.arange(1), round(2.4 * LAP / PERIOD))
    again = pc.Learned(law(), nodes=32)
    table = again.recall(pc.law_states(early, again)[0, -1])
    assert (table.lap, table.known.sum()) == (2, 32)
    assert_allclose(table.torque, controller.last.torque[0], atol=2.0)  # learned once, where joints turn round too


# --- what must not disturb it, and what it forgets ----------------------------------------------------------


def test_a_hold_and_a_way_back_leave_the_table_as_it_is(learned):
    """The plan is held for 0.4 s in the third lap, and goes back in the fourth."""
    steps = [[2.3 * LAP, 0.0], [2.3 * LAP + 0.4, 1.0], [3.5 * LAP + 0.4, -1.0], [3.7 * LAP + 0.4, 1.0]]
    controller = Kept(pc.SpeedOverride(law(), steps, acceleration=10.0), nodes=32)
    disturbed = run(controller, 5)
    assert pc.speed_factor(disturbed)[0].min() < 0
    away = np.abs(controller.last.torque - learned[0].last.torque)[0]
    assert (np.sqrt((away**2).mean(0)) < [0.35, 0.08]).all()  # a twentieth of 7.6 and 1.7 N m
    assert pc.lap_errors(disturbed)[-1] < 0.1 * pc.lap_errors(learned[1])[1]
    assert disturbed.array("forgotten")[0] == 0


@pytest.mark.parametrize(("factor", "share"), [(0.5, 1.0), (-0.05, 0.5), (-1.0, 0.0)])
def test_a_plan_that_goes_back_has_none_of_what_was_learned(learned, last_state, factor, share):
    controller, one = learned
    inner = controller.inner.at_speed(np.array([factor]))
    own, _ = controller.split(last_state)
    state = one.time[-1], one.array("q")[:, -1], one.array("qd")[:, -1]
    added = inner.law(*state, own).tau - inner.base.law(*state, inner.split(own)[0]).tau
    whole = controller.inner.law(*state, own).tau - controller.inner.base.law(*state, inner.split(own)[0]).tau
    assert np.abs(whole).max() > 1.0
    # the middle of the period to come, at which the table is read, is elsewhere at another speed
    assert_allclose(added, share * whole, atol=0.3 if share else 1e-9)


def test_a_load_that_is_picked_up_is_noticed_forgotten_and_learned(tmp_path):
    load = pc.PickUp(1.0, "tool", 3.2 * LAP)
    one = run(pc.Learned(law(), nodes=32), 8, disturbance=load)
    assert one.array("forgotten").tolist() == [1]
    when = one.array("forgotten_time")[0]
    assert 3.2 * LAP < when < 5.2 * LAP
    said = next(sentence for sentence in remarks(one) if "forgotten" in sentence)
    assert f"forgotten at {when:.4g} s" in said
    errors = pc.lap_errors(one)
    assert errors[-1] < 0.25 * errors.max()
    saved = pc.Run.load(one.save(tmp_path / "run.nc"))
    assert saved.array("forgotten_time")[0] == when
    assert said in remarks(saved)


# --- where it runs -----------------------------------------------------------------------------------------


def test_wrappers_inside_and_outside_are_the_same():
    inside = run(pc.Learned(pc.SpeedOverride(law(), 0.95), nodes=32), 1)
    outside = run(pc.SpeedOverride(pc.Learned(law(), nodes=32), 0.95), 1)
    assert_allclose(inside.array("q"), outside.array("q"), atol=1e-9)
    assert inside.config["controller"]["controller"] == "Learned(SpeedOverride(Projection))"


def test_with_other_gains_it_learns_as_before():
    other = with_gains(pc.Learned(law(), 0.7, nodes=32), {"k_p": 900.0})
    assert other.describe() == pc.Learned(pc.Projection(CICESE, CIRCLE, 900.0, [45.0, 100.0]), 0.7, 32).describe()
    assert other.start(START, np.zeros(2)).shape == pc.Learned(law(), nodes=32).start(START, np.zeros(2)).shape


def test_a_rollout_of_a_batch_is_what_it_is_alone():
    """Each has its own path: the other one ends its laps at other times."""
    paths = [CIRCLE, pc.Circle(0.3, 2.5)]
    together = pc.Learned(pc.Projection(CICESE, pc.TaskBatch(paths), 800.0, [45.0, 100.0]), nodes=32)
    loop = pc.SampledLoop(PERIOD)
    both = pc.simulate(together, np.tile(START, (2, 1)), duration=1.0, loop=loop, progress=False)
    for i, path in enumerate(paths):
        alone = pc.Learned(pc.Projection(CICESE, path, 800.0, [45.0, 100.0]), nodes=32)
        one = pc.simulate(alone, START, duration=1.0, loop=loop, progress=False)
        assert_allclose(both.array("q")[i], one.array("q")[0], atol=1e-9)
    assert both.array("forgotten").shape == (2,)


def test_a_tick_says_what_the_simulation_said():
    one = run(pc.Learned(law(), nodes=32), 3, loop=pc.SampledLoop(PERIOD, torque_limits=True))
    tick = pc.ControlTick(pc.Learned(law(), nodes=32), PERIOD)
    tick.start(START, CIRCLE.at(np.zeros(1)).velocity[0])
    for k in range(len(one.time)):
        tau = tick(one.array("q_measured")[0, k], one.array("qd_measured")[0, k])
        assert_allclose(tau, one.array("tau_demand")[0, k], atol=1e-9)
    assert np.abs(tick.law.recall(tick.state).torque).max() > 7.0
    tick.hold()


def test_a_control_loop_drives_it():
    loop = pc.ControlLoop(pc.Learned(law(), nodes=32), 2.5e-3)
    loop.start(START)
    for k in range(20):
        tau = loop.step(START, np.zeros(2), k * 2.5e-3)
        assert np.isfinite(tau).all()
    loop.hold()
    loop.step(START, np.zeros(2), 0.05)
    assert loop.outcome["forgotten"].tolist() == [0]


def test_a_sequence_learns_on_each_path_and_says_what_was_forgotten():
    laws = [pc.Learned(law(), nodes=32), pc.Learned(law(), nodes=32)]
    joined = pc.simulate_sequence(laws, START, duration=10.0, laps=2, loop=pc.SampledLoop(PERIOD), progress=False)
    assert joined.array("forgotten").tolist() == [0]
    assert np.isnan(joined.array("forgotten_time")).all()
    assert joined.status[0] == "finished"


FILE = """
duration = 1.3
loop.period = 5e-3
robot.source = "cicese_2dof"
task = { type = "circle", radius = 0.3, speed = 3.0 }
[controller]
type = "learned"
learning_gain = 0.7
nodes = 64
misfit = 0.3
law = { type = "projection", k_p = 800.0, K_v = [45.0, 100.0] }
"""


def test_a_file_names_it(tmp_path):
    path = tmp_path / "learned.toml"
    path.write_text(FILE, encoding="utf-8")
    one, _, _ = pc.run_experiment(path, tmp_path / "out", progress=False)
    said = pc.Run.load(tmp_path / "out" / "run.nc").config["controller"]
    assert said == one.config["controller"]
    assert said["controller"] == "Learned(Projection)"
    assert (said["learning_gain"], said["nodes"], said["misfit"]) == (0.7, 64, 0.3)
    assert "override" not in said


@pytest.mark.parametrize("change", ["learning_gain = 1.5", "learning_gain = 0.0", "nodes = 3", "misfit = -1.0"])
def test_mistakes_are_told_by_their_keys(tmp_path, change):
    name = change.partition(" ")[0]
    path = tmp_path / "bad.toml"
    path.write_text("\n".join(change if line.startswith(name) else line for line in FILE.splitlines()))
    with pytest.raises(pc.ExperimentError, match=name):
        pc.run_experiment(path, tmp_path / "out", progress=False)


def test_what_cannot_be_learned_is_refused():
    line = pc.ComputedTorque(CICESE, pc.Line([0, 0], [1, 1], 1.0), 800.0, 57.0)
    with pytest.raises(pc.TaskError, match="Line is not closed"):
        pc.Learned(line)
    with pytest.raises(pc.InputError, match="already"):
        pc.Learned(pc.SpeedOverride(pc.Learned(law())))
    with pytest.raises(pc.InputError, match="give the law inside"):
        pc.floquet(pc.Learned(law(arm=CICESE.with_friction(None))), pc.SampledLoop())
    with pytest.raises(pc.InputError, match="SampledLoop"):
        pc.simulate(pc.Learned(law()), START, duration=0.1, loop=pc.ContinuousTime(), progress=False)


@pytest.mark.parametrize("z", ["a", 1.0, [], [1.0, 2.0], np.zeros((3, 4))])
def test_a_table_is_recalled_from_states_of_its_law_alone(z):
    with pytest.raises(pc.PathControlError, match=r"^z "):
        pc.Learned(law()).recall(z)


def test_v_is_that_of_the_law_inside():
    one = run(pc.Learned(law(), nodes=32), 1)
    for mine, inside in zip(pc.lyapunov(pc.Learned(law()), one), pc.lyapunov(law(), one), strict=True):
        assert_array_equal(mine, inside)
