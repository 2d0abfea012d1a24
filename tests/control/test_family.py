"""The laws of other sources, each as any law: batches, both engines, files, saved runs, reports and control loops."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import pathcontrol as pc
from pathcontrol.engine.run_settings import GAINS
from pathcontrol.experiments.runner import load_setup
from pathcontrol.hardware.control_loop import ControlLoop
from pathcontrol.hardware.envelope import Envelope
from pathcontrol.registry import LAWS
from pathcontrol.view.report.reproduction import recipe

#: gains of each law, by its name in files
FAMILY = {
    "adaptive_slotine_li": {"Lambda": 10.0, "K_d": [40.0, 4.0], "adaptation": 0.1, "k": 20.0},
    "passive_velocity_field": {"Lambda": 10.0, "K_v": 30.0, "recharge": 5.0, "energy": 30.0, "approach": 1.5},
    "transverse_linearization": {"k_p": 300.0, "k_v": 40.0, "k_s": 30.0},
    "maneuver_regulation": {"K_p": 300.0, "K_v": [40.0, 50.0]},
}
WIDE = {"torque": 1e6, "torque_rate": 1e12, "velocity": 1e3, "lower": -1e3, "upper": 1e3, "tube": np.inf}
START = np.array([0.8, 0.3])


def law_of(name, arm, task, **options):
    return LAWS.find(name)(arm, task, **FAMILY[name], **options)


def run_of(law, q=START, duration=0.25, **options):
    return pc.simulate(law, q, duration=duration, progress=False, **options)


@pytest.mark.parametrize("name", FAMILY)
def test_a_rollout_is_the_same_alone_and_in_a_batch(arm, circle, name):
    law, q = law_of(name, arm, circle), np.array([[0.8, 0.3], [0.9, -0.1], [1.1, 0.1]])
    many = run_of(law, q, duration=0.1)
    for i in range(3):
        assert_array_equal(run_of(law, q[i], duration=0.1).array("q")[0], many.array("q")[i])


@pytest.mark.parametrize("name", FAMILY)
def test_each_rollout_has_its_own_gains_and_its_own_task(arm, circle, name):
    law, q = law_of(name, arm, circle), np.array([[0.8, 0.3], [0.9, -0.1]])
    kind, small = type(law), pc.Ellipse((1.0, 0.8), 1.5)
    rows = {key: np.stack([np.multiply(value, 1.1), value]) for key, value in FAMILY[name].items()}
    rows = {key: value[:, None] if value.ndim == 1 else value for key, value in rows.items()}
    both = run_of(kind(arm, pc.TaskBatch([small, circle]), **rows), q, duration=0.1)
    assert_array_equal(run_of(law, q[1], duration=0.1).array("q")[0], both.array("q")[1])
    one = kind(arm, small, **{key: value[0] if value.shape[1] > 1 else value[0, 0] for key, value in rows.items()})
    assert_array_equal(run_of(one, q[0], duration=0.1).array("q")[0], both.array("q")[0])


@pytest.mark.parametrize("name", FAMILY)
def test_the_plant_is_compiled_and_the_run_says_why_the_law_is_not(arm, circle, name):
    law = law_of(name, arm, circle)
    fast, slow = run_of(law), run_of(law, engine="pinocchio")
    assert fast.config["engine"] == "compiled"
    reason = f"only the plant is compiled: the law {type(law).__name__} is in Python; compiled are "
    assert fast.config["engine_reason"] == reason + ", ".join(one.__name__ for one in GAINS)
    np.testing.assert_allclose(fast.array("q"), slow.array("q"), atol=1e-9)


@pytest.mark.parametrize("name", FAMILY)
def test_files_saved_runs_and_scripts_of_reports_know_it(arm, name, tmp_path, write_experiment, monkeypatch):
    setup = load_setup(write_experiment({"controller": {"type": name, **FAMILY[name]}}))
    known = law_of(name, arm, pc.Circle(1.0, 2.0)).describe()
    assert setup.controllers[0].describe() == known | {"task": setup.task.describe()}
    run = run_of(setup.controllers[0], duration=0.05)
    monkeypatch.chdir(tmp_path)
    run.save("mine.nc")
    loaded = pc.Run.load("mine.nc")
    assert loaded.config["controller"] == run.config["controller"]
    namespace = {}
    exec(recipe("mine", loaded).text, namespace)
    assert_array_equal(namespace["run"].array("q"), run.array("q"))


@pytest.mark.parametrize("name", FAMILY)
def test_measurements_of_a_run_give_its_torques_in_a_control_loop(arm, circle, name):
    law = law_of(name, arm, circle)
    run = run_of(law, duration=0.1, loop=pc.SampledLoop(2e-3))
    loop = ControlLoop(law, 2e-3, Envelope(**WIDE))
    loop.start(START, np.zeros(2))
    q, qd, tau = (run.array(key)[0] for key in ("q_measured", "qd_measured", "tau_demand"))
    for k, t in enumerate(run.time):
        assert_array_equal(loop.step(q[k], qd[k], t), tau[k])


@pytest.mark.parametrize("name", FAMILY)
def test_an_open_path_is_finished_at_its_end(ideal_arm, name):
    line = pc.Line([0.2, 0.3], [0.5, 0.1], 0.8)
    start = line.q_d(np.array(0.0)) + 0.01
    run = run_of(law_of(name, ideal_arm, line), start, duration=2.0, loop=pc.SampledLoop(5e-3))
    assert run.status[0] == "finished"
    np.testing.assert_allclose(run.array("q")[0, -1], [0.5, 0.1], atol=2e-3)


@pytest.mark.parametrize("name", FAMILY)
def test_an_operator_overrides_its_speed(ideal_arm, circle, name):
    law = pc.SpeedOverride(law_of(name, ideal_arm, circle, start="nearest"), 0.5)
    run = run_of(law, [1.0, 0.0], duration=0.8, loop=pc.SampledLoop(5e-3))
    assert run.array("sdot")[0, -1] == pytest.approx(0.5 * circle.theta(np.array(0.0)), rel=0.03)


@pytest.mark.parametrize("name", list(FAMILY)[1:])  # the 25 multipliers of the adaptive one take seconds
def test_its_multipliers_on_the_circle_are_those_of_a_stable_orbit(ideal_arm, circle, name):
    found = pc.floquet(law_of(name, ideal_arm, circle))
    assert abs(found.multipliers[found.along] - 1) < 1e-4
    assert (np.abs(found.multipliers) < 1 + 1e-4).all()


# --- their states -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAMILY)
def test_the_states_of_a_saved_run_are_those_that_the_law_had(arm, circle, name, tmp_path):
    law, seen = law_of(name, arm, circle), []
    inner = law.law
    law.law = lambda t, q, qd, z: seen.append(z) or inner(t, q, qd, z)
    loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True, delay=1e-3)
    run_of(law, duration=0.1, loop=loop).save(tmp_path / "run.nc")
    run = pc.Run.load(tmp_path / "run.nc")
    found = pc.law_states(run)[0]
    np.testing.assert_allclose(found, np.concatenate(seen)[-len(run.time) :], rtol=1e-9, atol=1e-12)


def test_states_of_a_wrapped_law_ask_for_the_law(arm, circle):
    law = pc.SpeedOverride(law_of("adaptive_slotine_li", arm, circle), 0.5)
    run = run_of(law, duration=0.05)
    with pytest.raises(pc.InputError, match=r"is SpeedOverride\(AdaptiveSlotineLi\), a law that is wrapped"):
        pc.law_states(run)
    states = pc.law_states(run, law)
    assert states.shape[:2] == (1, len(run.time))
    np.testing.assert_allclose(states[..., 0], run.array("s"), rtol=1e-12)


# --- their Lyapunov functions ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["transverse_linearization", "maneuver_regulation"])
def test_V_of_a_run_falls_as_its_theorem_says_while_its_speed_is_turned_down(ideal_arm, circle, name):
    law, q = pc.SpeedOverride(law_of(name, ideal_arm, circle), 0.5), np.array([[1.1, 0.1], [0.9, -0.2]])
    run = run_of(law, q, loop=pc.ContinuousTime(output_period=2e-4, rtol=1e-10, atol=1e-11), duration=0.06)
    V, Vdot = pc.lyapunov(law, run)
    slope = (V[:, 2:] - V[:, :-2]) / (run.time[2:] - run.time[:-2])
    np.testing.assert_allclose(slope, Vdot[:, 1:-1], rtol=1e-3, atol=1e-4 * np.abs(Vdot).max())
    assert (V > 0).all()
    assert (np.diff(V) <= 0).all()
    assert pc.speed_factor(run)[0, -1] < 0.95


def test_the_power_balance_of_maneuver_regulation_closes(ideal_arm, circle):
    law = law_of("maneuver_regulation", ideal_arm, circle)
    plant = ideal_arm.with_payload(0.5, "tool")
    run = run_of(law, [1.05, 0.1], loop=pc.SampledLoop(1e-3), plant=plant, duration=0.2)
    balance = pc.power_balance(run)
    assert np.abs(balance.model).max() > 100 * np.abs(balance.residual).max()
    free = pc.power_balance(run_of(law, [1.05, 0.1], loop=pc.SampledLoop(1e-3), duration=0.2))
    assert np.abs(free.model).max() < 1e-9 * np.abs(free.predicted).max()
    np.testing.assert_allclose(free.measured, free.predicted + free.sampling, atol=2e-3 * np.abs(free.predicted).max())
