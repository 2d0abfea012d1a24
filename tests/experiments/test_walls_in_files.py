"""Walls in experiment files: lengths with units, several at once, in the engine."""

from __future__ import annotations

import pathcontrol as pc


def test_a_file_has_walls_that_the_arm_meets(tmp_path):
    file = tmp_path / "wall.toml"
    file.write_text(
        """
        duration = 2.0
        [robot]
        source = "cicese_2dof"
        [task]
        type = "circle"
        radius = 1.0
        speed = 2.0
        [start]
        q = [0.2, 0.3]
        [controller]
        type = "extended_motion_plan"
        K_p = 800.0
        K_v = [45.0, 100.0]
        k = 20.0
        [[disturbance]]
        type = "wall"
        frame = "tool"
        point = ["600 mm", 0.0, 0.0]
        normal = [-1.0, 0.0, 0.0]
        stiffness = 1e5
        friction = 0.2
        [[disturbance]]
        type = "wall"
        frame = "tool"
        point = [-0.7, 0.0, 0.0]
        normal = [1.0, 0.0, 0.0]
        rigid = true
        """
    )
    run = pc.run_experiment(file, tmp_path / "out", progress=False).run
    x = pc.load_robot("cicese_2dof").frame_pose(run.array("q")[0], "tool")[:, 0, 3]
    assert 0.6 < x.max() < 0.615  # 0.795 without it
    assert run.config["engine"] == "compiled"
