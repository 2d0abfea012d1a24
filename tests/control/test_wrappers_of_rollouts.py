"""Wrappers around laws of several rollouts: one start for all of them, and what is refused by its name."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof")
TASK = pc.Circle(1.0, 2.0)
START = [1.0, 0.0]
ROWS = [[400.0], [800.0]]
THRESHOLDS = [[15.0, 1.5], [30.0, 3.0]]


def make_plan(K_p=800.0, k=20.0, **options):
    return pc.ExtendedMotionPlan(ARM, TASK, K_p, [45.0, 100.0], k, **options)


def run(law, q=START, **settings):
    return pc.simulate(law, q, **{"duration": 0.02, "progress": False} | settings)


class Forgetful(pc.ExtendedMotionPlan):
    """A law that does not compensate what its observer sees."""

    def law(self, t, q, qd, z):
        return super().law(t, q, qd, z)._replace(observation=None)


class Deaf(pc.ExtendedMotionPlan):
    """A law that takes the speed from its task, so that it goes at full speed whatever a wrapper asks for."""

    def point(self, s):
        return super().point(s)._replace(theta=self.task.theta(s), dtheta=self.task.dtheta(s))

    def timed(self, s):
        return np.zeros(s.shape, dtype=bool)


class Waiting(pc.ExtendedMotionPlan):
    """A law that waits at first, whatever a wrapper asks for."""

    def law(self, t, q, qd, z):
        if t >= 0.01 or self.speed is None:
            return super().law(t, q, qd, z)
        return pc.ExtendedMotionPlan.law(self.at_speed(np.zeros(q.shape[:-1])), t, q, qd, z)


class Unmade(pc.Projection):
    """A law whose constructor does not call that of its base class."""

    def __init__(self):
        pass


@pytest.mark.parametrize(
    "law",
    [
        make_plan(ROWS, friction="observed"),
        make_plan(friction="observed", observer_hz=[[20.0, 20.0], [35.0, 30.0]]),
        pc.SpeedOverride(make_plan(ROWS), 0.5),
        pc.SpeedOverride(make_plan(k=[10.0, 20.0]), 0.5),
        pc.SpeedOverride(make_plan(ROWS), [0.5, 1.0]),
        pc.Paced(make_plan(ROWS)),
        pc.Paced(pc.SpeedOverride(make_plan(), [0.5, 1.0])),
        pc.EventPlan(make_plan(ROWS)),
        pc.EventPlan(make_plan(), threshold=THRESHOLDS),
        pc.EventPlan(pc.SpeedOverride(make_plan(ROWS), lambda t: [0.5, 1.0]), threshold=THRESHOLDS),
        pc.Learned(make_plan(ROWS)),
        pc.Learned(pc.SpeedOverride(make_plan(), [0.5, 1.0])),
    ],
)
def test_one_start_is_as_many_equal_ones(law):
    one, both = run(law), run(law, [START, START])
    for name in ("q", "s", "e_v", "tau"):
        assert_array_equal(one.array(name), both.array(name))


def test_no_starts_have_no_states():
    plan, none = make_plan(), np.zeros((0, 2))
    for law in (plan, pc.SpeedOverride(plan), pc.EventPlan(pc.Paced(plan)), pc.Learned(plan)):
        z = law.start(none, none)
        assert z.shape == (0, len(law.start(START, [0.0, 0.0])))
        out = law.law(0.0, none, none, z)
        assert (out.tau.shape, law.advance(z, out, 2.5e-3).shape) == (none.shape, z.shape)


def test_other_numbers_of_rows_than_of_starts_are_refused_by_name():
    plan, three = make_plan(), [*THRESHOLDS, [60.0, 6.0]]
    for law, name in (
        (pc.SpeedOverride(plan, [1.0, 0.0, -1.0]), "override has 3 values for 2"),
        (pc.SpeedOverride(plan, lambda t: [1.0, 0.0, -1.0]), "override has 3 values for 2"),
        (pc.EventPlan(plan, threshold=three), "threshold has 3 values for 2"),
        (pc.EventPlan(plan, observer_hz=three), "observer_hz has rows for 3"),
    ):
        with pytest.raises(pc.InputError, match=name):
            run(law, [START, START])
    with pytest.raises(pc.InputError, match="override has 2 values for 3"):
        run(pc.EventPlan(pc.SpeedOverride(plan, [1.0, 0.5]), threshold=three))


def test_what_is_no_law_is_not_wrapped():
    for wrap in (pc.SpeedOverride, pc.Paced, pc.EventPlan, pc.Learned, lambda law: pc.ControlTick(law, 1e-3)):
        for other in (None, TASK):
            with pytest.raises(pc.InputError, match="expected a Controller"):
                wrap(other)
        with pytest.raises(pc.InputError, match=r"Unmade.__init__ does not call super\(\)"):
            wrap(Unmade())


@pytest.mark.parametrize("make", [pc.ControlTick, pc.PositionCommand])
def test_one_arm_takes_one_speed(make):
    plan = make_plan()
    for law in (
        pc.SpeedOverride(plan, [1.0, 0.5]),
        pc.EventPlan(plan, threshold=THRESHOLDS),
        pc.EventPlan(plan, observer_hz=THRESHOLDS),
        make_plan(k=[10.0, 20.0]),
    ):
        with pytest.raises(pc.InputError, match="rollouts"):
            make(law, 1e-3)
    driven = make(pc.SpeedOverride(plan), 1e-3)
    for bad in ([1.0, 2.0], lambda t: [1.0, 2.0], lambda t: 9.0, np.nan):
        with pytest.raises(pc.InputError, match="override"):
            driven.override(bad)
    driven.override([0.5])
    assert np.isfinite(driven(np.array(START), np.zeros(2)) if make is pc.ControlTick else driven.step(START)).all()


def test_errors_of_a_law_inside_name_its_class():
    law = Forgetful(ARM, TASK, 800.0, [45.0, 100.0], 20.0, friction="observed")
    for wrap in (pc.SpeedOverride, pc.Paced, pc.EventPlan, pc.Learned, lambda one: pc.EventPlan(pc.Learned(one))):
        with pytest.raises(pc.InputError, match=r"^Forgetful\.law does not"):
            run(wrap(law))
    with pytest.raises(pc.InputError, match=r"^SpeedOverride\(ExtendedMotionPlan\) has K_p of shape"):
        run(pc.SpeedOverride(make_plan(ROWS)), [START] * 3)


@pytest.mark.parametrize("drive", [run, lambda law: pc.ControlTick(law, 2.5e-3), lambda law: law.start(START, [0, 0])])
def test_a_law_that_does_not_go_by_its_speed_is_not_wrapped_in_silence(drive):
    law = Deaf(ARM, TASK, 800.0, [45.0, 100.0], 20.0)
    for wrap in (pc.SpeedOverride, pc.EventPlan, lambda one: pc.SpeedOverride(pc.Learned(one), 0.5)):
        with pytest.raises(pc.InputError, match=r"Deaf\.law gives the same torques .* self\.point"):
            drive(wrap(law))


class Planned(Waiting):
    """One that knows what to do for 10 s."""

    def law(self, t, q, qd, z):
        return [super().law][int(t // 10)](t, q, qd, z)


@pytest.mark.parametrize("kind", [Waiting, Planned])
def test_a_law_that_goes_by_its_speed_after_a_while_is_wrapped(kind):
    law = kind(ARM, TASK, 800.0, [45.0, 100.0], 20.0)
    free, held = (run(pc.SpeedOverride(law, u), duration=0.2) for u in (1.0, [[0.1, 0.0]]))
    assert free.array("s")[0, -1] > held.array("s")[0, -1] + 0.05


def test_a_pace_without_limits_is_told_apart_from_an_arm_without():
    for none in (False, None, [np.inf, np.inf]):
        with pytest.raises(pc.InputError, match=r"torque_limits = .* leave them out for those of cicese_2dof"):
            pc.Paced(make_plan(), torque_limits=none)


@pytest.mark.parametrize(
    ("law", "first"),
    [
        (pc.SpeedOverride(pc.SpeedOverride(make_plan(), 0.5), 0.5), [0.25]),
        (pc.SpeedOverride(pc.SpeedOverride(make_plan(), [0.5, -1.0]), 0.5), [0.25, -0.5]),
        (pc.EventPlan(pc.SpeedOverride(make_plan(), 0.5)), [0.5]),
        (pc.SpeedOverride(pc.EventPlan(make_plan()), 0.5), [0.5]),
    ],
)
def test_wrappers_in_wrappers_start_at_the_product_of_their_speeds(law, first):
    w = pc.speed_factor(run(law))
    expected = np.repeat(np.array(first)[:, None], w.shape[1], axis=1)
    assert_allclose(w, expected, rtol=1e-14)  # rounding; it used to sink within an acceleration of 2/s
