"""A class of one's own in a file of one's own is used from Python, an experiment file, a saved run and a report."""

from __future__ import annotations

import importlib
import re
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc
from pathcontrol import ExperimentError, Run
from pathcontrol.experiments.load import read_toml
from pathcontrol.experiments.runner import load_setup, run_experiment
from pathcontrol.experiments.samples.swept_experiment import SweptExperiment
from pathcontrol.experiments.sweep_runner import of_samples
from pathcontrol.registry import Kind
from pathcontrol.view.report.report import report
from pathcontrol.view.report.reproduction import recipe

OWN = '''
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pathcontrol as pc
from pathcontrol.arguments import Form, Unit


class Stiff(pc.MotionController):
    """PD with gravity compensation."""

    gains = ("K", "D")

    def __init__(self, robot, task, K: Annotated[object, Form.GAIN, Unit("N m/rad")], D=100.0, **options):
        super().__init__(robot, task, **options)
        self.K, self.D = pc.diagonal_gain("K", K, robot.n), pc.diagonal_gain("D", D, robot.n)

    def torque(self, q, qd, ref):
        return self.robot.gravity(q) + self.K * ref.position_error + self.D * ref.velocity_error


class Flower(pc.PathTask):
    period = 2 * np.pi

    def __init__(self, size: Annotated[float, Unit("rad")], leaves=3):
        self.size, self.leaves = size, leaves

    def q_d(self, s):
        radius = self.size * (1 + 0.1 * np.cos(self.leaves * s))
        return np.stack([radius * np.cos(s), radius * np.sin(s)], axis=-1)

    def theta(self, s):
        return np.ones_like(s)


class Breathing(pc.VelocityProfile):
    def __init__(self, rate, depth):
        self.rate, self.depth = rate, depth

    def theta(self, path, s):
        return self.rate * (1 + self.depth * np.cos(s))

    def dtheta(self, path, s):
        return -self.rate * self.depth * np.sin(s)


@dataclass(frozen=True, eq=False)
class Rough(pc.FrictionLaw):
    level: object

    @property
    def n(self):
        return len(self.level)

    def levels(self, qd):
        level = np.asarray(self.level) / (1 + np.abs(qd))
        return level, level


class Bump(pc.Disturbance):
    def __init__(self, height, at=0.1):
        self.height, self.at = np.asarray(height), at

    def torque(self, t, q, qd):
        return self.height * np.exp(-(((t - self.at) / 0.02) ** 2))
'''
FILE = """
angle_unit = "deg"
duration = 0.3
[robot]
source = "cicese_2dof"
[task]
type = "{place}:Flower"
parameters = {{ size = 45.0, leaves = 5 }}
profile = {{ type = "{place}:Breathing", parameters = {{ rate = 2.0, depth = 0.3 }} }}
[controller]
type = "{place}:Stiff"
parameters = {{ K = "2000 N m/rad", D = [100.0, 10.0], friction = "none" }}
[plant]
friction = {{ type = "{place}:Rough", parameters = {{ level = [3.0, 1.0] }} }}
[disturbance]
type = "{place}:Bump"
parameters = {{ height = [20.0, -5.0] }}
[output]
html = "run.html"
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The module, as a user would import it."""
    (tmp_path / "my_classes.py").write_text(OWN, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("my_classes")
    del sys.modules["my_classes"]


@pytest.fixture
def in_python(own, arm):
    """The run of all five classes, made in Python."""
    task = own.Flower(np.deg2rad(45.0), 5).with_profile(own.Breathing(2.0, 0.3))
    law = own.Stiff(arm, task, 2000.0, [100.0, 10.0], friction="none")
    plant, bump = arm.with_friction(own.Rough([3.0, 1.0])), own.Bump([20.0, -5.0])
    q = task.q_d(np.array(0.0))
    return pc.simulate(law, q, duration=0.3, plant=plant, disturbance=bump, progress=False)


def assert_same(run, other):
    for name in run.data.data_vars:
        assert_array_equal(other.array(name), run.array(name), err_msg=name)


@pytest.mark.parametrize("place", ["my_classes.py", "my_classes"])
def test_an_experiment_file_has_them(place, own, in_python, tmp_path):
    (tmp_path / "own.toml").write_text(FILE.format(place=place), encoding="utf-8")
    run = run_experiment(tmp_path / "own.toml", tmp_path / "out", progress=False).run
    assert_same(in_python, run)
    assert run.config["disturbance"]["disturbance"] == "Bump"
    assert np.abs(run.array("e_p")).max() > 0.01  # it is pushed


def test_classes_that_are_defined_are_named_alone(own, in_python, tmp_path):
    text = FILE.format(place="").replace('":', '"')
    plain = re.sub(r"parameters = \{ (.*?) \}(?= \})", r"\1", text)
    plain = re.sub(r"parameters = \{ (.*) \}", lambda match: re.sub(r", (?=[a-zD])", "\n", match[1]), plain)
    (tmp_path / "own.toml").write_text(plain, encoding="utf-8")
    assert_same(in_python, run_experiment(tmp_path / "own.toml", tmp_path / "out", progress=False).run)
    (tmp_path / "own.toml").write_text(plain.replace("size = 45.0", "sise = 45.0"), encoding="utf-8")
    with pytest.raises(ExperimentError, match=r"task\.sise: unknown key; did you mean 'size'\?"):
        load_setup(tmp_path / "own.toml")


def test_a_saved_run_knows_what_it_can_be_made_of_again(in_python, tmp_path):
    loaded = Run.load(in_python.save(tmp_path / "run.nc"))
    assert_same(in_python, loaded)
    s = np.linspace(0.0, 6.0, 50)
    assert_allclose(loaded.task.q_d(s), in_python.task.q_d(s), atol=1e-10)
    assert_allclose(loaded.task.theta(s), in_python.task.theta(s), rtol=1e-8)
    qd = np.array([[0.3, -0.2], [-2.0, 0.1]])
    assert_array_equal(loaded.robot.friction.torque(qd), in_python.robot.friction.torque(qd))


def test_a_friction_law_that_nobody_has_defined_is_left_out_with_a_warning(in_python, tmp_path, monkeypatch):
    file = in_python.save(tmp_path / "run.nc")
    monkeypatch.setattr(Kind, "defined", lambda kind: {})
    with pytest.warns(UserWarning, match="without its friction: friction law 'Rough'"):
        assert not Run.load(file).robot.friction.torque(np.ones(2)).any()


def test_the_script_of_a_report_imports_them(in_python, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    in_python.save("mine.nc")
    found = recipe("mine", in_python)
    assert "from my_classes import Stiff\nfrom my_classes import Bump\nimport pathcontrol as pc\n" in found.text
    namespace = {}
    exec(found.text, namespace)
    assert_allclose(namespace["run"].array("q"), in_python.array("q"), rtol=0, atol=1e-9)


def test_a_report_shows_the_file_that_names_them(own, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])
    text = FILE.format(place="my_classes.py")
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    run = run_experiment(tmp_path / "own.toml", tmp_path / "out", progress=False).run
    assert "my_classes.py:Stiff" in report({"own": run}, tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "py:Stiff",
            "py:Stif",
            "there is no 'Stif' in my_classes.py; did you mean 'Stiff'? its Controller subclasses are Stiff",
        ),
        ("py:Stiff", "py:Flower", "controller.type: 'Flower' in my_classes.py is not a subclass of pathcontrol.Contr"),
        ("py:Bump", "py:Rough", "disturbance.type: 'Rough' in my_classes.py is not a subclass of pathcontrol.Disturb"),
        ("my_classes.py:Rough", "none.py:Rough", "plant.friction.type: there is no Python file"),
        ("my_classes.py:Rough", "no_module:Rough", "plant.friction.type: the module 'no_module' cannot be imported"),
        (
            "K = ",
            "k = ",
            "controller.parameters: missing a required argument: 'K'; it is `Stiff(robot, task, K, D=100.0, **",
        ),
        (
            "K = ",
            "DD = 3.0, K = ",
            "got an unexpected keyword argument 'DD' (my_classes.py, line 16); did you mean 'D'?",
        ),
        ("2000 N m/rad", "2000 N m s", "controller.parameters.K = '2000 N m s', expected a finite quantity in N m/rad"),
        (
            "depth = 0.3",
            "deep = 0.3",
            "task.profile.parameters.deep: unknown key; did you mean 'depth'? it is `Breathing(rate, depth)`",
        ),
        ("depth = 0.3", "rest = 0.3", "parameters.rest: unknown key; it is `Breathing(rate, depth)`"),
        ("rate = 2.0, ", "", "task.profile.parameters: missing a required argument: 'rate'; it is `Breathing("),
        ("2000 N m/rad", "stiff", "parameters.K = 'stiff', expected a finite number, or a list with one for each"),
        ("size = 45.0", 'size = "large"', "task: "),
        ("height = [20.0, -5.0]", "height = [1.0, 2.0, 3.0]", "disturbance: Bump.torque has shape (3,), expected"),
        ("level = [3.0, 1.0]", "level = [3.0, 1.0, 1.0]", "plant.friction"),
    ],
)
def test_what_is_wrong_is_told_by_key(own, tmp_path, old, new, message):
    text = FILE.format(place="my_classes.py")
    assert old in text
    (tmp_path / "own.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ExperimentError) as error:
        load_setup(tmp_path / "own.toml")
    assert message in str(error.value)


def test_gains_of_ones_own_law_vary_within_the_batches_of_a_sweep(own, tmp_path):
    (tmp_path / "own.toml").write_text(FILE.format(place="my_classes.py"), encoding="utf-8")
    swept = SweptExperiment(of_samples(read_toml(tmp_path / "own.toml")), tmp_path)
    gains, sizes = np.array([2000.0, 900.0, 400.0]), np.array([45.0, 30.0, 45.0])
    names = {"controller.parameters.K": gains, "task.parameters.size": sizes, "disturbance.parameters.at": gains / 1e5}
    parts = swept({name: names[name] for name in list(names)[:2]}, np.arange(3))
    [(rows, arguments)] = parts
    assert rows.tolist() == [0, 1, 2]
    assert_array_equal(arguments["controller"].K, gains[:, None])
    run = pc.simulate(**arguments, progress=False)
    for i in range(3):
        [(_, alone)] = swept({name: names[name][i : i + 1] for name in list(names)[:2]}, np.array([i]))
        assert_allclose(run.array("q")[i], pc.simulate(**alone, progress=False).array("q")[0], rtol=0, atol=1e-12)
    # nobody knows whether a disturbance of one's own may have rows
    assert [rows.tolist() for rows, _ in swept(names, np.arange(3))] == [[0], [1], [2]]
