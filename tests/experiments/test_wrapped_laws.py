"""Laws around laws in experiment files, saved runs and sweeps."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc

FILE = """
duration = 0.35
robot.source = "cicese_2dof"
task = { type = "circle", radius = 1.0, speed = 11.0 }
loop = { torque_limits = true }
[controller]
type = "paced"
torque_margin = 0.2
[controller.law]
type = "speed_override"
override = [[0.2, 0.0]]
acceleration = 5.0
[controller.law.law]
"""
PLAN = 'type = "extended_motion_plan"\nK_p = 800.0\nK_v = [45.0, 100.0]\nk = 20.0\n'
OWN = 'type = "tasks.py:Law"\nparameters = {}\n'
SWEPT = """
[sweep.parameters]
"controller.law.law.k" = { grid = [5.0, 20.0] }
"controller.law.acceleration" = { grid = [5.0, 1.0] }
"""


def by_hand(arm, k=20.0, acceleration=5.0):
    task = pc.Circle(1.0, 11.0)
    law = pc.ExtendedMotionPlan(arm, task, 800.0, [45.0, 100.0], k)
    law = pc.Paced(pc.SpeedOverride(law, [[0.2, 0.0]], acceleration), 0.2)
    begin, loop = task.q_d(np.array(0.0)), pc.SampledLoop(torque_limits=True)
    return pc.simulate(law, begin, duration=0.35, loop=loop, progress=False)


def test_a_file_wraps_laws_by_tables_within_tables(tmp_path, arm, monkeypatch):
    path = tmp_path / "paced.toml"
    path.write_text(FILE + PLAN, encoding="utf-8")
    run, _, _ = pc.run_experiment(path, tmp_path / "out", progress=False)
    np.testing.assert_array_equal(run.array("q"), by_hand(arm).array("q"))
    said = run.config["controller"]
    assert said["controller"] == "Paced(SpeedOverride(ExtendedMotionPlan))"
    assert (said["torque_margin"], said["acceleration"], said["k"]) == (0.2, 5.0, 20.0)
    saved = pc.Run.load(tmp_path / "out" / "run.nc")
    assert saved.config["controller"] == said
    assert pc.speed_factor(saved)[0, 0] == 0.0
    # its figures are made, which depends on the laws; how they are drawn does not
    monkeypatch.setattr("pathcontrol.view.report.pictures._draw", lambda figure: ("svg+xml", b"<svg/>"))
    pc.report(saved, tmp_path / "report.html")


def test_a_law_of_ones_own_is_wrapped_too(tmp_path):
    law = (
        "import pathcontrol as pc\n"
        "class Law(pc.ComputedTorque):\n"
        "    def __init__(self, robot, task):\n"
        "        super().__init__(robot, task, 800.0, 57.0)\n"
    )
    (tmp_path / "tasks.py").write_text(law, encoding="utf-8")
    path = tmp_path / "own.toml"
    path.write_text(FILE + OWN, encoding="utf-8")
    run, _, _ = pc.run_experiment(path, tmp_path / "out", progress=False)
    assert run.config["controller"]["controller"] == "Paced(SpeedOverride(Law))"


def test_a_sweep_varies_what_is_inside(tmp_path):
    path = tmp_path / "swept.toml"
    path.write_text(FILE + PLAN + SWEPT, encoding="utf-8")
    result = pc.run_sweep(path, tmp_path / "out", progress=False)
    assert result.samples == 4


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("torque_margin = 0.2", "torque_margin = 1.5"), "torque_margin"),
        (("override = [[0.2, 0.0]]", "override = 3.0"), "override"),
        (("acceleration = 5.0", "acceleration = 0.0"), "acceleration"),
        (("k = 20.0", "k = -1.0"), "k"),
        (("[controller.law.law]", "[controller.law.lau]"), "law"),
    ],
)
def test_mistakes_are_told_by_their_keys(tmp_path, change, told):
    path = tmp_path / "bad.toml"
    path.write_text((FILE + PLAN).replace(*change), encoding="utf-8")
    with pytest.raises(pc.ExperimentError, match=told):
        pc.run_experiment(path, tmp_path / "out", progress=False)


EVENTS = """
duration = 1.0
robot.source = "cicese_2dof"
task = { type = "circle", radius = 0.5, speed = 1.0 }
disturbance = { type = "jammed_joint", joint = 1, start = 0.3, duration = 0.3 }
[controller]
type = "event_plan"
threshold = 8.0
pause = 0.1
[controller.law]
"""


def test_an_event_plan_of_a_file_halts_at_a_jam(tmp_path):
    path = tmp_path / "events.toml"
    path.write_text(EVENTS + PLAN, encoding="utf-8")
    run, _, _ = pc.run_experiment(path, tmp_path / "out", progress=False)
    assert run.config["controller"]["controller"] == "EventPlan(ExtendedMotionPlan)"
    factor = pc.speed_factor(pc.Run.load(tmp_path / "out" / "run.nc"))[0]
    assert factor[0] == pytest.approx(1.0, abs=1e-12)  # the engine has the circle as a table
    assert factor[run.time < 0.6].min() < 0.05


def test_a_threshold_that_is_none_is_told_by_its_key(tmp_path):
    path = tmp_path / "events.toml"
    path.write_text(EVENTS.replace("threshold = 8.0", "threshold = -8.0") + PLAN, encoding="utf-8")
    with pytest.raises(pc.ExperimentError, match="threshold"):
        pc.run_experiment(path, tmp_path / "out", progress=False)


TWO_STROKES = """
duration = 5.0
robot = { source = "cicese_2dof", tool = { frame = "tool", position = [0.0, 0.0, -0.05], name = "pen" } }
[task]
type = "toolpath"
file = "two.svg"
frame = "pen"
workpiece = { position = [0.30, -0.05, 0.65], rpy = [1.5707963267948966, 0.0, 0.0] }
feed = 0.1
clearance = 0.0
[controller]
type = "speed_override"
override = 1.0
[controller.law]
friction = "full"
"""
SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="40mm" viewBox="0 0 60 40">
<path d="M 10 10 L 30 10"/><path d="M 10 30 L 30 30"/></svg>"""


@pytest.mark.parametrize(("override", "told"), [("1.0", False), ("[[0.0, 0.9]]", False), ("[[0.1, 0.5]]", True)])
def test_steps_of_an_override_that_each_contour_takes_anew_are_told(tmp_path, recwarn, override, told):
    (tmp_path / "two.svg").write_text(SVG, encoding="utf-8")
    path = tmp_path / "two.toml"
    path.write_text(TWO_STROKES.replace("override = 1.0", f"override = {override}") + PLAN, encoding="utf-8")
    run, _, _ = pc.run_experiment(path, tmp_path / "out", progress=False)
    assert len(run.array("path_status")) > 1
    found = [str(w.message) for w in recwarn if issubclass(w.category, pc.PathControlWarning)]
    assert any("count from the begin of each of the" in message for message in found) == told
