"""Of a batch all arms, gains and tasks are looked at for steps that are too long; tunings say nothing of candidates."""

import warnings

import numpy as np
import pytest
from scipy import stats

import pathcontrol as pc
from pathcontrol.robot.friction import select_rollout
from pathcontrol.simulation.checks.too_long import StepWarning, warn_of_steps

ARM = pc.load_robot("cicese_2dof").with_friction(None)
CIRCLE = pc.Circle(1.0, 2.0)
ROWS = 12


def told(law, robot, rows=ROWS, loop=None):
    q = np.broadcast_to(CIRCLE.q_d(np.zeros(1)), (rows, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return warn_of_steps([law], loop or pc.SampledLoop(), robot, q, 0 * q, None, 1.0)


def batch(odd, row):
    """Arms of which one is odd."""
    return pc.RobotBatch([odd if i == row else ARM for i in range(ROWS)])


@pytest.mark.parametrize("row", [0, 5, 11])
def test_the_one_arm_that_does_not_bear_the_gains_is_named(row):
    light = ARM.with_masses([0.2, 0.2])
    law = pc.PDPlus(ARM, CIRCLE, 100.0, [80.0, 50.0])
    alone, together = told(law, light, 1), told(law, batch(light, row))
    assert told(law, ARM, 1) == ""
    assert f"(rollout {row})" in together
    assert together.replace(f" (rollout {row})", "") == alone


@pytest.mark.parametrize("row", [0, 7])
def test_the_one_rollout_with_steep_friction_is_found(row):
    """Its own friction, whether it is that of one of many arms or a row of the coefficients of one arm."""
    static, velocity = np.full((ROWS, 2), 2.0), np.full((ROWS, 2), 0.5)
    velocity[row] = 1e-3
    rows = pc.Stribeck(np.ones((ROWS, 2)), static, velocity)
    alone = told(pc.Projection(ARM, CIRCLE, 800.0, 45.0), ARM.with_friction(select_rollout(rows, row)), 1)
    assert "Stribeck" in alone
    law = pc.Projection(ARM, CIRCLE, 800.0, 45.0)
    assert told(law, batch(ARM.with_friction(select_rollout(rows, row)), row)) == alone
    assert told(law, pc.RobotBatch([ARM] * ROWS, rows)) == alone


def test_rows_of_stribeck_friction_can_be_simulated():
    """Coefficients for each rollout give each what it has alone."""
    rows = pc.Stribeck(np.ones((3, 2)), [[1.0, 1.0], [2.0, 2.0], [4.0, 4.0]], np.full((3, 2), 0.3))
    law = pc.Projection(ARM, CIRCLE, 800.0, 45.0)
    run = pc.simulate(law, [0.9, 0.1], duration=0.1, plant=ARM.with_friction(rows), progress=False)
    for i in range(3):
        alone = ARM.with_friction(select_rollout(rows, i))
        one = pc.simulate(law, [0.9, 0.1], duration=0.1, plant=alone, progress=False)
        assert np.array_equal(one.array("q")[0], run.array("q")[i])


def test_the_one_task_whose_plan_is_too_fast_is_found():
    paths = [pc.Circle(1.0, 1.0)] * 9 + [pc.Circle(1.0, 30.0)] + [pc.Circle(1.0, 1.0)] * 2
    law = pc.ExtendedMotionPlan(ARM, pc.TaskBatch(paths), 800.0, 45.0, k=1e4)
    assert "(rollout 9)" in told(law, ARM)
    assert told(pc.ExtendedMotionPlan(ARM, paths[0], 800.0, 45.0, k=1e4), ARM, 1) == ""


def _candidates(p, samples):
    law = pc.ComputedTorque(ARM, CIRCLE, p["K_p"][:, None], 45.0)
    return {"controller": law, "q": np.tile([0.7, 1.2], (len(samples), 1)), "duration": 0.1}


def test_candidates_of_a_tuning_are_silent_and_a_sweep_speaks_once(tmp_path):
    space = {"K_p": stats.uniform(1e5, 1e6)}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pc.tune(_candidates, space, "e_p_peak", population=5, generations=2, chunk=2, progress=False)
    assert not [w for w in caught if issubclass(w.category, pc.PathControlWarning)]
    with pytest.warns(pc.PathControlWarning, match="gains K_p") as caught:
        pc.sweep(
            _candidates, pc.Space.random(space, 8), tmp_path / "out", metrics=["e_p_peak"], chunk=2, progress=False
        )
    assert len([w for w in caught if w.category is StepWarning]) == 1
