"""Stability and basins are of one set of gains; rows for several rollouts are refused, whatever their shape."""

import numpy as np
import pytest

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof").with_friction(None)


@pytest.mark.parametrize("k_p", [np.full((2, 1), 800.0), np.full((3, 1), 800.0)], ids=str)
@pytest.mark.parametrize("wrap", [lambda law: law, pc.SpeedOverride], ids=["law", "wrapped"])
@pytest.mark.parametrize("find", [pc.floquet, lambda law: pc.basin(law, 4)], ids=["floquet", "basin"])
def test_gains_of_several_rollouts_are_refused(find, wrap, k_p):
    law = wrap(pc.Projection(ARM, pc.Circle(0.5, 1.0), k_p, 60.0))
    with pytest.raises(pc.InputError, match="k_p has the gains of several rollouts"):
        find(law)


@pytest.mark.parametrize("k", [[5.0, 10.0], [5.0, 10.0, 20.0]], ids=str)
def test_one_k_for_each_of_several_rollouts_is_refused(k):
    with pytest.raises(pc.InputError, match="k has the gains of several rollouts"):
        pc.floquet(pc.ExtendedMotionPlan(ARM, pc.Circle(0.5, 1.0), 800.0, [60.0, 50.0], k=k))
