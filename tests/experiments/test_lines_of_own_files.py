"""What code of the user raises is told with the last line of the user's file that it passed."""

from __future__ import annotations

import pytest

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.runner import load_setup

OWN = """
import numpy as np
import pathcontrol as pc


class Ring(pc.PathTask):
    def __init__(self, size=0.5, fails=""):
        self.size, self.fails, self.s0, self.period = size, fails, 0.0, 2 * np.pi
        if fails == "at once":
            raise ValueError("no size")  # at once
        if fails == "deep":
            np.linalg.inv(np.zeros((2, 2)))  # deep
        if fails == "library":
            pc.Circle(-1.0, 1.0)  # library

    def q_d(self, s):
        if self.fails == "path":
            return {}["no"]  # path
        return np.stack([self.size * np.cos(s), self.size * np.sin(s)], axis=-1)

    def theta(self, s):
        return self.rate() + 0 * s

    def rate(self):
        if self.fails == "profile":
            raise ZeroDivisionError("no rate")  # profile
        return 1.0


class Law(pc.MotionController):
    gains = ()

    def torque(self, q, qd, at):
        return q.missing  # law


class Sound(pc.MotionController):
    gains = ()

    def torque(self, q, qd, at):
        return self.robot.gravity(q) + at.position_error
"""
FILE = """
duration = 0.1
robot.source = "cicese_2dof"
task = {{ type = "own.py:Ring", parameters = {parameters} }}
controller.type = "own.py:{law}"
"""


def fail(tmp_path, parameters, law="Sound"):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "mine.toml").write_text(FILE.format(parameters=parameters, law=law))
    with pytest.raises(ExperimentError) as told:
        load_setup(tmp_path / "mine.toml")
    return str(told.value)


def line_of(comment):
    return next(i for i, line in enumerate(OWN.split("\n"), 1) if line.endswith(f"# {comment}"))


@pytest.mark.parametrize("what", ["at once", "deep", "library", "path", "profile"])
def test_a_task_that_raises_is_told_with_its_line(tmp_path, what):
    assert fail(tmp_path, f'{{ fails = "{what}" }}').endswith(f" (own.py, line {line_of(what)})")


def test_a_law_that_raises_is_told_with_its_line(tmp_path):
    assert fail(tmp_path, "{}", "Law").endswith(f" (own.py, line {line_of('law')})")


def test_what_the_file_itself_says_wrong_has_its_key_and_no_line(tmp_path):
    assert "own.py, line" not in fail(tmp_path, "{ sise = 1.0 }")
