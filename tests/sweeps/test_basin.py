"""Basins of attraction: what returns and what does not, the ball in closed form, chunks that change nothing."""

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import InputError
from pathcontrol.sweeps import basin as module

ARM = pc.load_robot("cicese_2dof")
FREE = ARM.with_friction(None)
CIRCLE = pc.Circle(1.0, 2.0)
QUICK = {"duration": 0.6, "progress": False}


def projection(arm=FREE, task=CIRCLE):
    return pc.Projection(arm, task, 800.0, [45.0, 50.0])


def test_all_that_is_guaranteed_returns():
    """On its own model, finely sampled, from V < ½k_p R²: a grid of postures over the circle of radius 1, at rest."""
    found = pc.basin(projection(), 36, margin=0.5, loop=pc.SampledLoop(period=1e-3), **QUICK)
    assert len(found.q) == 36
    np.testing.assert_allclose(found.distance, np.abs(np.linalg.norm(found.q, axis=1) - 1.0), atol=1e-12)
    # at rest e_v is the planned velocity of 2 rad/s
    assert found.ball == pytest.approx(np.sqrt(1.0 - 4.0 / 800.0), rel=1e-9)
    np.testing.assert_array_equal(found.guaranteed, found.distance < found.ball)
    assert found.guaranteed.any()
    assert found.returned[found.guaranteed].all()
    counts = found.to_dict()
    assert (counts["starts"], counts["guaranteed_not_returned"]) == (36, 0)
    assert counts["reach"]["value"] == pytest.approx(1.0)


def test_chunks_change_nothing(monkeypatch):
    whole = pc.basin(projection(ARM), 25, **QUICK)
    monkeypatch.setattr(module, "_AT_ONCE", 1.0)  # one rollout at a time
    single = pc.basin(projection(ARM), whole.q[:7], **QUICK)
    np.testing.assert_array_equal(single.returned, whole.returned[:7])
    np.testing.assert_array_equal(single.return_time, whole.return_time[:7])
    run = pc.simulate(projection(ARM), whole.q, duration=0.6, until="duration", progress=False)
    late = run.time >= 0.54
    np.testing.assert_array_equal(whole.returned, (run.norm("e_p")[:, late] <= 0.05).all(1))


def test_motors_that_are_too_weak_bring_nothing_back():
    loop = pc.SampledLoop(torque_limits=[1.0, 0.1])
    found = pc.basin(projection(ARM), 16, loop=loop, **QUICK)
    assert found.share == 0.0
    assert np.isnan(found.return_time).all()
    assert found.guaranteed.any()  # the theorem knows of no limits
    edges, share, count = found.share_by_distance(4)
    assert count.sum() == 16
    assert edges[-1] >= found.distance.max()
    assert np.nansum(share) == 0.0


def test_who_rests_on_the_path_has_not_returned():
    """An arm that friction holds on the path is as near as can be, and does not go along it."""
    stuck = FREE.with_friction(pc.Coulomb([5000.0, 5000.0]))
    law = projection(FREE)
    assert not pc.basin(law, [[1.0, 0.0]], plant=stuck, **QUICK).returned.any()
    found = pc.basin(law, [[1.0, 0.0]], [0.0, 2.0], **QUICK)
    assert found.returned.all()
    assert found.return_time[0] == 0.0


def test_the_guarantee_of_each_law():
    start = [[0.8, 0.9]]
    plan = pc.basin(pc.ExtendedMotionPlan(FREE, CIRCLE, 800.0, 45.0, k=20.0), start, **QUICK)
    assert (plan.guaranteed.all(), plan.ball) == (True, np.inf)
    paced = pc.basin(pc.Paced(projection()), start, **QUICK)  # a speed factor changes no theorem
    assert paced.ball == pc.basin(projection(), start, **QUICK).ball
    line = pc.basin(projection(task=pc.Line([0.5, 0.5], [1.0, 1.0], 0.5)), start, **QUICK)
    assert not line.guaranteed.any()
    assert np.isnan(line.ball)
    eight = pc.basin(projection(task=pc.Lissajous([1.0, 0.5], [1, 2], speed=1.0)), start, **QUICK)
    assert eight.ball == 0.0  # it crosses itself


def test_starts_around_a_path_of_more_joints():
    n = 3
    path = pc.Lissajous(np.full(n, 0.3), [1, 2, 1], speed=0.5, center=[0.1, 0.2, 0.3])
    one, same, other = (module.make_starts(path, 50, 0.4, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    away = np.linalg.norm(path.q_d(path.sigma_bar(one)) - one, axis=1)
    assert away.max() <= 0.4
    assert away.max() > 0.2
    grid = module.make_starts(CIRCLE, 10, 0.5, 0)
    assert grid.shape == (16, 2)
    np.testing.assert_allclose([grid.min(), grid.max()], [-1.5, 1.5], atol=1e-4)


def test_figures_of_basins():
    found = pc.basin(projection(ARM), 9, loop=pc.SampledLoop(torque_limits=[60.0, 3.3]), **QUICK)
    assert len(pc.attraction_figure({"one": found, "two": found}).axes) == 3  # two maps and their colours
    pc.attraction_figure(found)
    with pytest.raises(InputError, match="basin"):
        pc.attraction_figure(3)


def test_what_is_no_start_is_told():
    with pytest.raises(InputError, match="starts"):
        pc.basin(projection(), [[0.1, 0.2, 0.3]], **QUICK)
    with pytest.raises(InputError, match="starts"):
        pc.basin(projection(), 0, **QUICK)
    with pytest.raises(InputError, match="margin"):
        pc.basin(projection(), 4, margin=-1.0, **QUICK)
    with pytest.raises(InputError, match="rollout"):
        pc.basin(pc.ExtendedMotionPlan(FREE, CIRCLE, [[800.0, 1.0], [700.0, 1.0]], 45.0, k=20.0), [[0.1, 0.2]], **QUICK)
