"""The slowest mode of arms with six and seven joints decays in simulation as Floquet multipliers say."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from test_floquet import arm_of

import pathcontrol as pc

LAP = 0.6
CENTER = {6: [0.0, -1.2, 1.4, -0.2, 1.5, 0.0], 7: [0.0, -0.3, 0.0, -1.8, 0.0, 1.8, 0.0]}


def law_of(kind, n):
    """A law of which one joint is slower than the others, on a path that does not cross itself."""
    path = pc.Lissajous(np.full(n, 0.2), 1 + np.arange(n) % 2, 0.5, phases=0.5 * np.arange(n), center=CENTER[n])
    task, slow = path.with_profile(pc.ConstantRate(path.period / LAP)), np.arange(n) == 1
    if kind == "plan":
        return pc.ExtendedMotionPlan(arm_of(n), task, np.where(slow, 80.0, 400.0), 40.0, 5.0)
    return pc.Projection(arm_of(n), task, 200.0, np.where(slow, 120.0, 30.0))


def at(run, row, s):
    """The state (q, q̇) of a rollout where the path parameter is s."""
    passed = run.array("s")[row]
    begin = np.searchsorted(passed, s) - 12
    near = slice(begin, begin + 24)
    state = np.concatenate([run.array("q"), run.array("qd")], axis=-1)[row, near]
    return make_interp_spline(passed[near], state, k=9)(s)


@pytest.mark.parametrize(("kind", "n"), [("plan", 7), ("projection", 6)])
def test_the_slowest_mode_decays_in_simulation_at_its_rate(kind, n):
    """From beside the path along the mode; compared where both are at the same s, one lap and two laps later."""
    law = law_of(kind, n)
    found, task = pc.floquet(law), law.task
    slowest = np.where(np.arange(len(found.exponents)) == found.along, -np.inf, found.exponents.real).argmax()
    mode = found.modes[:, slowest]
    mode = (mode / mode[np.abs(mode).argmax()]).real[: 2 * n]
    begin = task.at(np.zeros(1))
    starts = np.concatenate([begin.q_d, begin.velocity], axis=-1) + np.array([[0.0], [1e-5]]) * mode
    loop = pc.ContinuousTime(output_period=5e-3, rtol=1e-9, atol=1e-12)
    run = pc.simulate(law, starts[:, :n], starts[:, n:], duration=1.3, loop=loop, until="duration", progress=False)
    first = np.round(run.array("s")[:, 0] / task.period) * task.period  # the lap that each is counted from
    apart = [
        np.linalg.norm(at(run, 1, s + first[1]) - at(run, 0, s + first[0])) for s in task.period * np.array([1, 2])
    ]
    assert np.log(apart[0] / apart[1]) / LAP == pytest.approx(found.decay_rate, rel=1e-3)
