"""Friction laws of one's own: what is overridden counts, or the class is refused."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pathcontrol.errors import InputError
from pathcontrol.robot.friction import FrictionLaw, Stribeck
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation.plant import Plant


@dataclass(frozen=True, eq=False)
class Falling(FrictionLaw):
    """Stribeck friction that does not say that it varies, with fields of any kind."""

    coulomb: object
    static: object
    velocity: float = 0.1

    @property
    def n(self):
        return len(self.coulomb)

    def levels(self, qd):
        low, high = np.asarray(self.coulomb), np.asarray(self.static)
        level = low + (high - low) * np.exp(-((qd / self.velocity) ** 2))
        return level, level


def test_a_law_that_overrides_torque_only_is_refused_with_what_to_override():
    with pytest.raises(InputError, match=r"Mine overrides torque\(\).*override levels\(qd\)"):

        class Mine(FrictionLaw):
            n = 2

            def torque(self, qd):
                return 3.0 * qd


def test_levels_that_vary_are_noticed_though_the_law_does_not_say_so():
    arm = load_robot("cicese_2dof")
    own = Plant(arm.with_friction(Falling((1.0, 0.5), (2.0, 1.0))), 1e-3)
    known = Plant(arm.with_friction(Stribeck([1.0, 0.5], [2.0, 1.0], [0.1, 0.1])), 1e-3)
    state = same = (np.array([[0.5, 0.2]]), np.array([[0.3, -0.2]]))
    for _ in range(50):
        state, same = own.advance(*state, np.zeros((1, 2))), known.advance(*same, np.zeros((1, 2)))
    assert_array_equal(state, same)


def test_fields_may_be_tuples_lists_and_numbers():
    law = Falling((1.0, 0.5), [2.0, 1.0])
    assert law.describe() == {"law": "Falling", "coulomb": [1.0, 0.5], "static": [2.0, 1.0], "velocity": 0.1}
    assert_allclose(law.select([1]).levels(np.zeros(1))[0], [1.0])
