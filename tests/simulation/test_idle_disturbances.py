"""Disturbances that cannot act in the time of a run are told; sums and names of disturbances."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from circle_file import CIRCLE_FILE

import pathcontrol as pc
from pathcontrol.experiments.runner import load_setup

ARM = pc.load_robot("cicese_2dof")
LAW = pc.Projection(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0])
WALL = {"frame": "tool", "point": [0.1, 0.0, -3.0], "normal": [0.0, 0.0, 1.0], "rigid": True}
MADE = {
    "JammedJoint": lambda start, duration: pc.JammedJoint(1, start, duration),
    "PickUp": lambda start, duration: pc.PickUp(1.0, "tool", start, duration),
    "TorqueLimitDrop": lambda start, duration: pc.TorqueLimitDrop(0.5, start, duration),
    "Dropout": lambda start, duration: pc.Dropout(start, duration),
    "Wall": lambda start, duration: pc.Wall(**WALL, start=start, duration=duration),
    "FrictionChange": lambda start, duration: pc.FrictionChange(2.0, start, duration),
    "Push": lambda start, duration: pc.Push([1.0, 0.0], start, duration),
}
CASES = [
    (0.2, 1.0, "from 0.2 s for 1 s, does nothing: it begins after the end"),
    (0.2, np.inf, "from 0.2 s on, does nothing: it begins after the end"),
    (-1.0, 0.5, "is over before the run begins"),
    (0.05, 1e-4, "expected a duration of a step, 0.0025 s, or more"),
]


def simulated(disturbance):
    loop = pc.SampledLoop(torque_limits=True)
    return pc.simulate(LAW, [1.0, 0.0], duration=0.1, loop=loop, disturbance=disturbance, progress=False)


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize(("start", "duration", "said"), CASES)
def test_what_cannot_act_is_told(name, start, duration, said):
    with pytest.warns(pc.PathControlWarning, match=f"{name}, .*{said}"):
        simulated(MADE[name](start, duration))


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize(("start", "duration"), [(0.05, 2.5e-3), (0.05125, 1e-4), (-1.0, 1.05), (0.0, np.inf)])
def test_what_acts_is_not_told(name, start, duration):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulated(MADE[name](start, duration))


def test_sum_adds_disturbances_and_friction_laws():
    q = np.zeros((1, 2))
    assert (sum([pc.Push([1.0, 2.0]), pc.Push([3.0, 4.0])]).torque(0.0, q, q) == [4.0, 6.0]).all()
    assert isinstance(sum([pc.Viscous([1.0, 1.0]), pc.Coulomb([1.0, 1.0])]), pc.FrictionLaw)
    for wrong in (1, None):
        with pytest.raises(TypeError, match="unsupported operand"):
            pc.Push([1.0, 2.0]) + wrong


@pytest.mark.parametrize("name", ["Wall", "PickUp", "FrameForce"])
def test_a_frame_that_no_joint_moves_is_told(name):
    made = {
        "Wall": lambda frame: pc.Wall(**WALL | {"frame": frame}),
        "PickUp": lambda frame: pc.PickUp(1.0, frame, 0.0),
        "FrameForce": lambda frame: pc.FrameForce(ARM, frame, [1.0, 0.0, 0.0]),
    }[name]
    with pytest.warns(pc.PathControlWarning, match=f"no joint moves the frame 'base', so {name} does nothing"):
        simulated(made("base"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulated(made("tool"))


def test_a_long_sum_is_as_good_as_a_short_one(tmp_path):
    kicks = sum(pc.Push([1.0, 0.5], 1e-3 * i, 0.01) for i in range(1500))
    assert kicks.torque(5e-3, np.zeros((1, 2)), np.zeros((1, 2))).tolist() == [6.0, 3.0]  # those from 0 to 5 ms
    run = simulated(sum(pc.Push([1.0, 0.5], 1e-3 * i, 0.01) for i in range(30)))
    run.save(tmp_path / "run.nc")
    described = pc.Run.load(tmp_path / "run.nc").config["disturbance"]["terms"]
    assert [one["disturbance"] for one in described] == ["Push"] * 30


def test_a_file_says_for_ever_and_rigid_by_inf(tmp_path):
    text = CIRCLE_FILE + '[disturbance]\ntype = "wall"\nframe = "tool"\npoint = [0.6, 0, 0]\nnormal = [-1, 0, 0]\n'
    (tmp_path / "wall.toml").write_text(text + "stiffness = inf\nduration = inf\n")
    wall = load_setup(tmp_path / "wall.toml").disturbance
    assert (wall.springs[0], wall.duration) == (np.inf, np.inf)


def test_disturbances_show_their_parameters():
    jam, push = pc.JammedJoint(1, 0.5, 0.1), pc.Push([1.0, 2.0], 0.25)
    assert repr(jam) == "JammedJoint(start=0.5, duration=0.1, joint=1)"
    assert repr(sum([jam, push])) == f"{jam!r} + {push!r}"
