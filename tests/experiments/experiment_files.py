"""Experiment files for tests: one to start from, changes by key, and files that it may name."""

from __future__ import annotations

import json

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
