"""Remarks on runs that plainly failed, and silence on those that did not."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc

ROBOT = pc.load_robot("two_link")
LINE = pc.Line([0.2, 0.3], [1.2, 0.5], 1.0)


def arm():
    return ROBOT.with_friction(None)


class Lazy(pc.MotionController):
    """A law that follows a share of the path only: it stays near to where that begins."""

    gains = ("share",)

    def __init__(self, robot, task, share=1.0):
        self.share = share
        super().__init__(robot, task)

    def torque(self, q, qd, at):
        home = np.asarray(self.task.q_d(np.array(self.task.s0)))
        wanted = home + self.share * (q + at.position_error - home)
        acceleration = 400.0 * (wanted - q) + 40.0 * (self.share * (qd + at.velocity_error) - qd)
        return self.robot.inverse_dynamics(q, qd, acceleration)


def run_of(task, share, duration=4.0, **options):
    law = Lazy(arm(), task, share)
    return pc.simulate(law, np.asarray(task.q_d(np.array(task.s0))), duration=duration, progress=False, **options)


def of_path(run):
    return [one for one in pc.remarks(run) if "limit" not in one]


def test_a_path_whose_plan_ended_without_the_arm_is_told_with_the_distance():
    run = run_of(LINE, 0.4)
    assert run.status[0] == "finished"
    away = np.rad2deg(np.linalg.norm(0.6 * (LINE.end - LINE.start)))
    (said,) = of_path(run)
    assert said.startswith("the path ended, the arm was still ")
    assert float(said.split("still ")[1].split()[0]) == pytest.approx(away, rel=0.02)
    assert of_path(run_of(LINE, 0.4, until="duration")) == [said]  # nor does it get there in the rest of the time


def test_a_path_of_which_the_arm_passed_a_part_is_told_with_that():
    circle = pc.Circle(0.5, 1.0, center=[0.3, 0.8])
    (said,) = of_path(run_of(circle, 0.3))
    assert "of only" in said
    assert said.endswith("% of its path")
    assert float(said.split("of only ")[1].split()[0]) < 50.0


@pytest.mark.parametrize("task", [LINE, pc.Circle(0.5, 1.0, center=[0.3, 0.8])])
@pytest.mark.parametrize("share", [1.0, 0.97])
def test_an_arm_that_went_along_its_path_is_not_remarked_on(task, share):
    assert of_path(run_of(task, share)) == []


def test_an_arm_that_was_not_to_pass_all_of_its_path_is_not_remarked_on():
    assert of_path(run_of(pc.Circle(0.5, 0.2, center=[0.3, 0.8]), 1.0)) == []
    law = pc.Projection(arm(), pc.Circle(0.5, 1.0, center=[0.3, 0.8]), 400.0, 40.0)
    assert of_path(pc.simulate(law, [0.9, 0.9], duration=5.0, progress=False)) == []  # from afar


def test_shares_far_beyond_a_limit_are_told_as_multiples():
    task = pc.Circle(0.5, 1.0, center=[0.3, 0.8])
    law = pc.Projection(arm(), task, 400.0, 40.0)
    run = pc.simulate(law, [2.5, 0.8], duration=0.1, progress=False)
    (said,) = (one for one in pc.remarks(run) if one.startswith("the torque of"))
    ratio = pc.metrics(run)["torque_limit_ratio"][0]
    assert ratio > 2
    assert f"reached {ratio:.3g} times its limit" in said


@pytest.mark.parametrize(("u", "held"), [([[0.1, 0.0]], True), (-0.5, True), (1.0, False)])
def test_an_arm_that_an_operator_holds_is_not_given_larger_gains(u, held):
    law = pc.SpeedOverride(pc.ExtendedMotionPlan(arm(), LINE, 400.0, 40.0, 20.0), u)
    jam = None if held else pc.JammedJoint(0, 0.0, 9.0) + pc.JammedJoint(1, 0.0, 9.0)
    run = pc.simulate(law, LINE.start, duration=2.0, disturbance=jam, progress=False)
    said = pc.remarks(run)[-1]
    assert ("holds its plan" in said) is held
    assert ("larger gains" in said) is not held


@pytest.mark.parametrize("laps", [None, 2])
def test_a_run_that_was_too_short_is_told_how_long_its_path_takes(laps):
    task = LINE if laps is None else pc.Circle(0.5, 1.0, center=[0.3, 0.8])
    needed = task.arc_length() * (laps or 1)  # at 1 rad/s
    (said,) = of_path(run_of(task, 1.0, duration=0.4, laps=laps))
    assert said.endswith(f"by its profile the path takes {needed:.3g} s, which needs a longer duration than 0.4 s")


@pytest.mark.parametrize("start", ["s0", "nearest"])
def test_the_time_that_a_path_takes_is_known_where_it_begins_and_ends_slowly(start):
    profile = pc.SmoothStartStop(LINE, pc.ConstantSpeed(1.0), acceleration=5.0, jerk=100.0)
    law = pc.ComputedTorque(arm(), LINE.with_profile(profile), 400.0, 40.0, start=start)
    begin = LINE.start if start == "s0" else LINE.q_d(np.array(0.6 * LINE.s_end))
    whole = pc.simulate(law, begin, duration=9.0, progress=False)
    (said,) = of_path(pc.simulate(law, begin, duration=0.3, progress=False))
    needed = float(said.split("the path takes ")[1].split()[0])
    assert needed == pytest.approx(whole.finish_time[0], abs=0.1)  # in which the plan is braked at the end


def test_an_arm_that_creeps_is_told_what_holds_it():
    sticky = ROBOT.with_friction(pc.Viscous([1.0, 1.0]) + pc.Coulomb([2.0, 2.0]))
    law = pc.Projection(sticky, pc.Circle(0.5, 0.1, center=[0.3, 0.8]), 400.0, 40.0)
    (said,) = of_path(pc.simulate(law, [0.8, 0.8], duration=2.0, progress=False))
    assert said.startswith("the arm did not get there: it made ")
    assert said.endswith('give the controller friction="full"')
