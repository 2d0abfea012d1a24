"""Quantities with a unit in experiment files, by one rule for every key; what is of another dimension is refused."""

from __future__ import annotations

import contextlib
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol._units import parse_quantity
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.setup import build
from pathcontrol.experiments.load import load_experiment
from pathcontrol.experiments.runner import load_setup
from pathcontrol.experiments.schema.experiment import Experiment

ANGLE = {"deg": math.pi / 180, "rad": 1.0, "mrad": 1e-3, "rev": 2 * math.pi}
LENGTH = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}


@given(st.floats(-1e6, 1e6), st.sampled_from(sorted(LENGTH)), st.sampled_from(sorted(TIME)), st.sampled_from(["", " "]))
def test_a_speed_is_a_length_over_a_time(value, length, time, space):
    found = parse_quantity(f"{value!r}{space}{length}/{time}", "m/s")
    assert found == pytest.approx(value * LENGTH[length] / TIME[time], rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("50 mm/s", "m/s", 0.05),
        ("0.1 mm", "m", 1e-4),
        ("5 µm", "m", 5e-6),
        ("90 deg", "rad", math.radians(90)),
        ("90°", "rad", math.radians(90)),
        ("2.5 ms", "s", 2.5e-3),
        ("15 N m", "N m", 15.0),
        ("15 Nm", "N m", 15.0),
        ("15 N·m", "N m", 15.0),
        ("15 N*m", "N m", 15.0),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("180 deg/s^2", "rad/s^2", math.pi),
        ("180 deg/s²", "rad/s^2", math.pi),
        ("180 deg/s/s", "rad/s^2", math.pi),
        ("2 N m s", "N m s/rad", 2.0),
        ("2 N m s/rad", "N m s/rad", 2.0),
        ("1 kHz", "Hz", 1000.0),
        ("800 1/s^2", "1/s^2", 800.0),
        ("800 s^-2", "1/s^2", 800.0),
        ("500 g", "kg", 0.5),
        ("-1e-3 m", "m", -1e-3),
    ],
)
def test_a_text_is_the_number_that_a_person_would_write_in_si_units(text, unit, value):
    assert parse_quantity(text, unit) == value
    assert pickle.loads(pickle.dumps(parse_quantity(text, unit))).unit == unit


@pytest.mark.parametrize(
    "text", ["50", "mm/s", "50 kg", "50 parsec/s", "1e400 m/s", "nan m/s", "inf m/s", "50,5 mm/s", ""]
)
@pytest.mark.parametrize("more", ["", " x", "//s", "^99", "9" * 400])
def test_what_is_no_speed_is_refused_with_the_units_that_are(text, more):
    with pytest.raises(pc.InputError, match=r"m/s \(mm/s, m/min, mm/min, in/min\)"):
        parse_quantity(text + more, "m/s")


@given(st.text(max_size=80))
def test_any_text_is_a_quantity_or_refused(text):
    with contextlib.suppress(pc.InputError):
        assert math.isfinite(parse_quantity(text, "m/s", "rad"))


SI = """
angle_unit = "{angle_unit}"
duration = 2.0
[robot]
source = "cicese_2dof"
lock = {{}}
payload = {{ mass = 0.5, frame = "tool", com = [0.0, 0.0, 0.01] }}
[task]
type = "ellipse"
semi_axes = [60.0, 30.0]
speed = 90.0
profile = {{ type = "limited", frame = "tool", speed = 0.05, tangential = 0.5 }}
[controller]
type = "extended_motion_plan"
K_p = [800.0, 600.0]
K_v = [45.0, 100.0]
k = 20.0
[plant.friction]
viscous = [2.3, 0.2]
coulomb = {{ positive = [7.2, 1.7], negative = [8.0, 1.7] }}
[loop]
period = 0.002
filter_hz = 100.0
torque_limits = [150.0, 15.0]
[start]
q = [40.0, 70.0]
qd = [0.0, 9.0]
"""
UNITS = {
    "duration = 2.0": 'duration = "2000 ms"',
    "mass = 0.5": 'mass = "500 g"',
    "com = [0.0, 0.0, 0.01]": 'com = [0.0, "0 m", "10 mm"]',
    "semi_axes = [60.0, 30.0]": 'semi_axes = ["60 deg", "30 deg"]',
    "speed = 90.0": 'speed = "90 deg/s"',
    "speed = 0.05, tangential = 0.5": 'speed = "50 mm/s", tangential = "500 mm/s^2"',
    "K_p = [800.0, 600.0]": 'K_p = ["800 1/s^2", "600 1/s^2"]',
    "k = 20.0": 'k = "20 1/rad^2/s"',
    "viscous = [2.3, 0.2]": 'viscous = ["2.3 N m s/rad", "0.2 N m s"]',
    "positive = [7.2, 1.7]": 'positive = ["7.2 N m", "1.7 N m"]',
    "period = 0.002": 'period = "2 ms"',
    "filter_hz = 100.0": 'filter_hz = "0.1 kHz"',
    "torque_limits = [150.0, 15.0]": 'torque_limits = ["150 N m", "15 N m"]',
    "q = [40.0, 70.0]": 'q = ["40 deg", "70 deg"]',
    "qd = [0.0, 9.0]": 'qd = ["0 rad/s", "1.5 rpm"]',
}


def setup_of(tmp_path, text):
    file = tmp_path / "experiment.toml"
    file.write_text(text, encoding="utf-8")
    return load_setup(file)


@pytest.mark.parametrize("angle_unit", ["deg", "rad"])
def test_an_experiment_with_units_is_the_one_without(tmp_path, angle_unit):
    text = SI.format(angle_unit="deg")
    plain, spoken = setup_of(tmp_path, text), text.replace('"deg"', f'"{angle_unit}"')
    for old, new in UNITS.items():
        assert old in spoken
        spoken = spoken.replace(old, new)
    told = setup_of(tmp_path, spoken)
    np.testing.assert_allclose(told.q, plain.q, rtol=1e-15)
    np.testing.assert_allclose(told.qd, plain.qd, rtol=1e-15)
    assert told.duration == plain.duration
    assert told.loop.describe() == plain.loop.describe()
    a, b = told.controller.describe(), plain.controller.describe()
    assert {key: a[key] for key in ("K_p", "K_v", "k")} == {key: b[key] for key in ("K_p", "K_v", "k")}
    s = np.linspace(0, 6, 30)
    np.testing.assert_allclose(told.task.q_d(s), plain.task.q_d(s), rtol=1e-14)
    np.testing.assert_allclose(told.task.theta(s), plain.task.theta(s), rtol=1e-12)
    np.testing.assert_array_equal(told.plant.friction.viscous, plain.plant.friction.viscous)
    np.testing.assert_array_equal(told.plant.gravity(plain.q), plain.plant.gravity(plain.q))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("duration = 2.0", 'duration = "2 m"', "duration = '2 m', expected a finite quantity in s (ms, us, min)"),
        (
            "duration = 2.0",
            'duration = "2"',
            "duration = '2', expected a number greater than 0, or one with a unit: s (ms, us, min)",
        ),
        ("speed = 90.0", 'speed = "50 mm/s"', "task.speed = '50 mm/s', expected a finite quantity in rad/s (deg/s"),
        ("semi_axes = [60.0, 30.0]", 'semi_axes = [1.0, "5 mm"]', "task.semi_axes[1] = '5 mm', expected"),
        ("speed = 0.05", 'speed = "5 deg/s"', "task.profile.speed = '5 deg/s', expected a finite quantity in m/s"),
        ("positive = [7.2, 1.7]", 'positive = [1.0, "1 s"]', "plant.friction.coulomb.positive[1] = '1 s', expected"),
        ("mass = 0.5", 'mass = "1 m"', "robot.payload.mass = '1 m', expected a finite quantity in kg (g)"),
        ("mass = 0.5", 'mass = "-1 kg"', "mass = -1"),
        ("period = 0.002", 'period = "-2 ms"', "loop.period = -0.002, expected a number greater than 0"),
        ("q = [40.0, 70.0]", 'q = ["40 deg", "70 mm"]', "start.q[1] was given in m, expected rad (deg, mrad, rev)"),
        ("K_p = [800.0", 'K_p = ["800 N m"', "controller.K_p[0] = '800 N m', expected a finite quantity in 1/s^2"),
    ],
)
def test_a_unit_of_another_dimension_is_refused_by_its_key(tmp_path, old, new, words):
    text = SI.format(angle_unit="deg")
    assert old in text
    with pytest.raises(ExperimentError) as error:
        setup_of(tmp_path, text.replace(old, new))
    assert words in str(error.value)


def test_a_grid_of_a_sweep_may_have_units(tmp_path):
    from pathcontrol.experiments.samples.dotted_keys import put

    data = {"task": {"speed": 1.0}}
    put(data, "task.speed", "90 deg/s")
    assert data == {"task": {"speed": "90 deg/s"}}


def test_units_of_files_that_are_only_read_are_checked_too(tmp_path):
    file = tmp_path / "experiment.toml"
    file.write_text(SI.format(angle_unit="rad").replace("period = 0.002", 'period = "2 furlong"'), encoding="utf-8")
    with pytest.raises(ExperimentError, match="unknown unit 'furlong'"):
        load_experiment(file)


@pytest.mark.parametrize(
    ("section", "change", "key"),
    [
        ("controller", {"torque_limits": ["100 N m", "12 N"]}, "controller.torque_limits[1]"),
        ("profile", {"velocity": ["2 m/s", 2.0]}, "task.profile.velocity[0]"),
        ("profile", {"torque": [100.0, "12 N"]}, "task.profile.torque[1]"),
        ("loop", {"torque_limits": ["150 N", "15 N"]}, "loop.torque_limits[0]"),
        ("threshold", "5 N", "controller.threshold"),
    ],
)
def test_a_joint_that_turns_has_no_quantity_of_one_that_slides(tmp_path, section, change, key):
    inner = {"type": "projection", "k_p": 400.0, "K_v": 40.0}
    law = {"type": "paced", "law": inner} if section == "controller" else inner
    if section == "threshold":
        law = {"type": "event_plan", "threshold": change, "law": inner}
    parts = {"controller": law, "profile": {"type": "time_optimal"}, "loop": {}}
    if section != "threshold":
        parts[section] = parts[section] | change
    task = {"type": "line", "start": [0.7, 1.2], "end": [0.0, 0.3], "speed": 1.0, "profile": parts["profile"]}
    content = {name: parts[name] for name in ("controller", "loop")} | {"task": task}
    with pytest.raises(ExperimentError) as error:
        build(Experiment.model_validate(content | {"robot": {"source": "cicese_2dof"}}), tmp_path)
    assert str(error.value).startswith(f"{key} was given in ")
