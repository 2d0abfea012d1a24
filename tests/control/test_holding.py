"""Holding: nothing winds up, whatever the length, and what a hold adds on the contour is what dry friction does."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.simulation.compiled_plant import CompiledPlant

START = np.deg2rad([40.0, 70.0])
PERIOD = 2.5e-3
ACCELERATION = 10.0  # 1/s, of an override
ROUND = 2 * np.pi * np.arange(10) / 10  # path parameters of moments all round the circle
LAWS = ("extended_motion_plan", "projection")


def make(arm, name, task=None, **options):
    task = task or pc.Circle(1.0, 2.0)
    if name == "projection":
        return pc.Projection(arm, task, 800.0, [45.0, 100.0], **options)
    return pc.ExtendedMotionPlan(arm, task, 800.0, [45.0, 100.0], 20.0, **options)


@pytest.mark.parametrize(
    ("name", "wrapped"),
    [
        *((name, "plain") for name in LAWS),
        *(("projection", wrapped) for wrapped in ("observed", "event plan", "paced")),
    ],
)
def test_a_hold_is_an_orbit_of_a_few_ticks_of_loop_and_arm(arm, name, wrapped):
    """Some seconds into a hold posture, velocity, torque and state repeat to the last bit, but for a clock.

    Each tick is a function of these alone, so they are the same after an hour, and so is all that follows the hold.
    Which of a few roundings an integrator of the observer ends in depends on the processor.
    """
    law = make(arm, name, friction="observed" if wrapped == "observed" else "viscous")
    law = pc.SpeedOverride(pc.EventPlan(law) if wrapped == "event plan" else law)
    law = pc.Paced(law) if wrapped == "paced" else law
    tick, plant = pc.ControlTick(law, 2 * PERIOD), CompiledPlant(arm, 2 * PERIOD)
    q, qd = START[None], np.zeros((1, 2))
    tick.start(q[0], qd[0])
    limit, seen = arm.limits.effort, []
    for i in range(650):
        if i == 100:
            tick.hold()
        tau = np.clip(tick(q[0], qd[0]), -limit, limit)
        q, qd = plant.advance(q, qd, tau[None])
        seen.append(np.concatenate([q[0], qd[0], tau, tick.state]))
    clock = {6 + 1 + law.observer.size - 1} if law.observer is not None else set()
    pace = {len(seen[0]) - 1} if wrapped == "paced" else set()  # falls towards 0 by a share of itself
    kept = [i for i in range(len(seen[0])) if i not in clock | pace]
    held = np.array(seen[600:])[:, kept]
    assert any((held[ticks:] == held[:-ticks]).all() for ticks in range(1, 9))
    assert np.ptp(held, axis=0).max() < 1e-14
    assert np.abs(qd).max() < 1e-12
    if pace:
        assert 0 <= seen[-1][-1] < seen[600][-1] < 1e-12


def hold_everywhere(law, **settings):
    """From the path, a run without and a batch of ten with a hold of 0.8 s, begun at moments all round the circle."""
    held, point = pc.SpeedOverride(law, [[0.9, 0.0], [1.7, 1.0]]), law.task.at(ROUND)
    settings = {"loop": pc.SampledLoop(PERIOD, torque_limits=True), "progress": False} | settings
    return (
        pc.simulate(law, point.q_d[:1], qd=point.velocity[:1], duration=5.0, **settings),
        pc.simulate(held, point.q_d, qd=point.velocity, duration=2.2, **settings),
    )


def late_contour(run):
    return pc.contour_error(run)[:, run.time > 0.6].max()


def static_error(arm, task):
    """The largest contour error that dry friction makes at an infinitely slow pace: |nᵀM⁻¹F|/k_p."""
    s = np.linspace(0, 2 * np.pi, 721)
    point = task.at(s)
    level = np.array([np.maximum(*arm.friction.levels(qd)) for qd in point.velocity])
    push = np.linalg.solve(arm.mass_matrix(point.q_d), (level * np.sign(point.velocity))[..., None])[..., 0]
    return np.abs(np.vecdot(point.q_d, push)).max() / 800.0


@pytest.mark.parametrize("name", LAWS)
def test_a_hold_adds_only_what_sampling_does_where_there_is_no_dry_friction(arm, name):
    """The torque for a changing speed keeps its direction for a tick h, in which the path turns by ϑh: aϑ·ϑh/k_p."""
    plain, held = hold_everywhere(
        make(arm, name, start="nearest"), plant=arm.with_friction(pc.Viscous(arm.friction.viscous))
    )
    assert late_contour(held) < late_contour(plain) + ACCELERATION * 2.0**2 * PERIOD / 800.0


@pytest.mark.parametrize("name", LAWS)
def test_a_hold_adds_at_most_a_tick_of_friction_where_it_is_compensated(arm, name):
    """A law that knows dry friction has its sign wrong for a tick where a joint stops: (e_n k_p)h² at most."""
    law = make(arm, name, friction="full", start="nearest")
    plain, held = hold_everywhere(law)
    assert late_contour(held) < late_contour(plain) + static_error(arm, law.task) * 800.0 * PERIOD**2


@pytest.mark.parametrize("name", LAWS)
def test_with_dry_friction_a_hold_adds_no_more_than_a_slow_pace_would(arm, name):
    law = make(arm, name, start="nearest")
    plain, held = hold_everywhere(law)
    assert late_contour(held) < static_error(arm, law.task)
    assert late_contour(held) < 1.05 * late_contour(plain)


@pytest.mark.parametrize("name", LAWS)
def test_where_motors_cannot_hold_and_resume_as_fast_a_pace_keeps_the_path(arm, name):
    """At 8 rad/s Mq_d'ϑẇ is beyond the limits at 10 1/s; the pace lets w follow as the motors can."""
    task = pc.Circle(1.0, 8.0)
    law = make(arm, name, task, start="nearest")
    held = pc.SpeedOverride(law, [[0.8, 0.0], [1.3, 1.0]], ACCELERATION)
    starts = task.q_d(2 * np.pi * np.arange(24) / 24)
    peaks = []  # at last that of a slow passage, which is what dry friction does
    for one in (held, pc.Paced(held), make(arm, name, pc.Circle(1.0, 1.0))):
        slow, loop = len(peaks) == 2, pc.SampledLoop(PERIOD, torque_limits=True)
        run = pc.simulate(one, starts[:1] if slow else starts, duration=8.0 if slow else 1.9, loop=loop, progress=False)
        peaks.append(pc.contour_error(run)[:, run.time > (1.0 if slow else 0.8)].max())
    assert peaks[1] < peaks[2] < peaks[0]


def test_in_a_sequence_each_law_counts_the_time_from_the_begin_of_its_path(arm):
    """Held at 0.5 s of both paths; the buttons act on whichever law runs."""
    laws = [
        pc.SpeedOverride(
            pc.ExtendedMotionPlan(arm, pc.Line(a, b, 1.0), 800.0, [45.0, 100.0], 20.0), [[0.5, 0.0], [1.5, 1.0]], 10.0
        )
        for a, b in (([0.0, 0.0], [1.0, 1.0]), ([1.0, 1.0], [0.2, 1.6]))
    ]
    run = pc.simulate_sequence(laws, [0.0, 0.0], duration=6.0, loop=pc.SampledLoop(5e-3), progress=False)
    assert run.status[0] == "finished"
    for path in range(2):
        one = run.path(path)
        since, sdot = one.time - one.time[0], one.array("sdot")[0]
        assert (sdot[(since > 1.3) & (since < 1.45)] == 0.0).all()
        assert sdot[(since > 0.2) & (since < 0.5)].min() > 0.3
