"""The template is the paper's first experiment, and all it shows is valid and is written."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

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

START = np.deg2rad([40.0, 70.0])
NAMES = {"run.nc": "data/a.nc", "run.html": "a.html", '"run"': '"plots/a"', "summary.json": "a.json"}


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The file with outputs of other names, the folder of these, and what has run."""
    path, text = tmp_path_factory.mktemp("template") / "experiment.toml", example_text()
    for usual, name in NAMES.items():
        assert text.count(f"= {usual}") + text.count(f'= "{usual}"') == 1
        text = text.replace(usual, name)
    path.write_text(text.replace("duration = 10.0", "duration = 0.25"), encoding="utf-8")
    return path, path.with_name("out"), run_experiment(path, path.with_name("out"), progress=False)


def test_template_is_the_first_experiment(done, arm):
    path, _, (run, *_) = done
    task = Circle(math.radians(57.3), math.radians(114.59))
    controller = ExtendedMotionPlan(arm, task, 800.0, [45.0, 100.0], 20.0, friction="viscous")
    loop = SampledLoop(period=2.5e-3, encoders=True, velocity="difference", torque_limits=True)
    by_hand = simulate(controller, START, duration=0.25, loop=loop, progress=False)
    assert run.data.equals(by_hand.data)
    assert run.config == by_hand.config | {"experiment": path.read_text(encoding="utf-8")}


def test_every_output(done):
    _, folder, (run, _, written) = done
    assert {"data", "html", "summary", "figure-errors.svg", "figure-path.png"} <= written.keys()
    assert all(path.is_file() and path.stat().st_size for path in written.values())
    assert set(folder.rglob("*.*")) == set(written.values())

    def refuse(constant):
        pytest.fail(f"{constant} is not JSON")

    summary = json.loads(written["summary"].read_text(), parse_constant=refuse)
    assert summary["e_p_peak"] == pytest.approx([run.norm("e_p")[0, run.time >= 0.5 * run.time[-1]].max()])
    assert summary["settling_time"] == [None]  # 0.25 s are too short to settle


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
