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
