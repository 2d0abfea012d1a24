"""Periods that are too long for the gains, steps of the plant that are too long for what is fast in it."""

import re
import warnings

import numpy as np
import pytest

from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.motion_control import ComputedTorque, PDPlus, SlotineLi
from pathcontrol.control.projection import Projection
from pathcontrol.errors import PathControlWarning, SimulationError
from pathcontrol.robot.friction import Stribeck, Viscous
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation.arm.disturbance import Disturbance, FrameForce, Push
from pathcontrol.simulation.checks.fast_modes import add_damping, rate_of_arm, rate_of_friction
from pathcontrol.simulation.checks.too_long import warn_of_steps
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.simulation.sequence import simulate_sequence
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.curves import Circle, Line

ARM = load_robot("cicese_2dof")
CIRCLE = Circle(1.0, 2.0)
LAW = Projection(ARM, CIRCLE, 800.0, [45.0, 100.0])


def told(law, loop=None, arm=ARM, disturbance=None, duration=1.0):
    """What is said before a run."""
    q = law.task.q_d(np.zeros(1))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        said = warn_of_steps([law], loop or SampledLoop(), arm, q, 0 * q, disturbance, duration)
    assert all(issubclass(w.category, PathControlWarning) for w in caught)
    assert said == "; ".join(str(w.message) for w in caught)
    return said


def advised(said):
    return int(re.search(r"take substeps=(\d+)", said).group(1))


# --- gains --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("K_p", [1.0, 800.0, 1e5])
@pytest.mark.parametrize("K_v", [1.0, 45.0, 700.0, 900.0])
@pytest.mark.parametrize("h", [2.5e-3, 1e-2, 1e-1])
def test_gains_are_told_exactly_where_the_held_double_integrator_is_unstable(K_p, K_v, h):
    free = ARM.with_friction(None)
    closed = np.array([[1 - K_p * h**2 / 2, h - K_v * h**2 / 2], [-K_p * h, 1 - K_v * h]])
    unstable = np.abs(np.linalg.eigvals(closed)).max() >= 1
    said = told(ComputedTorque(free, CIRCLE, K_p, K_v), SampledLoop(period=h), free)
    assert ("gains K_p" in said) == unstable
    if unstable:
        longest = min(2 / K_v, 2 * K_v / K_p)
        assert float(re.search(r"period below (\S+) s", said).group(1)) == pytest.approx(longest, rel=5e-3)
        assert "substeps do not help" in said


@pytest.mark.parametrize("make", [PDPlus, lambda arm, task, K_p, K_v: SlotineLi(arm, task, K_p / K_v, K_v)])
def test_gains_in_newton_metres_are_weighed_by_the_inertia(make):
    """The joint that moves most easily counts: what is stable and what is not shows in runs on either side."""
    task = Line([0.0, 0.0], [0.3, 0.2], speed=0.2)
    free, start = ARM.with_friction(None), np.array([0.01, -0.01])
    ends = []
    for K_v in (40.0, 160.0):
        law = make(free, task, 20.0, K_v)
        if said := told(law, arm=free):
            assert type(law).__name__ in said
            with pytest.raises(SimulationError, match="need a period below"), pytest.warns(PathControlWarning):
                simulate(law, start, duration=2.0, until="duration", progress=False)
        else:
            simulate(law, start, duration=2.0, until="duration", progress=False)
        ends.append(bool(said))
    assert ends == [False, True]


def test_a_joint_that_friction_damps_bears_a_higher_gain():
    """PD+ with K_v far above 2M/h is stable on a joint whose viscous friction is far above it too."""
    strong = ARM.with_friction(Viscous([2.0, 400.0]))
    law = PDPlus(strong, CIRCLE, 50.0, [50.0, 150.0], friction="none")
    free = ARM.with_friction(None)
    assert "gains" in told(PDPlus(free, CIRCLE, 50.0, [50.0, 150.0]), arm=free)
    assert told(law, arm=strong) == ""
    run = simulate(law, CIRCLE.q_d(np.zeros(())), duration=1.0, progress=False)
    assert run.norm("e_p").max() < 10.0


# --- the gain of the plan -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("h", "radius", "rate"), [(2.5e-3, 1.0, 2.0), (5e-3, 1.0, 2.0), (2.5e-3, 0.5, 2.0)])
def test_the_gain_of_the_plan_that_a_period_bears(h, radius, rate):
    """k h²‖q_d'‖‖r'‖ = 1 divides gains with which all starts end on the path from those with which some diverge."""
    free, task = ARM.with_friction(None), Circle(radius, radius * rate)
    bound = 1 / (h**2 * radius**2 * rate)
    loop, outcomes = SampledLoop(period=h), []
    for k in (0.9 * bound, 5.0 * bound):
        law = ExtendedMotionPlan(free, task, 800.0, [45.0, 100.0], k)
        assert ("k = " in told(law, loop, free)) == (k > bound)
        runs = []
        for off in ([0.02, 0.01], [0.2, 0.1], [-0.3, 0.4]):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PathControlWarning)
                try:
                    run = simulate(law, task.q_d(np.zeros(())) + off, duration=1.5, loop=loop, progress=False)
                    runs.append(run.norm("e_p")[0, -50:].max() < 1e-3)
                except SimulationError:
                    runs.append(False)
        outcomes.append(runs)
    assert outcomes[0] == [True] * 3
    assert not all(outcomes[1])


# --- the arm ------------------------------------------------------------------------------------------------------


def test_the_fastest_mode_of_a_pendulum_is_its_natural_frequency():
    pendulum = load_robot(
        '<robot name="p"><link name="b"/><link name="l"><inertial><origin xyz="0 0 -0.02"/><mass value="2"/>'
        '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="continuous"><parent link="b"/><child link="l"/><axis xyz="1 0 0"/></joint></robot>'
    )
    omega = np.sqrt(2 * 9.81 * 0.02 / (1e-4 + 2 * 0.02**2))
    assert rate_of_arm(add_damping(pendulum, 0.0), np.zeros((1, 1)), np.zeros((1, 1))) == pytest.approx(omega, rel=1e-6)
    law = ComputedTorque(pendulum, Line([0.0], [0.5], speed=0.5), 100.0, 5.0)
    for period in (0.2, 0.4):
        said = told(law, SampledLoop(period=period / omega), pendulum)
        assert ("under gravity" in said) == (period > 0.3)
        if said:
            assert told(law, SampledLoop(period=period / omega, substeps=advised(said)), pendulum) == ""


def test_the_steepest_fall_of_stribeck_friction():
    """exp(−(v/v_s)²) falls fastest at v_s/√2, by √(2/e)/v_s."""
    arm = ARM.with_friction(Stribeck([1.0, 0.5], [1.0, 2.0], [0.01, 0.02]))
    q = np.array([[0.3, 0.5]])
    expected = 1.5 * np.sqrt(2 / np.e) / 0.02 * np.linalg.inv(arm.mass_matrix(q))[0, 1, 1]
    rate, joint = rate_of_friction(add_damping(arm, 0.0), q)
    assert joint == 1
    assert rate == pytest.approx(expected, rel=0.08)
    said = told(LAW, arm=arm)
    assert "Stribeck friction of joint_2" in said
    assert told(LAW, SampledLoop(substeps=advised(said)), arm) == ""
    assert told(LAW, arm=ARM.with_friction(Stribeck([1.0, 0.5], [1.0, 2.0], [0.5, 0.5]))) == ""


# --- disturbances -------------------------------------------------------------------------------------------------


class Held(Disturbance):
    """A damper and a spring on the joints, for a while."""

    def __repr__(self):
        return f"{self.damping} N m s/rad and {self.stiffness:g} N m/rad"

    def __init__(self, damping, stiffness=0.0, begin=0.3, end=0.8):
        self.damping, self.stiffness, self.begin, self.end = np.asarray(damping), stiffness, begin, end

    def torque(self, t, q, qd):
        return (-self.damping * qd - self.stiffness * (q - 1.0)) * (self.begin < t < self.end)


@pytest.mark.parametrize("held", [Held([0.0, 80.0]), Held([50.0, 250.0]), Held([0.0, 0.0], 1e4)], ids=str)
def test_a_joint_held_for_a_while_needs_substeps_and_with_those_that_are_advised_it_is_held(held):
    start = CIRCLE.q_d(np.zeros(()))
    with pytest.raises(SimulationError, match=r"take substeps=\d+") as error, pytest.warns(PathControlWarning):
        simulate(LAW, start, duration=0.8, disturbance=held, progress=False)
    substeps = advised(str(error.value))
    assert "lower the gains" not in str(error.value)
    runs = []
    with warnings.catch_warnings():
        warnings.simplefilter("error", PathControlWarning)
        for loop in (SampledLoop(substeps=substeps), SampledLoop(substeps=4 * substeps)):
            runs.append(simulate(LAW, start, duration=0.6, loop=loop, disturbance=held, progress=False).array("q")[0])
    # what holds it is held over a step, and so of first order
    assert np.abs(runs[0] - runs[1]).max() < 0.05 * np.ptp(runs[1])


class Stuck(Push):
    """A push of one's own class, with a spring."""

    def torque(self, t, q, qd):
        return super().torque(t, q, qd) - self.share(t) * 1e4 * q


def test_what_depends_on_the_state_is_told_whatever_acts_beside_it():
    push, spring = Push([1.0, 1.0], 0.1, 0.3), Held([0.0, 0.0], 1e4)
    assert "the disturbance, a spring" in told(LAW, disturbance=push + spring)
    assert advised(told(LAW, disturbance=push + spring)) == advised(told(LAW, disturbance=spring))
    assert "Stuck, a spring" in told(LAW, disturbance=Stuck([1.0, 1.0]))


def test_a_force_on_a_frame_is_told_however_short_it_is():
    """The arm swings about a strong force as about gravity."""
    force = FrameForce(ARM, ARM.frame_names[-1], [5e4, 0.0, 0.0], start=0.5032, duration=2.5e-3)
    assert re.search("FrameForce, a spring that is held", told(LAW, disturbance=force))
    assert told(LAW, disturbance=force, duration=0.5) == ""


def test_a_sequence_of_paths_tells_it_too():
    laws = [Projection(ARM, Line([0.0, 0.0], [0.3, 0.2], speed=0.5), 800.0, 45.0)]
    with pytest.raises(SimulationError, match=r"take substeps=\d+"), pytest.warns(PathControlWarning):
        simulate_sequence(laws, [0.0, 0.0], duration=2.0, disturbance=Held([0, 1000.0], begin=0.1), progress=False)


class Noise(Disturbance):
    def __init__(self):
        self._random = np.random.default_rng(0)

    def torque(self, t, q, qd):
        return self._random.normal(size=q.shape)


@pytest.mark.parametrize("disturbance", [None, Push([5.0, 1.0], 0.2, 0.1), Noise(), Held([0.0, 20.0])])
@pytest.mark.parametrize("k", [20.0, 1e4, 7e4])
def test_nothing_is_told_of_what_is_resolved(disturbance, k):
    assert told(ExtendedMotionPlan(ARM, CIRCLE, 800.0, [45.0, 100.0], k), disturbance=disturbance) == ""
    assert told(LAW, disturbance=disturbance) == ""
    assert told(LAW, ContinuousTime(), disturbance=Held([0.0, 1e6])) == ""
