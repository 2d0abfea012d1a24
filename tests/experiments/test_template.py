"""The template is the paper's first experiment, and all it shows is valid."""

from __future__ import annotations

import math
import re

import pytest
from conftest import START

from pathcontrol import (
    Circle,
    ExtendedMotionPlan,
    SampledLoop,
    simulate,
)
from pathcontrol.experiments.load import load_experiment
from pathcontrol.experiments.runner import load_setup, run_experiment
from pathcontrol.experiments.template import example_text
from pathcontrol.registry import KINDS, LOOPS


def test_template_is_the_first_experiment(write_experiment, tmp_path, arm):
    path = write_experiment(example_text().replace("duration = 10.0", "duration = 0.25"))
    run, _, _ = run_experiment(path, tmp_path / "out", progress=False)
    task = Circle(math.radians(57.3), math.radians(114.59))
    controller = ExtendedMotionPlan(arm, task, 800.0, [45.0, 100.0], 20.0, friction="viscous")
    loop = SampledLoop(period=2.5e-3, encoders=True, velocity="difference", torque_limits=True)
    by_hand = simulate(controller, START, duration=0.25, loop=loop, progress=False)
    assert run.data.equals(by_hand.data)
    assert run.config == by_hand.config | {"experiment": path.read_text(encoding="utf-8")}


def test_template_lasts_ten_seconds(write_experiment):
    assert load_setup(write_experiment(example_text())).duration == 10.0


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
def test_template_options_are_valid(write_experiment, section, line):
    key = line.split(" = ")[0]
    text = re.sub(rf"(?m)^#{re.escape(line)}$", "", example_text())
    head, tail = text.split(f"\n[{section}]", 1)
    body, _, rest = tail.partition("\n\n")
    body = re.sub(rf"(?m)^{key} = .*\n", "", body + "\n")
    path = write_experiment(f"{head}\n[{section}]{body}{line}\n\n{rest}")
    written = getattr(load_experiment(path), section)
    assert getattr(written, key) is not None
    if key != "lock":  # which leaves the arm with one joint, and the circle needs two
        load_setup(path)


@pytest.mark.parametrize("block", template_sections())
def test_template_alternatives_are_valid(write_experiment, block):
    section = re.match(r"\[(\w+)\]", block)[1]
    text, replaced = re.subn(rf"(?ms)^\[{section}\].*?\n\n", block + "\n", example_text(), count=1)
    text = text if replaced or section != "disturbance" else f"{text}\n{block}"
    text = text.replace("my_task.py:MyTask", "tasks.py:Spiral").replace("my_law.py:MyLaw", "tasks.py:Law")
    load_setup(write_experiment(text))


def test_template_shows_every_choice():
    text = example_text()
    for kind in (*KINDS, LOOPS):
        for name in kind.members:
            assert f'= "{name}"' in text
