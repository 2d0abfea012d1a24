"""Friction that a law's model knows, and friction that only the arm has."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import ExperimentError, InputError
from pathcontrol.experiments.runner import load_setup

DRY = pc.Coulomb([40.0, 8.0])
LINE = pc.Line([0.2, 0.3], [0.5, 0.1], 0.05)


def law_of(known, mode="full"):
    return pc.Projection(pc.load_robot("two_link", friction=known), LINE, 4.0, 4.0, friction=mode)


def run_of(law, arm):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run = pc.simulate(law, [0.2, 0.3], duration=1.0, plant=arm, progress=False)
    return run, [str(one.message) for one in said]


def test_a_robot_is_loaded_with_a_friction_of_ones_own():
    robot = pc.load_robot("ur5", lock={"wrist_3_joint": 0.0}, friction=pc.Viscous(np.full(5, 2.0)))
    assert (robot.friction.torque(np.ones((1, 5))) == 2.0).all()
    with pytest.raises(InputError, match="5 joints"):
        pc.load_robot("ur5", friction=pc.Viscous(np.full(5, 2.0)))
    with pytest.raises(InputError, match="friction"):
        pc.load_robot("ur5", friction=[1.0] * 6)


@pytest.mark.parametrize("known", [None, pc.Viscous([1.0, 1.0])])
def test_full_compensation_by_a_model_that_knows_no_dry_friction_is_told_at_the_start(known):
    arm = pc.load_robot("two_link", friction=DRY)
    run, said = run_of(law_of(known), arm)
    assert any('friction="full" compensates what the model' in one for one in said)
    assert any("did not move" in one and "joint 1 has 40 N m, its model 0 N m" in one for one in said)
    (remark,) = (one for one in pc.remarks(run) if "stands still" in one)
    assert "load_robot(…, friction=…)" in remark
    assert 'give the controller friction="full"' not in remark


def test_a_law_whose_model_knows_the_friction_moves_the_arm_without_a_warning():
    arm = pc.load_robot("two_link", friction=DRY)
    run, said = run_of(law_of(DRY), arm)
    assert not [one for one in said if "friction" in one]
    assert np.ptp(run.array("q")[0, :, 0]) > 0.01
    _, said = run_of(law_of(DRY, "viscous"), arm)
    assert any('give the controller friction="full"' in one for one in said)
    _, said = run_of(law_of(None), pc.load_robot("two_link"))
    assert not [one for one in said if "friction" in one]


FILE = """
duration = 0.1
robot = {{ source = "ur5"{friction} }}
task = {{ type = "line", start = [0, -1.2, 1.4, -0.2, 1.5, 0], end = [0.5, -1.2, 1.4, -0.2, 1.5, 0], speed = 0.1 }}
controller = {{ type = "projection", k_p = 400.0, K_v = 40.0, friction = "full" }}
"""
COULOMB = "friction = { coulomb = [5.0, 5.0, 5.0, 1.0, 1.0, 1.0] }"


@pytest.mark.parametrize(
    ("robot", "plant", "known", "has"),
    [
        ("", "", 0.0, 0.0),
        (COULOMB, "", 5.0, 5.0),
        (COULOMB, "plant.friction = 'urdf'", 5.0, 0.0),
        (COULOMB, "plant.friction = 'none'", 5.0, 0.0),
        (COULOMB, "plant.payload = { mass = 1.0, frame = 'tool0' }", 5.0, 5.0),
        (COULOMB, "plant.friction = { coulomb = [7, 7, 7, 1, 1, 1] }", 5.0, 7.0),
        ("friction = 'none'", "plant.friction = { coulomb = [7, 7, 7, 1, 1, 1] }", 0.0, 7.0),
        ("friction = [{ type = 'coulomb', plus = [3, 3, 3, 1, 1, 1] }]", "", 3.0, 3.0),
    ],
)
def test_the_robot_of_a_file_has_friction_that_the_plant_takes_over(tmp_path, robot, plant, known, has):
    path = tmp_path / "mine.toml"
    path.write_text(FILE.format(friction=f", {robot}" if robot else "") + plant + "\n")
    setup = load_setup(path)
    levels = [float(np.max(arm.friction.levels(np.zeros(6))[0])) for arm in (setup.controller.robot, setup.plant)]
    assert levels == [known, has]


def test_a_wrong_friction_of_the_robot_is_told_by_its_key(tmp_path):
    path = tmp_path / "mine.toml"
    for friction in ("{ coulomb = [5.0] }", "'full'", "{ coulom = [5.0] }"):
        path.write_text(FILE.format(friction=f", friction = {friction}"))
        with pytest.raises(ExperimentError, match=r"robot\.friction"):
            load_setup(path)
