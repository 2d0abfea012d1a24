"""What classes take, files can say: the object of a section is the one that Python makes of the same arguments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from experiment_files import BASE, document, merged
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc
from pathcontrol import ExperimentError
from pathcontrol.experiments.runner import load_setup, run_experiment
from pathcontrol.experiments.samples.dotted_keys import put
from pathcontrol.experiments.samples.swept_experiment import SweptExperiment

RIGHT = math.pi / 2


@pytest.fixture
def setup(tmp_path):
    """A function that builds the base experiment with changes."""

    def setup(changes: dict):
        file = tmp_path / "experiment.toml"
        file.write_text(document(merged(BASE, changes)), encoding="utf-8")
        return load_setup(file)

    return setup


# --- paths ----------------------------------------------------------------------------------------------------

POINTS = [[0.1, 0.2], [0.8, 0.3], [0.5, 1.0], [0.2, 0.7]]
STROKE = pc.ToolCurve.line([0.55, -0.05, 0.7], [0.65, -0.05, 0.75])
TASKS = {
    "waypoints": (
        {"type": "waypoint_path", "points": POINTS, "speed": 0.5, "closed": True, "tolerance": 0.05},
        lambda arm: pc.WaypointPath(POINTS, 0.5, closed=True, tolerance=0.05),
    ),
    "waypoints in time": (
        {"type": "WaypointPath", "points": POINTS, "speed": 0.5, "parametrisation": [0.0, 1.0, 3.0, 4.0]},
        lambda arm: pc.WaypointPath(POINTS, 0.5, parametrisation=[0.0, 1.0, 3.0, 4.0]),
    ),
    "formulas": (
        {"type": "symbolic_path", "q_d": ["a*sin(u/2)", 0.3], "theta": "1 + u/9", "s": "u", "s_end": 2.0}
        | {"parameters": {"a": 0.7}},
        lambda arm: pc.SymbolicPath(["a*sin(u/2)", 0.3], theta="1 + u/9", s="u", s_end=2.0, parameters={"a": 0.7}),
    ),
    "formulas at a speed": (
        {"type": "symbolic_path", "q_d": ["cos(s)", "sin(s)"], "speed": 0.5, "period": 2 * math.pi},
        lambda arm: pc.SymbolicPath(["cos(s)", "sin(s)"], 0.5, period=2 * math.pi),
    ),
    "curve in space": (
        {
            "type": "cartesian_path",
            "frame": "tool",
            "curve": {"type": "line", "start": [0.55, -0.05, "70 cm"], "end": [0.65, -0.05, 0.75]},
        }
        | {"speed": 0.2, "tolerance": 1e-4, "start": [0.4, 1.0]},
        lambda arm: pc.CartesianPath(
            arm,
            "tool",
            pc.ToolCurve.line([0.55, -0.05, 0.7], [0.65, -0.05, 0.75]),
            speed=0.2,
            tolerance=1e-4,
            start=[0.4, 1.0],
        ),
    ),
}


@pytest.mark.parametrize("name", TASKS)
def test_paths_are_those_of_python(name, setup, arm):
    section, by_hand = TASKS[name]
    task, expected = setup({"task": section, "start": {}}).controller.task, by_hand(arm)
    assert type(task) is type(expected)
    s = np.linspace(*expected.sampled_interval, 40)
    assert_array_equal(task.q_d(s), expected.q_d(s))
    assert_array_equal(task.theta(s), expected.theta(s))


SQUARE = [[0.4, 0.0, 0.4], [0.5, 0.0, 0.4], [0.5, 0.1, 0.4], [0.4, 0.1, 0.4], [0.3, 0.05, 0.4]]
CURVES = {
    "points": (SQUARE, lambda: pc.ToolCurve.spline(SQUARE)),
    "line": (
        {"type": "line", "start": [0.4, 0.1, 0.4], "end": [0.5, -0.1, 0.5]},
        lambda: pc.ToolCurve.line([0.4, 0.1, 0.4], [0.5, -0.1, 0.5]),
    ),
    "circle": (
        {"type": "circle", "center": [0.45, 0.0, "40 cm"], "radius": "50 mm", "normal": [0.0, 1.0, 1.0]},
        lambda: pc.ToolCurve.circle([0.45, 0.0, 0.4], 0.05, normal=[0.0, 1.0, 1.0]),
    ),
    "spline": (
        {"type": "spline", "points": SQUARE, "closed": True},
        lambda: pc.ToolCurve.spline(SQUARE, closed=True),
    ),
    "polyline": (
        {"type": "polyline", "points": SQUARE, "tolerance": 1e-3},
        lambda: pc.ToolCurve.polyline(SQUARE, 1e-3),
    ),
}


@pytest.mark.parametrize("name", CURVES)
def test_curves_of_tools_are_those_of_python(name, setup, monkeypatch):
    section, by_hand = CURVES[name]
    made = []
    monkeypatch.setattr(
        "pathcontrol.cartesian.cartesian_path.solve", lambda constraint, *rest: made.append(constraint.curve)
    )
    with pytest.raises(ExperimentError):  # nothing is solved
        setup({"task": {"type": "cartesian_path", "frame": "tool", "curve": section}, "start": {}})
    s = np.linspace(made[0].s0, made[0].s_end, 40)
    assert_array_equal(made[0].position(s), by_hand().position(s))


# --- profiles ---------------------------------------------------------------------------------------------------

LINE = pc.Line([0.2, 0.1], [1.2, 0.9], 0.5)
LIMITED = {
    "joints": (
        {"type": "limited", "velocity": [1.0, 0.3], "tangential": 3.0},
        lambda arm: pc.limited(LINE, pc.MotionLimit(tangential=3.0), velocity=[1.0, 0.3]),
    ),
    "the joints of the robot": (
        {"type": "limited", "velocity": True},
        lambda arm: pc.limited(LINE, velocity=arm.limits.velocity),
    ),
    "a tool": (
        {"type": "limited", "frame": "tool", "speed": 0.2, "normal": 1.0, "control_period": 1e-3, "chord_error": 1e-6},
        lambda arm: pc.limited(
            LINE, pc.MotionLimit(pc.ToolMotion(arm, "tool"), 0.2, normal=1.0, control_period=1e-3, chord_error=1e-6)
        ),
    ),
    "torques": (
        {"type": "time_optimal", "torque": [120.0, 12.0], "velocity": [2.0, 1.0], "acceleration": [9.0, 9.0]}
        | {"margin": 0.0, "end_time": 0.1, "points": 200},
        lambda arm: pc.time_optimal(
            arm,
            LINE,
            torque=[120.0, 12.0],
            velocity=[2.0, 1.0],
            acceleration=[9, 9],
            margin=0,
            end_time=0.1,
            points=200,
        ),
    ),
    "no torques": (
        {"type": "time_optimal", "torque": False, "velocity": [2.0, 1.0], "acceleration": [9.0, 9.0]},
        lambda arm: pc.time_optimal(arm, LINE, torque=None, velocity=[2.0, 1.0], acceleration=[9.0, 9.0]),
    ),
    "free ends": (
        {"type": "time_optimal", "start_rate": "free", "end_rate": "free", "points": 200},
        lambda arm: pc.time_optimal(arm, LINE, start_rate="free", end_rate="free", points=200),
    ),
    "a given start and a free end": (
        {"type": "time_optimal", "start_rate": "0.5 1/s", "end_rate": "free", "points": 200},
        lambda arm: pc.time_optimal(arm, LINE, start_rate=0.5, end_rate="free", points=200),
    ),
    "a smooth stop": (
        {"type": "smooth_start_stop", "profile": {"type": "constant_speed", "speed": 0.4}, "acceleration": 2.0}
        | {"jerk": 20.0},
        lambda arm: pc.SmoothStartStop(LINE, pc.ConstantSpeed(0.4), 2.0, 20.0),
    ),
    "a smooth stop of a tool": (
        {"type": "smooth_start_stop", "profile": {"type": "tool_speed", "frame": "tool", "speed": 0.1}}
        | {"acceleration": 0.5, "jerk": 5.0, "motion": {"type": "tool_motion", "frame": "tool"}},
        lambda arm: pc.SmoothStartStop(
            LINE, pc.ToolSpeed(arm, "tool", 0.1), 0.5, 5.0, motion=pc.ToolMotion(arm, "tool")
        ),
    ),
}


@pytest.mark.parametrize("name", LIMITED)
def test_profiles_are_those_of_python(name, setup, arm):
    section, by_hand = LIMITED[name]
    line = {"type": "line", "start": [0.2, 0.1], "end": [1.2, 0.9], "speed": 0.5}
    task = setup({"task": line | {"profile": section}, "start": {}}).controller.task
    s = np.linspace(task.s0, task.s_end, 60)
    assert_array_equal(task.theta(s), by_hand(arm).theta(LINE, s))


# --- what is beside the arm -------------------------------------------------------------------------------------


def test_disturbances_add_up_and_noise_is_that_of_the_sensors(tmp_path, arm):
    push = {"type": "push", "magnitude": [9.0, -2.0], "start": 0.01, "duration": "20 ms"}
    force = {"type": "frame_force", "frame": "tool", "force": [0.0, "1 N", -9.0]}
    wave = {"type": "harmonic", "amplitude": [1.0, 0.5], "frequency": "0.01 kHz", "phase": "90 deg"}
    noise = {"position": [1e-4, 2e-4], "velocity": 1e-3, "seed": 7}
    file = tmp_path / "pushed.toml"
    changes = {"disturbance": [push, force, wave], "loop.noise": noise, "until": "duration"}
    file.write_text(document(merged(BASE, changes)), encoding="utf-8")
    run = run_experiment(file, tmp_path / "out", progress=False).run
    outside = pc.Push([9.0, -2.0], 0.01, 0.02) + pc.FrameForce(arm, "tool", [0.0, 1.0, -9.0])
    outside = outside + pc.Harmonic([1.0, 0.5], 10.0, RIGHT)
    law = pc.ExtendedMotionPlan(arm, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    loop = pc.SampledLoop(noise=pc.SensorNoise([1e-4, 2e-4], 1e-3, 7))
    by_hand = pc.simulate(law, [0.7, 1.2], duration=0.05, disturbance=outside, loop=loop, until="duration")
    assert run.data.equals(by_hand.data)
    assert run.config == by_hand.config | {"experiment": file.read_text(encoding="utf-8")}


def test_a_run_goes_on_until_its_duration(tmp_path):
    line = {"type": "line", "start": [0.7, 1.2], "end": [0.6, 1.1], "speed": 1.0}
    ended = {}
    for until in ("end", "duration"):
        file = tmp_path / f"{until}.toml"
        file.write_text(document(merged(BASE, {"task": line, "duration": 2.0, "until": until})), encoding="utf-8")
        ended[until] = run_experiment(file, tmp_path / until, progress=False).run.time[-1]
    assert ended["end"] < 1.5
    assert ended["duration"] == pytest.approx(2.0)


SWEPT = {
    "disturbance[0].magnitude": np.array([[9.0, -2.0], [3.0, 1.0], [1.0, 0.0], [1.0, 0.0]]),
    "disturbance[0].start": np.array([0.0, 0.01, 0.02, 0.02]),
    "disturbance[1].frame": np.array(["tool", "tool", "tool", "link_2"]),
    "disturbance[1].force[2]": np.array([-9.0, 3.0, 0.0, 0.0]),
    "controller.K_p": np.array([800.0, 500.0, 400.0, 400.0]),
}


def test_disturbances_vary_within_the_batches_of_a_sweep(tmp_path):
    push = {"type": "push", "magnitude": [9.0, -2.0], "start": 0.01, "duration": 0.02}
    force = {"type": "frame_force", "frame": "tool", "force": [0.0, 1.0, -9.0]}
    data = merged(BASE, {"disturbance": [push, force]})
    parts = SweptExperiment(data, tmp_path)(SWEPT, np.arange(4))
    assert [rows.tolist() for rows, _ in parts] == [[0, 1, 2], [3]]
    for rows, arguments in parts:
        run = pc.simulate(**arguments, progress=False)
        for i, row in enumerate(rows):
            one = merged(data, {})
            for key, values in SWEPT.items():
                put(one, key, values[row].tolist())
            (tmp_path / "one.toml").write_text(document(one), encoding="utf-8")
            alone = run_experiment(tmp_path / "one.toml", tmp_path / "out", progress=False).run
            assert_allclose(run.array("q")[i], alone.array("q")[0], rtol=0, atol=1e-13)


FRICTION = [
    ({"type": "viscous", "coefficients": [1.0, "2 N m s/rad"]}, pc.Viscous([1.0, 2.0])),
    ({"type": "coulomb", "plus": [3.0, 4.0], "minus": [5.0, 6.0]}, pc.Coulomb([3.0, 4.0], [5.0, 6.0])),
    (
        [
            {"type": "viscous", "coefficients": [1.0, 2.0]},
            {"type": "stribeck", "coulomb": [1, 1], "static": [2, 2], "velocity": [0.1, 0.1]},
        ],
        pc.Viscous([1.0, 2.0]) + pc.Stribeck([1, 1], [2, 2], [0.1, 0.1]),
    ),
]


@pytest.mark.parametrize(("section", "law"), FRICTION)
def test_friction_laws_by_their_type(section, law, setup):
    assert setup({"plant": {"friction": section}}).plant.friction.describe() == law.describe()


# --- units ------------------------------------------------------------------------------------------------------

ANGLES = {
    "task": {"type": "waypoint_path", "points": POINTS, "speed": 0.5, "tolerance": 0.05},
    "task.profile": {"type": "limited", "velocity": [1.0, 0.5]},
    "loop": {"noise": {"position": [0.01, 0.02], "velocity": 0.3}},
    "disturbance": {"type": "harmonic", "amplitude": [1.0, 1.0], "frequency": 2.0, "phase": RIGHT},
    "start": {},
}


def scaled(value, factor, key=""):
    """Every number times ``factor``, but for those that are no angles."""
    if isinstance(value, dict):
        return {k: scaled(v, factor, k) for k, v in value.items()}
    if isinstance(value, list):
        return [scaled(v, factor, key) for v in value]
    return value * factor if isinstance(value, float) and key not in ("amplitude", "frequency") else value


def test_angles_are_in_the_unit_of_the_file(setup):
    radians = setup(ANGLES)
    degrees = setup(scaled(ANGLES, 180 / math.pi) | {"angle_unit": "deg"})
    s = np.linspace(0.0, radians.task.s_end, 30)
    assert_allclose(degrees.task.q_d(s), radians.task.q_d(s), rtol=1e-12)
    assert_allclose(degrees.task.theta(s), radians.task.theta(s), rtol=1e-9)
    for name in ("position", "velocity"):
        assert_allclose(getattr(degrees.loop.noise, name), getattr(radians.loop.noise, name), rtol=1e-14)
    assert degrees.disturbance.phase == pytest.approx(RIGHT, rel=1e-15)


# --- mistakes -----------------------------------------------------------------------------------------------------

BAD = {
    "no such path": (
        {"task.type": "waypoint_paht"},
        "'waypoint_paht', expected one of 'circle'",
        "mean 'waypoint_path'",
    ),
    "unknown key": (
        {"task": {"type": "waypoint_path", "points": POINTS, "sped": 1.0}},
        "task.sped: unknown key; did you mean 'speed'?",
    ),
    "no points": (
        {"task": {"type": "waypoint_path", "points": 3.0, "speed": 1.0}},
        "expected a list of lists of finite",
    ),
    "formula": (
        {"task": {"type": "symbolic_path", "q_d": ["x", "s"], "speed": 1.0, "s_end": 1.0}},
        "task.q_d[0] = 'x': ",
    ),
    "choice or numbers": (
        {"task": {"type": "waypoint_path", "points": POINTS, "speed": 1.0, "parametrisation": "chrd"}},
        "task.parametrisation = 'chrd', expected one of 'centripetal', 'chord', 'uniform', or a list of finite",
    ),
    "profile in a profile": (
        {"task.profile": {"type": "smooth_start_stop", "profile": {"type": "constant_sped"}, "acceleration": 1.0}},
        "task.profile.profile.type = 'constant_sped', expected one of 'constant_rate'",
    ),
    "orientation": (
        {"task": {"type": "cartesian_path", "frame": "tool", "curve": POINTS, "orientation": "kept"}},
        "task.orientation = 'kept', expected one of 'keep', or a table with the key 'type'; did you mean 'keep'?",
    ),
    "torque limits": (
        {"task.profile": {"type": "time_optimal", "torque": [1.0, -1.0]}},
        "task.profile.torque = [1.0, -1.0], expected true, false or a list with one number above 0",
    ),
    "a free end": (
        {"task.profile": {"type": "time_optimal", "end_rate": "fre"}},
        "task.profile.end_rate = 'fre', expected one of 'free', or a number greater than 0; did you mean 'free'?",
    ),
    "acceleration of a URDF": (
        {"task.profile": {"type": "time_optimal", "acceleration": True}},
        "task.profile.acceleration = True, but a URDF has no acceleration limits",
    ),
    "noise": (
        {"loop.noise": {"position": -1.0}},
        "loop.noise.position = -1.0, expected a number not below 0, or a list",
    ),
    "noise of 3 joints": ({"loop.noise": {"position": [0.1, 0.1, 0.1]}}, "loop.noise of the position has shape (3,)"),
    "noise of what": (
        {"loop.noise": {"positions": 1.0}},
        "loop.noise.positions: unknown key; did you mean 'position'?",
    ),
    "disturbance": ({"disturbance": {"type": "pus"}}, "disturbance.type = 'pus', expected one of 'push'"),
    "disturbances": (
        {"disturbance": [{"type": "push", "magnitude": [1.0, 1.0]}, {"type": "push", "magnitude": [1.0]}]},
        "disturbance[1]: Push.torque has shape (1,), expected (1, 2)",
    ),
    "second disturbance": (
        {"disturbance": [{"type": "push", "magnitud": 1.0}]},
        "disturbance[0].magnitud: unknown key; did you mean 'magnitude'?",
    ),
    "no disturbance": ({"disturbance": []}, "disturbance = [], expected a table with the key 'type'"),
    "frame": (
        {"disturbance": {"type": "frame_force", "frame": "hand", "force": [0.0, 0.0, 1.0]}},
        "disturbance: cicese_2dof has no frame 'hand'",
    ),
    "unit": (
        {"disturbance": {"type": "push", "magnitude": ["1 N", "1 N m"]}},
        "disturbance.magnitude[0] = '1 N', expected a finite quantity in N m (Nm)",
    ),
    "until": ({"until": "ende"}, "until = 'ende', expected 'end' or 'duration'; did you mean 'end'?"),
    "law of friction": (
        {"plant.friction": {"type": "viscus", "coefficients": [1.0, 1.0]}},
        "plant.friction.type = 'viscus', expected one of 'viscous', 'coulomb', 'stribeck' or 'FILE.py:ClassName'",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_told_by_key(name, setup):
    changes, *messages = BAD[name]
    with pytest.raises(ExperimentError) as error:
        setup(changes)
    assert all(message in str(error.value) for message in messages), str(error.value)
