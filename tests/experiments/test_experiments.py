"""Experiment files: what they say is what is built, and what is wrong in them is told by key."""

from __future__ import annotations

import contextlib
import json
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import START
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol import (
    Circle,
    ContinuousTime,
    Coulomb,
    ExperimentError,
    ExtendedMotionPlan,
    InputError,
    PathControlError,
    Run,
    SampledLoop,
    Stribeck,
    Viscous,
    load_robot,
    simulate,
)
from pathcontrol.experiments.load import load_experiment
from pathcontrol.experiments.runner import load_setup, run_experiment
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.experiments.template import example_text
from pathcontrol.registry import KINDS, LOOPS

BASE = {
    "duration": 0.05,
    "robot": {"source": "cicese_2dof"},
    "task": {"type": "circle", "radius": 1.0, "speed": 2.0},
    "controller": {"type": "extended_motion_plan", "K_p": 800.0, "K_v": [45.0, 100.0], "k": 20.0},
    "start": {"q": [0.7, 1.2]},
}
DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" width="300mm" height="120mm" viewBox="0 0 300 120">
<path d="M 20 20 H 80 V 60" fill="none" stroke="black"/><circle cx="150" cy="60" r="20"/></svg>
"""

OWN_TASK = """
import numpy as np
from pathcontrol import ComputedTorque, PathTask

class Spiral(PathTask):
    s_end = 4.0
    def __init__(self, size, turns=1.0):
        if size > 5:
            raise RuntimeError("too large")
        self.size, self.turns = size, turns
    def q_d(self, s):
        return np.stack([self.size * np.cos(self.turns * s), self.size * (1 + s)], axis=-1)
    def theta(self, s):
        return 1.0

class Half(PathTask):
    def q_d(self, s):
        return np.stack([s, s], axis=-1)

class Endless(PathTask):
    def q_d(self, s):
        return np.stack([s, s], axis=-1)
    def theta(self, s):
        return 1.0

class Broken(Spiral):
    def theta(self, s):
        return 1 / 0

class NoTask:
    pass

class Law(ComputedTorque):
    def __init__(self, robot, task, K, **options):
        super().__init__(robot, task, K, 45.0, **options)
"""


def toml(value) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else repr(value)


def document(data: dict) -> str:
    return "".join(f"{json.dumps(key)} = {toml(value)}\n" for key, value in data.items())


def merged(base: dict, changes: dict) -> dict:
    """``base`` with changes by key path; None removes the key."""
    data = json.loads(json.dumps(base))
    for path, value in changes.items():
        *sections, key = path.split(".")
        table = data
        for section in sections:
            table = table.setdefault(section, {})
        table[key] = value
        if value is None:
            del table[key]
    return data


@pytest.fixture
def write(tmp_path):
    """A function that writes the base experiment with changes and gives the path."""

    def write(changes: dict | str | None = None, name: str = "experiment.toml") -> Path:
        path = tmp_path / name
        if isinstance(changes, str):
            path.write_text(changes, encoding="utf-8")
        else:
            data = merged(BASE, changes or {})
            path.write_text(document(data), encoding="utf-8")
        (tmp_path / "tasks.py").write_text(OWN_TASK, encoding="utf-8")
        (tmp_path / "drawing.svg").write_text(DRAWING, encoding="utf-8")
        return path

    return write


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


# --- the template -------------------------------------------------------------------------------------------


def test_template_is_the_first_experiment(write, tmp_path, arm):
    path = write(example_text().replace("duration = 10.0", "duration = 0.25"))
    run, _, _ = run_experiment(path, tmp_path / "out", progress=False)
    task = Circle(math.radians(57.3), math.radians(114.59))
    controller = ExtendedMotionPlan(arm, task, 800.0, [45.0, 100.0], 20.0, friction="viscous")
    loop = SampledLoop(period=2.5e-3, encoders=True, velocity="difference", torque_limits=True)
    by_hand = simulate(controller, START, duration=0.25, loop=loop, progress=False)
    assert run.data.equals(by_hand.data)
    assert run.config == by_hand.config | {"experiment": path.read_text(encoding="utf-8")}


def test_template_lasts_ten_seconds(write):
    assert load_setup(write(example_text())).duration == 10.0


def template_options() -> list[tuple[str, str]]:
    """Each option that the template shows turned off: its section, and the line."""
    section, options = "", []
    for line in example_text().splitlines():
        if found := re.match(r"#?\[(\w+)\]", line):
            section = "" if line.startswith("#") else found[1]
        elif re.match(r"#\w+ = ", line) and section:
            options.append((section, line[1:]))
    return options


def template_sections() -> list[str]:
    """Each alternative section that the template shows turned off."""
    blocks = re.findall(r"(?m)^#\[\w+\]\n(?:#\w.*\n)+", example_text())
    return [re.sub("(?m)^#", "", block) for block in blocks]


@pytest.mark.parametrize(("section", "line"), template_options())
def test_template_options_are_valid(write, section, line):
    key = line.split(" = ")[0]
    text = re.sub(rf"(?m)^#{re.escape(line)}$", "", example_text())
    head, tail = text.split(f"\n[{section}]", 1)
    body, _, rest = tail.partition("\n\n")
    body = re.sub(rf"(?m)^{key} = .*\n", "", body + "\n")
    path = write(f"{head}\n[{section}]{body}{line}\n\n{rest}")
    written = getattr(load_experiment(path), section)
    assert getattr(written, key) is not None
    if key != "lock":  # which leaves the arm with one joint, and the circle needs two
        load_setup(path)


@pytest.mark.parametrize("block", template_sections())
def test_template_alternatives_are_valid(write, block):
    section = re.match(r"\[(\w+)\]", block)[1]
    text, replaced = re.subn(rf"(?ms)^\[{section}\].*?\n\n", block + "\n", example_text(), count=1)
    text = text if replaced or section != "disturbance" else f"{text}\n{block}"
    text = text.replace("my_task.py:MyTask", "tasks.py:Spiral").replace("my_law.py:MyLaw", "tasks.py:Law")
    load_setup(write(text))


def test_template_shows_every_choice():
    text = example_text()
    for kind in (*KINDS, LOOPS):
        for name in kind.members:
            assert f'= "{name}"' in text


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
def test_controllers(write, controller, name):
    built = load_setup(write({"controller": controller})).controller.describe()
    assert built["controller"] == name
    for key in controller.keys() - {"type"}:
        np.testing.assert_array_equal(built[key], controller[key])


def test_loops(write):
    written = {"period": 1e-3, "encoders": [1000, 2000], "filter_hz": 5.0, "torque_limits": [9.0, math.inf]}
    loop = load_setup(write({"loop": written})).loop
    assert isinstance(loop, SampledLoop)
    assert loop.describe() == SampledLoop(**written).describe()
    loop = load_setup(write({"loop": {"mode": "continuous", "rtol": 1e-6}})).loop
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
def test_plant_friction(write, written, law):
    setup = load_setup(write({"plant": {"friction": written}}))
    assert setup.plant.friction.describe() == law.describe()
    assert setup.controller.robot.friction.describe() == load_robot("cicese_2dof").friction.describe()


def test_payloads(write, arm):
    heavy, light = {"mass": 2.0, "frame": "tool"}, {"mass": 1.0, "frame": "tool", "com": [0.1, 0.0, 0.0]}
    q = np.array([0.3, 0.4])
    carried = arm.with_payload(2.0, "tool").gravity(q)
    both = load_setup(write({"robot.payload": heavy}))
    np.testing.assert_array_equal(both.controller.robot.gravity(q), carried)
    np.testing.assert_array_equal(both.plant.gravity(q), carried)
    apart = load_setup(write({"robot.payload": heavy, "plant.payload": light}))
    np.testing.assert_array_equal(apart.controller.robot.gravity(q), carried)
    expected = arm.with_payload(1.0, "tool", [0.1, 0, 0]).gravity(q)
    np.testing.assert_array_equal(apart.plant.gravity(q), expected)


def test_a_payload_may_have_an_inertia(write, arm):
    tensor = np.diag([0.1, 0.2, 0.25])
    body = {"mass": 2.0, "frame": "tool", "inertia": tensor.tolist()}
    setup = load_setup(write({"plant.payload": body}))
    q = np.array([0.3, 0.4])
    expected = arm.with_payload(2.0, "tool", inertia=tensor).mass_matrix(q)
    np.testing.assert_array_equal(setup.plant.mass_matrix(q), expected)
    with pytest.raises(ExperimentError, match=r"plant\.payload\.com has shape \(3,\) and inertia \(2, 2\)"):
        load_setup(write({"plant.payload": body | {"inertia": [[0.1, 0.0], [0.0, 0.1]]}}))


def test_profiles(write):
    rate = load_setup(write({"task.profile": {"type": "constant_rate", "rate": 3.0}})).controller.task
    assert rate.theta(np.array(0.2)) == 3.0
    profile = {"type": "constant_speed", "speed": 180.0}
    in_degrees = {"angle_unit": "deg", "task.radius": 90.0, "task.profile": profile}
    speed = load_setup(write(in_degrees)).controller.task
    assert speed.theta(np.array(0.2)) == pytest.approx(2.0)


def test_own_task_and_urdf_are_found_beside_the_file(write, tmp_path, arm, monkeypatch):
    monkeypatch.chdir(Path(__file__).parent)
    (tmp_path / "arm.urdf").write_text(arm.source.text, encoding="utf-8")
    task = {"type": "tasks.py:Spiral", "parameters": {"size": 0.5}}
    setup = load_setup(write({"robot.source": "arm.urdf", "task": task, "angle_unit": "deg"}))
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


def test_degrees_are_exactly_math_radians(write):
    in_deg = {"angle_unit": "deg", "task.radius": 57.3, "start": {"q": [40.0, 70.0]}}
    in_rad = {"task.radius": math.radians(57.3), "start": {"q": [math.radians(40.0), math.radians(70.0)]}}
    in_rad["task.speed"], in_deg["task.speed"] = math.radians(114.59), 114.59
    assert described(load_setup(write(in_deg))) == described(load_setup(write(in_rad)))


SLIDER = """<robot name="slider"><link name="base"/>
<joint name="rail" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
<link name="cart"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="cart"/><child link="pole"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="10" velocity="1"/></joint>
<link name="pole"><inertial><origin xyz="0 0 0.5"/><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>"""


def test_sliding_joints_are_never_in_degrees(write):
    with pytest.raises(ExperimentError, match="rail of slider slides"):
        load_setup(write({"robot.source": SLIDER, "angle_unit": "deg"}))
    line = {"type": "line", "start": [0.0], "end": [30.0], "speed": 10.0}
    one = {"task": line, "start.q": [10.0], "controller.K_v": 45.0, "angle_unit": "deg"}
    locked = load_setup(write({"robot": {"source": SLIDER, "lock": {"rail": 0.5}}} | one))
    place = locked.plant.frame_pose([0.0], "pole")[0, 3]
    assert place == pytest.approx(0.5)


# --- what is wrong is told by key ---------------------------------------------------------------------------

BAD = {
    "unknown key": (
        {"controller.k_p": 800.0},
        "controller.k_p: unknown key; did you mean 'K_p'? valid",
    ),
    "unknown section": ({"rboot": {}}, "rboot: unknown key; did you mean 'robot'?"),
    "key of another kind": ({"loop": {"mode": "continuous", "period": 1.0}}, "loop.period: unknown key"),
    "wrong type": ({"controller.K_p": "a"}, "controller.K_p = 'a', expected a finite number, or a list"),
    "number as text": ({"duration": "10"}, "duration = '10', expected a number greater than 0"),
    "true is no number": ({"task.radius": True}, "task.radius = true, expected a number greater than 0"),
    "not finite": ({"controller.k": math.nan}, "controller.k = nan, expected a finite number"),
    "endless digits": ({"start.q": [10**400, 0]}, "start.q = [1000"),
    "wrong choice": ({"controller.friction": "viscos"}, "or 'full'; did you mean 'viscous'?"),
    "wrong kind of task": ({"task.type": "circel"}, "task.type = 'circel', expected one of 'circle'"),
    "no kind": ({"task.type": None}, "task.type: missing; choose one of 'circle'"),
    "kind is no text": ({"loop.mode": 3}, "loop.mode = 3, expected one of 'sampled', 'continuous'"),
    "missing section": ({"controller": None}, "controller: missing; needed here: robot, task, controller"),
    "missing key": ({"controller.k": None}, "controller.k: missing; needed here: K_p, K_v, k"),
    "section is no table": ({"robot": "cicese_2dof"}, "robot = 'cicese_2dof', expected a table"),
    "kind of no table": ({"task": "circle"}, "task = 'circle', expected a table with the key 'type'"),
    "negative gain": ({"controller.K_v": [-45.0, 1.0]}, "controller.K_v = [-45.0, 1.0], expected gains"),
    "gains for 3 joints": ({"controller.K_v": [1.0, 1.0, 1.0]}, "controller.K_v has shape (3,)"),
    "negative k": ({"controller.k": -1.0}, "controller.k = -1.0, expected k ≥ 0"),
    "gain per joint": (
        {"controller": {"type": "projection", "k_p": [1.0, 2.0], "K_v": 1.0}},
        "controller.k_p = [1.0, 2.0], expected a scalar",
    ),
    "unknown robot": ({"robot.source": "cicese_3dof"}, "robot.source: "),
    "no such URDF": ({"robot.source": "none.urdf"}, "robot.source: cannot read the URDF file"),
    "endless name": ({"robot.source": "x" * 300}, "robot.source: "),
    "unknown joint": ({"robot.lock": {"joint_3": 0.0}}, "no movable joint 'joint_3'; it has joint_1"),
    "unknown frame": ({"robot.payload": {"mass": 1.0, "frame": "tol"}}, "robot.payload: cicese_2dof has no"),
    "negative mass": ({"plant.payload": {"mass": -1.0, "frame": "tool"}}, "plant.payload.mass = -1"),
    "path for 3 joints": ({"task.center": [0.0, 0.0, 0.0]}, "task: Circle.q_d"),
    "joint out of range": ({"task.joints": [0, 2]}, "task.joints = (0, 2), expected two different"),
    "friction choice": ({"plant.friction": "urd"}, "plant.friction = 'urd', expected 'urdf', 'none'"),
    "no friction law": ({"plant.friction": {}}, "plant.friction = {}, expected"),
    "two dry laws": (
        {"plant.friction": {"coulomb": [1], "stribeck": {"coulomb": [1], "static": [1], "velocity": [1]}}},
        "expected either 'coulomb' or 'stribeck'",
    ),
    "friction for 1 joint": ({"plant.friction": {"viscous": [1.0]}}, "plant.friction.viscous = [1.0], expe"),
    "friction that drives": (
        {"plant.friction": {"coulomb": {"positive": [1.0, -1.0], "negative": [1.0, 1.0]}}},
        "plant.friction.coulomb.positive = [1.0, -1.0], expected 2 numbers not below 0",
    ),
    "encoders": ({"loop.encoders": [1000]}, "loop.encoders has shape (1,), expected (2,)"),
    "substeps": ({"loop.substeps": 0}, "loop.substeps = 0, expected a whole number from 1"),
    "posture": ({"start.q": [0.0]}, "start.q has shape (1,)"),
    "outside the folder": ({"output": {"html": "../run.html"}}, "output.html = '../run.html', expected"),
    "wrong suffix": ({"output": {"summary": "run.txt"}}, "output.summary = 'run.txt', expected"),
    "endless run": ({"duration": 1e9}, "duration = 1e+09 and loop.period = 0.0025 make 4e+11 samples"),
    "late for ever": ({"loop.delay": 1.0}, "loop.delay = 1, expected at most duration"),
    "no class": ({"task": {"type": "tasks.py"}}, "task.type = 'tasks.py', expected 'FILE.py:ClassName'"),
    "no file": ({"task": {"type": "none.py:Spiral"}}, "task.type: there is no"),
    "endless file": ({"task": {"type": "x" * 300 + ".py:Spiral"}}, "task.type: "),
    "no such class": ({"task": {"type": "tasks.py:Sprial"}}, "its PathTask subclasses are Spiral, Endless, Broken"),
    "no task class": ({"task": {"type": "tasks.py:NoTask"}}, "'NoTask' in tasks.py is not a subclass"),
    "endless path": (
        {"task": {"type": "tasks.py:Endless"}, "controller": {"type": "projection", "k_p": 1.0, "K_v": 1.0}},
        "controller: Endless neither ends nor repeats",
    ),
    "half a class": ({"task": {"type": "tasks.py:Half"}}, "task.parameters: Half raised TypeError"),
    "parameter missing": ({"task": {"type": "tasks.py:Spiral"}}, "argument: 'size'; it is Spiral(size"),
    "parameter unknown": (
        {"task": {"type": "tasks.py:Spiral", "parameters": {"size": 1.0, "turn": 1.0}}},
        "got an unexpected keyword argument 'turn'; it is Spiral(size, turns=1.0)",
    ),
    "constructor fails": (
        {"task": {"type": "tasks.py:Spiral", "parameters": {"size": 9.0}}},
        "task.parameters: Spiral raised RuntimeError: too large",
    ),
    "method fails": (
        {"task": {"type": "tasks.py:Broken", "parameters": {"size": 1.0}}},
        "task: checking Broken raised ZeroDivisionError",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_told_by_key(write, name):
    changes, message = BAD[name]
    path = write(changes)
    with pytest.raises(ExperimentError) as caught:
        load_setup(path)
    assert str(caught.value).startswith(f"{str(path)!r} is not a valid experiment:\n  ")
    assert message in str(caught.value)
    assert len(str(caught.value)) < 2000


def test_all_mistakes_are_told_at_once(write):
    changes = {"duration": -1, "controller.K_x": 1.0, "controller.K_p": "a", "start.p": 1, "loop.encoders": 2}
    with pytest.raises(ExperimentError) as caught:
        load_experiment(write(changes))
    lines = str(caught.value).splitlines()[1:]
    keys = {re.split("[ :]", line.strip())[0] for line in lines}
    assert keys == changes.keys()


def test_syntax_errors_have_a_line(write):
    with pytest.raises(ExperimentError, match=r"experiment.toml.*\n.*at line 2, column"):
        load_experiment(write("duration = 1.0\nrobot = = 2\n"))


def test_missing_file(tmp_path):
    with pytest.raises(ExperimentError, match=r"no experiment file .*none.toml.*--example"):
        load_experiment(tmp_path / "none.toml")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"a = " + b"9" * 5000, b"a = " + b"[" * 9000, b"\x00"])
def test_files_that_are_no_toml(tmp_path, content):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises(ExperimentError):
        load_experiment(path)
    with pytest.raises(ExperimentError):
        load_experiment(tmp_path)


@pytest.mark.parametrize(("code", "line"), [("x = 1\nx = y", 2), ("import sys\n\nsys.exit(3)", 3), ("x = = 1", None)])
def test_own_file_that_fails(write, tmp_path, code, line):
    path = write({"task": {"type": "failing.py:Spiral"}})
    (tmp_path / "failing.py").write_text(code, encoding="utf-8")
    where = f" at line {line}" if line else ""
    with pytest.raises(ExperimentError, match=f"task.type: failing.py fails{where} with [A-Z]"):
        load_setup(path)


def test_nothing_is_computed_or_written_for_a_bad_file(write, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.experiments.runner.simulate", lambda *_, **__: pytest.fail("computed"))
    with pytest.raises(ExperimentError):
        run_experiment(write({"loop.encoders": [1]}), tmp_path / "out")
    assert not (tmp_path / "out").exists()


LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["circle", "line", "projection", "continuous", "deg", "none", "tasks.py:X", "."]),
)
GARBAGE = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
KEYS = st.sampled_from(
    [
        "angle_unit duration robot robot.source robot.lock robot.payload task task.type task.radius",
        "task.speed task.center task.joints task.profile controller controller.type controller.K_p",
        "controller.K_v controller.k controller.start start start.q start.qd plant plant.friction loop",
        "plant.payload loop.mode loop.period loop.encoders loop.torque_limits loop.delay loop.substeps",
        "output output.data output.figure other task.new until disturbance disturbance.type disturbance.magnitude",
        "loop.noise loop.noise.position loop.noise.seed task.points task.q_d task.curve task.frame plant.friction.type",
    ]
).flatmap(lambda line: st.sampled_from(line.split()))


@given(changes=st.dictionaries(KEYS, GARBAGE, min_size=1, max_size=3))
def test_garbage_in_a_file_is_refused_or_builds(tmp_path_factory, changes):
    sections = {key: value for key, value in changes.items() if "." not in key}
    inside = {k: v for k, v in changes.items() if "." in k and k.split(".")[0] not in sections}
    path = tmp_path_factory.getbasetemp() / "garbage.toml"
    path.write_text(document(merged(BASE, sections | inside)), encoding="utf-8", errors="replace")
    with contextlib.suppress(PathControlError):
        load_setup(path)


@given(content=st.binary(max_size=60) | st.text(max_size=60).map(lambda t: t.encode("utf-8", "replace")))
def test_any_bytes_are_refused(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "bytes.toml"
    path.write_bytes(content)
    with pytest.raises(ExperimentError):
        load_experiment(path)


# --- the files it writes ------------------------------------------------------------------------------------


def test_only_the_data_unless_asked(write, tmp_path):
    run, _, written = run_experiment(write(), tmp_path / "deep" / "out", progress=False)
    assert written == {"data": tmp_path / "deep" / "out" / "run.nc"}
    assert Run.load(written["data"]).data.equals(run.data)
    assert [p.name for p in (tmp_path / "deep" / "out").iterdir()] == ["run.nc"]


def test_every_output(write, tmp_path):
    names = {"data": "data/a.nc", "html": "a.html", "figure": "plots/a", "summary": "a.json"}
    run, _, written = run_experiment(write({"output": names}), tmp_path / "out", progress=False)
    assert {"data", "html", "summary", "figure-errors.svg", "figure-path.png"} <= written.keys()
    assert all(path.is_file() and path.stat().st_size for path in written.values())
    assert set((tmp_path / "out").rglob("*.*")) == set(written.values())

    def refuse(constant):
        pytest.fail(f"{constant} is not JSON")

    summary = json.loads(written["summary"].read_text(), parse_constant=refuse)
    assert summary["e_p_peak"] == pytest.approx([run.norm("e_p")[0, run.time >= 0.5 * run.time[-1]].max()])
    assert summary["settling_time"] == [None]  # 0.05 s are too short to settle


def test_folders_that_cannot_be_written_to(write, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.experiments.runner.simulate", lambda *_, **__: pytest.fail("computed"))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        run_experiment(write(), tmp_path / "file")
    (tmp_path / "out" / "run.nc").mkdir(parents=True)
    with pytest.raises(InputError, match="there is a folder where the file"):
        run_experiment(write(), tmp_path / "out")


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
