"""Periods that are too long for the gains."""

import warnings

import numpy as np
import pytest

from pathcontrol.control.motion import ComputedTorque
from pathcontrol.errors import PathControlWarning
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation.too_long import warn_of_period
from pathcontrol.tasks.curves import Circle


@pytest.mark.parametrize("K_p", [1.0, 800.0, 1e5])
@pytest.mark.parametrize("K_v", [1.0, 45.0, 700.0, 900.0])
@pytest.mark.parametrize("h", [2.5e-3, 1e-2, 1e-1])
def test_the_warning_comes_exactly_where_the_held_double_integrator_is_unstable(K_p, K_v, h):
    law = ComputedTorque(load_robot("cicese_2dof"), Circle(1.0, 2.0), K_p, K_v)
    closed = np.array([[1 - K_p * h**2 / 2, h - K_v * h**2 / 2], [-K_p * h, 1 - K_v * h]])
    unstable = np.abs(np.linalg.eigvals(closed)).max() >= 1
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warn_of_period(law, h)
    assert [w.category for w in told] == [PathControlWarning] * bool(unstable)
