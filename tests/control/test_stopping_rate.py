"""The default rate of a speed override: what torque limits leave beside the motion, everywhere on the path."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.control.wrappers.stopping_rate import stopping_rate

ARM = pc.load_robot("cicese_2dof")
LIMIT = ARM.limits.effort
UNLIMITED = (
    '<robot name="free"><link name="a"/><link name="b"><inertial><mass value="1"/><origin xyz="0.1 0 0"/><inertia '
    'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous">'
    '<parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>'
)


def torque(task, s, w, rate):
    """M(q)q̈ + C(q,q̇)q̇ + g(q) + F_v q̇ of the motion at the factor w that changes at a rate, by finite differences."""
    h = 1e-5

    def velocity(t):
        return (w + rate * t) * task.at(s + w * task.theta(s) * t).velocity

    qd, qdd = velocity(0.0), (velocity(h) - velocity(-h)) / (2 * h)
    return ARM.inverse_dynamics(task.q_d(s), qd, qdd) + ARM.friction.viscous * qd


@given(
    speed=st.floats(0.5, 7.5),
    s=st.floats(0.0, 2 * np.pi),
    w=st.floats(0.0, 1.0),
    share=st.floats(-1.0, 1.0),
)
def test_torques_stay_within_their_limits_while_a_plan_stops_and_goes_on(speed, s, w, share):
    """The margin of a tenth is more than what lies between the samples."""
    task = pc.Ellipse([1.0, 0.8], speed)
    rate = stopping_rate(ARM, task)
    if rate > 2.0:
        assert (np.abs(torque(task, np.asarray(s), w, share * rate)) <= 0.91 * LIMIT).all()


@pytest.mark.parametrize("speed", [5.5, 6.0, 7.0, 7.5])
def test_a_larger_rate_would_take_more_than_nine_tenths_of_a_limit_somewhere(speed):
    task = pc.Circle(1.0, speed)
    rate = stopping_rate(ARM, task)
    assert 2.0 < rate < 10.0
    used = max(
        (np.abs(torque(task, np.asarray(s), w, way * 1.02 * rate)) / LIMIT).max()
        for s in np.linspace(0, 2 * np.pi, 129)
        for w in (0.0, 0.5, 1.0)
        for way in (-1, 1)
    )
    assert used > 0.9


@pytest.mark.parametrize(("speed", "rate"), [(1.0, 10.0), (11.0, 2.0)])
def test_the_rate_is_ten_where_motors_are_strong_and_two_where_they_are_too_weak(speed, rate):
    assert stopping_rate(ARM, pc.Circle(1.0, speed)) == rate


def test_without_limits_it_is_ten_and_of_many_tasks_that_of_the_hardest():
    assert stopping_rate(pc.load_robot(UNLIMITED), pc.Line([0.0], [1.0], 50.0)) == 10.0
    circles = [pc.Circle(1.0, 3.0), pc.Circle(1.0, 7.0)]
    assert stopping_rate(ARM, pc.TaskBatch(circles)) == pytest.approx(stopping_rate(ARM, circles[1]), rel=1e-12)


def test_a_speed_override_takes_it_and_says_so():
    law = pc.Projection(ARM, pc.Circle(1.0, 6.0), 800.0, [45.0, 100.0])
    assert pc.SpeedOverride(law).describe()["acceleration"] == stopping_rate(ARM, law.task)
    assert pc.SpeedOverride(law, acceleration=3.0).describe()["acceleration"] == 3.0
