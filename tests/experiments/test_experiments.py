"""Experiment files: what they say is what is built, and what is wrong in them is told by key."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from experiment_files import BASE, document, merged
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol import (
    ContinuousTime,
    Coulomb,
    ExperimentError,
    InputError,
    Run,
    SampledLoop,
    Stribeck,
    Viscous,
    load_robot,
)
from pathcontrol.experiments.runner import load_setup, run_experiment
from pathcontrol.experiments.schema.experiment import Experiment


def described(setup) -> dict:
    return {
        "controller": setup.controller.describe(),
        "friction": setup.plant.friction.describe(),
        "loop": setup.loop.describe(),
        "q": setup.q.tolist(),
        "qd": setup.qd.tolist(),
        "duration": setup.duration,
        "gravity": setup.plant.gravity(setup.q).tolist(),
    }


# --- what is written is what is built -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("controller", "name"),
    [
        ({"type": "projection", "k_p": 800.0, "K_v": 45.0}, "Projection"),
        ({"type": "computed_torque", "K_p": [900.0, 800.0], "K_v": 45.0}, "ComputedTorque"),
        ({"type": "pd_plus", "K_p": 2000, "K_v": 100, "friction": "full"}, "PDPlus"),
        ({"type": "slotine_li", "Lambda": 20.0, "K_d": [100.0, 10.0], "start": "nearest"}, "SlotineLi"),
    ],
)
def test_controllers(write_experiment, controller, name):
    built = load_setup(write_experiment({"controller": controller})).controller.describe()
    assert built["controller"] == name
    for key in controller.keys() - {"type"}:
        np.testing.assert_array_equal(built[key], controller[key])


def test_loops(write_experiment):
    written = {"period": 1e-3, "encoders": [1000, 2000], "filter_hz": 5.0, "torque_limits": [9.0, math.inf]}
    loop = load_setup(write_experiment({"loop": written})).loop
    assert isinstance(loop, SampledLoop)
    assert loop.describe() == SampledLoop(**written).describe()
    loop = load_setup(write_experiment({"loop": {"mode": "continuous", "rtol": 1e-6}})).loop
    assert isinstance(loop, ContinuousTime)
    assert loop.describe() == ContinuousTime(rtol=1e-6).describe()


@pytest.mark.parametrize(
    ("written", "law"),
    [
        ("none", Viscous([0.0, 0.0])),
        ({"viscous": [1.0, 2.0]}, Viscous([1.0, 2.0])),
        ({"viscous": [1, 2], "coulomb": [3, 4]}, Viscous([1, 2]) + Coulomb([3, 4])),
        ({"coulomb": {"positive": [3.0, 4.0], "negative": [5.0, 6.0]}}, Coulomb([3, 4], [5, 6])),
        (
            {"stribeck": {"coulomb": [1, 1], "static": [2, 2], "velocity": [0.1, 0.1]}},
            Stribeck([1, 1], [2, 2], [0.1, 0.1]),
        ),
    ],
)
def test_plant_friction(write_experiment, written, law):
    setup = load_setup(write_experiment({"plant": {"friction": written}}))
    assert setup.plant.friction.describe() == law.describe()
    assert setup.controller.robot.friction.describe() == load_robot("cicese_2dof").friction.describe()


def test_payloads(write_experiment, arm):
    heavy, light = {"mass": 2.0, "frame": "tool"}, {"mass": 1.0, "frame": "tool", "com": [0.1, 0.0, 0.0]}
    q = np.array([0.3, 0.4])
    carried = arm.with_payload(2.0, "tool").gravity(q)
    both = load_setup(write_experiment({"robot.payload": heavy}))
    np.testing.assert_array_equal(both.controller.robot.gravity(q), carried)
    np.testing.assert_array_equal(both.plant.gravity(q), carried)
    apart = load_setup(write_experiment({"robot.payload": heavy, "plant.payload": light}))
    np.testing.assert_array_equal(apart.controller.robot.gravity(q), carried)
    expected = arm.with_payload(1.0, "tool", [0.1, 0, 0]).gravity(q)
    np.testing.assert_array_equal(apart.plant.gravity(q), expected)


def test_a_payload_may_have_an_inertia(write_experiment, arm):
    tensor = np.diag([0.1, 0.2, 0.25])
    body = {"mass": 2.0, "frame": "tool", "inertia": tensor.tolist()}
    setup = load_setup(write_experiment({"plant.payload": body}))
    q = np.array([0.3, 0.4])
    expected = arm.with_payload(2.0, "tool", inertia=tensor).mass_matrix(q)
    np.testing.assert_array_equal(setup.plant.mass_matrix(q), expected)
    with pytest.raises(ExperimentError, match=r"plant\.payload\.com has shape \(3,\) and inertia \(2, 2\)"):
        load_setup(write_experiment({"plant.payload": body | {"inertia": [[0.1, 0.0], [0.0, 0.1]]}}))


def test_profiles(write_experiment):
    rate = load_setup(write_experiment({"task.profile": {"type": "constant_rate", "rate": 3.0}})).controller.task
    assert rate.theta(np.array(0.2)) == 3.0
    profile = {"type": "constant_speed", "speed": 180.0}
    in_degrees = {"angle_unit": "deg", "task.radius": 90.0, "task.profile": profile}
    speed = load_setup(write_experiment(in_degrees)).controller.task
    assert speed.theta(np.array(0.2)) == pytest.approx(2.0)


def test_own_task_and_urdf_are_found_beside_the_file(write_experiment, tmp_path, arm, monkeypatch):
    monkeypatch.chdir(Path(__file__).parent)
    (tmp_path / "arm.urdf").write_text(arm.source.text, encoding="utf-8")
    task = {"type": "tasks.py:Spiral", "parameters": {"size": 0.5}}
    setup = load_setup(write_experiment({"robot.source": "arm.urdf", "task": task, "angle_unit": "deg"}))
    assert setup.controller.task.describe()["size"] == 0.5  # parameters are taken as they are
    assert setup.plant.joint_names == arm.joint_names


ANGLES = st.floats(-2.0, 2.0)
SIZES = st.floats(0.3, 2.0)
PAIRS = st.lists(ANGLES, min_size=2, max_size=2)


@st.composite
def in_radians(draw: st.DrawFn) -> dict:
    """Changes to the base experiment, all of them angles."""
    task = draw(
        st.sampled_from(
            [
                {"type": "circle", "radius": draw(SIZES), "clockwise": draw(st.booleans())},
                {"type": "ellipse", "semi_axes": [draw(SIZES), draw(SIZES)], "joints": [1, 0]},
                {"type": "lissajous", "amplitudes": [draw(SIZES), draw(SIZES)], "frequencies": [1, 2]},
            ]
        )
    )
    task |= {"speed": draw(SIZES), "center": draw(PAIRS)}
    line = {"type": "line", "start": draw(PAIRS), "end": [3.0, draw(ANGLES)], "speed": draw(SIZES)}
    friction = {"coulomb": [1.0, 0.5], "static": [2.0, 1.0], "velocity": [draw(SIZES), draw(SIZES)]}
    return {
        "task": draw(st.sampled_from([task, line])),
        "start": {"q": draw(PAIRS), "qd": draw(PAIRS)},
        "plant": {"friction": {"stribeck": friction}},
        "loop": draw(st.sampled_from([{}, {"mode": "continuous", "friction_width": draw(SIZES)}])),
    }


NO_ANGLES = {"coulomb", "static", "frequencies", "joints"}


def scaled(value, factor, key=""):
    """Every float in ``value`` times ``factor``, but for what is no angle."""
    if isinstance(value, dict):
        return {k: scaled(v, factor, k) for k, v in value.items()}
    if isinstance(value, list):
        return [scaled(v, factor, key) for v in value]
    return value * factor if isinstance(value, float) and key not in NO_ANGLES else value


@given(changes=in_radians(), gain=st.floats(0.1, 1e4), k=st.floats(0.0, 1e3))
def test_valid_experiments_build_alike_in_degrees_and_radians(tmp_path_factory, changes, gain, k):
    gains = {"controller.K_p": gain, "controller.k": k}
    radians, degrees = changes | gains, scaled(changes, 180 / math.pi) | gains | {"angle_unit": "deg"}
    setups = []
    for data in (radians, degrees):
        path = tmp_path_factory.getbasetemp() / "alike.toml"
        path.write_text(document(merged(BASE, data)), encoding="utf-8")
        setups.append(described(load_setup(path)))
    assert_close(*setups)


def assert_close(a, b):
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key in a:
            assert_close(a[key], b[key])
    elif isinstance(a, str | bool | None):
        assert a == b
    else:
        np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-14)


def test_degrees_are_exactly_math_radians(write_experiment):
    in_deg = {"angle_unit": "deg", "task.radius": 57.3, "start": {"q": [40.0, 70.0]}}
    in_rad = {"task.radius": math.radians(57.3), "start": {"q": [math.radians(40.0), math.radians(70.0)]}}
    in_rad["task.speed"], in_deg["task.speed"] = math.radians(114.59), 114.59
    assert described(load_setup(write_experiment(in_deg))) == described(load_setup(write_experiment(in_rad)))


SLIDER = """<robot name="slider"><link name="base"/>
<joint name="rail" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
<link name="cart"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="cart"/><child link="pole"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="10" velocity="1"/></joint>
<link name="pole"><inertial><origin xyz="0 0 0.5"/><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>"""


def test_sliding_joints_are_never_in_degrees(write_experiment):
    with pytest.raises(ExperimentError, match="rail of slider slides"):
        load_setup(write_experiment({"robot.source": SLIDER, "angle_unit": "deg"}))
    line = {"type": "line", "start": [0.0], "end": [30.0], "speed": 10.0}
    one = {"task": line, "start.q": [10.0], "controller.K_v": 45.0, "angle_unit": "deg"}
    locked = load_setup(write_experiment({"robot": {"source": SLIDER, "lock": {"rail": 0.5}}} | one))
    place = locked.plant.frame_pose([0.0], "pole")[0, 3]
    assert place == pytest.approx(0.5)


# --- the files it writes ------------------------------------------------------------------------------------


def test_only_the_data_unless_asked(write_experiment, tmp_path):
    run, _, written = run_experiment(write_experiment(), tmp_path / "deep" / "out", progress=False)
    assert written == {"data": tmp_path / "deep" / "out" / "run.nc"}
    assert Run.load(written["data"]).data.equals(run.data)
    assert [p.name for p in (tmp_path / "deep" / "out").iterdir()] == ["run.nc"]


def test_folders_that_cannot_be_written_to(write_experiment, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.experiments.runner.simulate", lambda *_, **__: pytest.fail("computed"))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        run_experiment(write_experiment(), tmp_path / "file")
    (tmp_path / "out" / "run.nc").mkdir(parents=True)
    with pytest.raises(InputError, match="there is a folder where the file"):
        run_experiment(write_experiment(), tmp_path / "out")


@pytest.mark.parametrize("step", ["simulate", "measure_run", "write_outputs"])
def test_ctrl_c_leaves_no_empty_folder(step, write_experiment, tmp_path, monkeypatch):
    """Folders that were made for the outputs go with what should have been in them; those that were there stay."""

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"pathcontrol.experiments.runner.{step}", interrupt)
    (tmp_path / "there").mkdir()
    for out in ("there", "there/new", "new/deep"):
        with pytest.raises(KeyboardInterrupt):
            run_experiment(write_experiment(), tmp_path / out, progress=False)
    assert (tmp_path / "there").is_dir()
    assert not list((tmp_path / "there").iterdir())
    assert not (tmp_path / "new").exists()


# --- the schema alone ---------------------------------------------------------------------------------------


def test_validating_loads_nothing_heavy():
    code = (
        "import sys; from pathcontrol.experiments import load, schema, template; "
        "heavy = {'pinocchio', 'matplotlib', 'meshcat', 'xarray', 'scipy'} & set(sys.modules); print(*heavy)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_experiments_can_be_made_in_python():
    from pathcontrol.experiments.builders.setup import build

    experiment = Experiment.model_validate(BASE)
    again = Experiment(**{name: getattr(experiment, name) for name in Experiment.model_fields})
    assert described(build(experiment)) == described(build(again))
