"""What is wrong in an experiment file is told by key, before anything is computed."""

from __future__ import annotations

import contextlib
import math
import re

import pytest
from experiment_files import BASE, document, merged
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol import (
    ExperimentError,
    PathControlError,
)
from pathcontrol.experiments.load import load_experiment
from pathcontrol.experiments.runner import load_setup, run_experiment

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
    "wrong choice": ({"controller.friction": "viscos"}, "or 'observed'; did you mean 'viscous'?"),
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
    "posture by joint": (
        {"start.q": {"joint_2": 0.5}},
        "start.q = {'joint_2': 0.5}, expected a list with a number for each joint, in the order joint_1, joint_2",
    ),
    "posture in quotes": ({"start.q": ["1", 0.5]}, "start.q[0] = '1', expected a unit after the number, rad (deg"),
    "frame with a slip": ({"robot.tool": {"frame": "tol", "position": [0, 0, 0.1]}}, "did you mean 'tool'?"),
    "a path that goes round": ({"duration": None}, "a closed path does not end; give duration or laps"),
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
    "parameter missing": ({"task": {"type": "tasks.py:Spiral"}}, "argument: 'size'; it is `Spiral(size"),
    "parameter unknown": (
        {"task": {"type": "tasks.py:Spiral", "parameters": {"size": 1.0, "turn": 1.0}}},
        "task.parameters.turn: unknown key; did you mean 'turns'? it is `Spiral(size, turns=1.0)`",
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
def test_mistakes_are_told_by_key(write_experiment, name):
    changes, message = BAD[name]
    path = write_experiment(changes)
    with pytest.raises(ExperimentError) as caught:
        load_setup(path)
    assert str(caught.value).startswith(f"{str(path)!r} is not a valid experiment:\n  ")
    assert message in str(caught.value)
    assert len(str(caught.value)) < 2000


def test_all_mistakes_are_told_at_once(write_experiment):
    changes = {"duration": -1, "controller.K_x": 1.0, "controller.K_p": "a", "start.p": 1, "loop.encoders": 2}
    with pytest.raises(ExperimentError) as caught:
        load_experiment(write_experiment(changes))
    lines = str(caught.value).splitlines()[1:]
    keys = {re.split("[ :]", line.strip())[0] for line in lines}
    assert keys == changes.keys()


def test_syntax_errors_have_a_line(write_experiment):
    with pytest.raises(ExperimentError, match=r"experiment.toml.*\n.*at line 2, column"):
        load_experiment(write_experiment("duration = 1.0\nrobot = = 2\n"))


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
def test_own_file_that_fails(write_experiment, tmp_path, code, line):
    path = write_experiment({"task": {"type": "failing.py:Spiral"}})
    (tmp_path / "failing.py").write_text(code, encoding="utf-8")
    where = f" at line {line}" if line else ""
    with pytest.raises(ExperimentError, match=f"task.type: failing.py fails{where} with [A-Z]"):
        load_setup(path)


def test_nothing_is_computed_or_written_for_a_bad_file(write_experiment, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.experiments.runner.simulate", lambda *_, **__: pytest.fail("computed"))
    with pytest.raises(ExperimentError):
        run_experiment(write_experiment({"loop.encoders": [1]}), tmp_path / "out")
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
