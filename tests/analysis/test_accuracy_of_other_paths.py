"""Accuracy along a path that is given, whose parameter is another than that of the run."""

import numpy as np
import pytest
import sympy

import pathcontrol as pc

S = sympy.symbols("s")
TURNS = pc.SymbolicPath([sympy.cos(2 * sympy.pi * S), sympy.sin(2 * sympy.pi * S)], speed=2.0, period=1.0)


@pytest.mark.parametrize("known", [True, False], ids=["other path", "no path"])
def test_laps_are_counted_along_the_path_that_is_given(known):
    time, radius = np.arange(0.0, 12.0, 0.01), 1.02
    x = np.column_stack([np.cos(2 * time), np.sin(2 * time)])
    motion = time, radius * x, 2 * radius * np.column_stack([-x[:, 1], x[:, 0]])
    run = pc.Run.from_log(*motion, task=pc.Circle(1.0, 2.0) if known else None)
    found = pc.accuracy(run, TURNS)
    assert found.cycles == int(24 / (2 * np.pi)) - 1
    assert found.path_accuracy == pytest.approx(radius - 1, abs=1e-9)
    assert found.velocity_accuracy == pytest.approx(radius - 1, abs=1e-6)
    bar = pc.ballbar(run, TURNS)
    assert bar.error == pytest.approx(radius - 1, abs=1e-12)
    assert np.ptp(bar.angle) == pytest.approx(2 * 2 * np.pi, abs=0.04)


@pytest.mark.parametrize("begin", ["late", None, [1.0]])
def test_a_begin_of_means_that_is_no_time_is_refused(begin):
    arm, circle = pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0)
    run = pc.simulate(pc.Projection(arm, circle, 800.0, 60.0), [1.0, 0.0], duration=0.02, progress=False)
    with pytest.raises(pc.InputError, match="begin"):
        pc.power_balance(run).means(begin=begin)


def test_a_power_balance_of_another_path_is_refused():
    arm, circle = pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0)
    run = pc.simulate(pc.Projection(arm, circle, 800.0, 60.0), [1.0, 0.0], duration=0.02, progress=False)
    with pytest.raises(pc.InputError, match="another path"):
        pc.power_balance(run, pc.Projection(arm, pc.Circle(0.5, 2.0), 800.0, 60.0))
    same = pc.power_balance(run, pc.Projection(arm, pc.Circle(1.0, 2.0), 800.0, 60.0))
    assert (same.V == pc.power_balance(run).V).all()


@pytest.mark.parametrize("find", [pc.accuracy, pc.ballbar])
@pytest.mark.parametrize("wrong", [{"rollout": "a"}, {"rollout": 0.5}, {"frame": 3}], ids=str)
def test_a_rollout_or_a_frame_of_another_kind_is_refused(find, wrong):
    arm, circle = pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0)
    run = pc.simulate(pc.Projection(arm, circle, 800.0, 60.0), [1.0, 0.0], duration=0.02, progress=False)
    with pytest.raises(pc.PathControlError, match=r"rollout = |no frame 3"):
        find(run, **wrong)


@pytest.mark.parametrize("find", [pc.accuracy, pc.ballbar])
def test_an_arm_that_goes_round_backwards_is_told(find):
    time = np.arange(0.0, 8.0, 0.02)
    run = pc.Run.from_log(time, np.column_stack([np.cos(time), -np.sin(time)]), task=pc.Circle(1.0, 1.0))
    with pytest.raises(pc.InputError, match=r"1\.27 laps against the direction"):
        find(run)
    assert find(run, pc.Circle(1.0, 1.0, clockwise=True), skip=0).unit == "rad"
