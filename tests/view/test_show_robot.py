"""A robot can be looked at without a run, and a figure of sticks stays together."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol import load_robot
from pathcontrol.cli import main
from pathcontrol.view.bodies.body_shapes import Box, Cylinder
from pathcontrol.view.bodies.sticks import stick_figure
from pathcontrol.view.tour import joints_to_show, tour


def slider(*limits: tuple[float, float], axis: str = "0 0.6 -0.8", rpy: str = "0.4 -0.9 1.7") -> str:
    """A chain of joints that slide along slanted axes."""
    links = "".join(f'<link name="l{i}"/>' for i in range(len(limits) + 1))
    joints = "".join(
        f'<joint name="j{i}" type="prismatic"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>'
        for i, (low, high) in enumerate(limits)
    )
    return f'<robot name="sliders">{links}{joints}</robot>'


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(0, 2)), min_size=1, max_size=3), st.floats(0, 1))
def test_a_block_is_on_its_rail_wherever_its_joint_slides(ranges, share):
    limits = [(low, low + width) for low, width in ranges]
    robot = load_robot(slider(*limits))
    q = np.array([low + share * (high - low) for low, high in limits])
    figure = stick_figure(robot.source)
    rails = {visual.link: visual for visual in figure if visual.name == "rail"}
    blocks = [visual.link for visual in figure if isinstance(visual.shape, Box)]
    assert blocks == [f"l{i + 1}" for i in range(len(limits))]
    for i, block in enumerate(blocks):
        position = robot.frame_pose(q, block)[:3, 3]
        if f"l{i}" not in rails:
            assert max(map(abs, limits[i])) < 0.1  # too short to be seen
            continue
        rail = rails[f"l{i}"]
        assert isinstance(rail.shape, Cylinder)
        inside = np.linalg.inv(robot.frame_pose(q, f"l{i}") @ rail.origin) @ [*position, 1.0]
        np.testing.assert_allclose(inside[:2], 0.0, atol=1e-9)
        assert abs(inside[2]) <= rail.shape.length / 2 + 1e-9


def test_a_rail_meets_the_stick_that_holds_it():
    figure = stick_figure(load_robot(slider((0.5, 0.9))).source)
    [stick], [rail] = ([v for v in figure if v.name == name] for name in ("stick", "rail"))
    end = stick.origin @ [0, 0, stick.shape.length / 2, 1]
    ends = [rail.origin @ [0, 0, side * rail.shape.length / 2, 1] for side in (-1, 1)]
    assert min(np.linalg.norm(end - other) for other in ends) < 1e-9


def test_a_tour_moves_each_joint_alone_within_its_limits(arm):
    limited = load_robot(slider((0.5, 0.9), (-0.1, 3.0)))
    for robot in (arm, limited):
        q = tour(robot).array("q")[0]
        assert (q >= robot.limits.lower - 1e-12).all()
        assert (q <= robot.limits.upper + 1e-12).all()
        moving = np.abs(np.diff(q, axis=0)) > 1e-12
        assert (moving.sum(axis=1) <= 1).all()
        assert moving.any(axis=0).all()
        np.testing.assert_array_equal(q[0], q[-1])


def test_view_shows_a_urdf_and_a_known_robot(tmp_path, monkeypatch):
    (tmp_path / "my_arm.urdf").write_text(slider((0.0, 0.5)))
    monkeypatch.chdir(tmp_path)
    runner = CliRunner()
    for name, page in (("my_arm.urdf", "my_arm.html"), ("cicese_2dof", "cicese_2dof.html")):
        done = runner.invoke(main, ["view", name])
        assert done.exit_code == 0, done.output
        assert "<html" in (tmp_path / page).read_text(encoding="utf-8")[:2000]
    done = runner.invoke(main, ["report", "my_arm.urdf"])
    assert done.exit_code == 2
    assert "pathcontrol view" in done.output


def test_joints_that_are_bound_to_others_stay():
    text = slider((0, 1), (0, 1), (0, 1)).replace(
        'name="j2" type="prismatic">', 'name="j2" type="prismatic"><mimic joint="j1"/>'
    )
    assert joints_to_show(text) == ["j0"]


@pytest.mark.parametrize("text", [slider((0, 0)), slider((0, 1e300)), slider((0, 1), axis="0 0 1", rpy="0 0 0")])
def test_odd_rails_are_drawn_or_left_out(text):
    for visual in stick_figure(load_robot(text).source):
        assert np.isfinite(visual.outline).all()
        assert np.abs(visual.outline).max() < 100
