"""Paced laws beside the same laws without a pace, on the paper's arm and on others with half of their torque."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof")
LOOPS = {
    "exact": {},
    "encoders": {"encoders": True, "velocity": "difference"},
}
LAWS = ("extended_motion_plan", "projection")
every_law = pytest.mark.parametrize("name", LAWS)
#: each law with each loop and each speed, and each loop at each speed
every_pair = pytest.mark.parametrize(
    ("name", "loop", "speed"),
    [
        ("extended_motion_plan", "exact", 6.0),
        ("extended_motion_plan", "encoders", 9.0),
        ("projection", "exact", 9.0),
        ("projection", "encoders", 6.0),
    ],
)


def make_law(name, arm, task, K_p=800.0, K_v=(45.0, 100.0)):
    if name == "projection":
        return pc.Projection(arm, task, K_p, K_v)
    return pc.ExtendedMotionPlan(arm, task, K_p, K_v, k=20.0)


def contour(law, loop, duration=1.8, **settings):
    """The contour error [deg] of a run that begins on the path at rest, and the run."""
    begin = law.task.q_d(np.array(law.task.s0))
    run = pc.simulate(law, begin, duration=duration, loop=loop, progress=False, **settings)
    return np.rad2deg(pc.contour_error(run)[0]), run


@cache
def paced_circle(name, loop, speed):
    """The contour error of a circle at a pace, for motors with their limits, and the run."""
    law = pc.Paced(make_law(name, ARM, pc.Circle(1.0, speed)))
    return contour(law, pc.SampledLoop(torque_limits=True, **LOOPS[loop]))


def mean_rate(run):
    """The mean rate of s in the second half [1/s]."""
    s, half = run.array("s")[0], len(run.time) // 2
    return (s[-1] - s[half]) / (run.time[-1] - run.time[half])


def late(error):
    """The largest one of the second half."""
    return error[len(error) // 2 :].max()


@every_pair
def test_from_a_start_at_rest_a_paced_law_leaves_its_path_no_farther(name, loop, speed):
    paced, _ = paced_circle(name, loop, speed)
    law = make_law(name, ARM, pc.Circle(1.0, speed))
    plain, _ = contour(law, pc.SampledLoop(torque_limits=True, **LOOPS[loop]))
    assert paced.max() < 1.002 * plain.max()


@every_pair
def test_the_pace_costs_no_more_than_the_friction_of_a_slower_lap(name, loop, speed):
    """Motors without limits go the circle as the law asks: at the speed of the profile, and at that of the pace.

    A slower lap has a larger error, since dry friction that the law does not compensate has more time to displace the
    arm; the pace adds nothing to that.
    """
    free = pc.SampledLoop(**LOOPS[loop])
    paced, run = paced_circle(name, loop, speed)
    fast, free_run = contour(make_law(name, ARM, pc.Circle(1.0, speed)), free)
    share = mean_rate(run) / mean_rate(free_run)
    slow, _ = contour(make_law(name, ARM, pc.Circle(1.0, share * speed)), free)
    assert late(paced) < 1.005 * max(late(fast), late(slow))


@pytest.mark.parametrize("speed", [9.0, 11.0])
@every_law
def test_without_dry_friction_nothing_is_left_but_a_twentieth(arm, name, speed):
    """At 9 rad/s the unpaced law saturates too; only there its error may be opposite to that of friction."""
    loop, law = pc.SampledLoop(torque_limits=True), make_law(name, arm, pc.Circle(1.0, speed))
    plant = arm.with_friction(pc.Viscous(arm.friction.viscous))
    plain, paced = (late(contour(one, loop, plant=plant)[0]) for one in (law, pc.Paced(law)))
    assert paced < 0.08
    assert paced < 0.1 * plain


def arms():
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return {
        "ur5": (pc.load_robot("ur5"), [0.0, -1.2, 1.4, -0.4, 0.5, 0.2]),
        "panda": (pc.load_robot("panda", lock=fingers), [0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.8]),
    }


@pytest.mark.parametrize(("which", "name"), list(zip(("ur5", "panda"), LAWS, strict=True)))
def test_arms_with_half_of_their_torque_stay_on_a_contour(which, name):
    """Peaks over a lap and more, from a start at rest, with dry friction, whose error a slow lap has too.

    Without any friction the error is that of sampling, which is larger in a fast lap.
    """
    robot, home = arms()[which]
    inertia = robot.mass_matrix(home).diagonal()
    robot = robot.with_friction(pc.Viscous(np.full(robot.n, 0.2)) + pc.Coulomb(2.0 * inertia))
    half = 0.5 * robot.limits.effort
    points = np.array(home) + np.random.default_rng(3).normal(size=(6, robot.n)) * 0.3
    path = pc.WaypointPath(points, speed=1.0, closed=True)

    def follow(lap, duration, pace):
        law = make_law(name, robot, path.with_profile(pc.ConstantRate(path.period / lap)), 400.0, 40.0)
        law = pc.Paced(law, torque_limits=half) if pace else law
        error, run = contour(law, pc.SampledLoop(2e-3, torque_limits=half), duration)
        assert np.ptp(run.array("s")) > path.period
        return error.max()

    slow = follow(3.0, 4.0, pace=False)
    assert follow(0.8, 2.4, pace=True) < 1.5 * slow
    assert follow(0.8, 2.4, pace=False) > 3 * slow
